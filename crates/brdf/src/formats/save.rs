//! Writes what was loaded or made in one of our own formats.

use std::path::Path;

use super::{FormatError, Loaded, Problem, measured_csv, netcdf, write_file};
use crate::{Meaning, Measured};

/// A format that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The native file.
    Netcdf,
    /// Measured CSV.
    Csv,
    /// `model.json`.
    Model,
}

/// What the format written could not keep; empty where nothing was lost.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[must_use = "tell the user what was lost"]
pub struct Saved {
    /// One sentence each.
    pub losses: Vec<String>,
}

impl Target {
    /// The format that a name asks for: `.nc`, `.csv` or `.json`.
    ///
    /// # Errors
    /// [`Problem::Unsuitable`] for other endings.
    pub fn from_path(path: &Path) -> Result<Self, FormatError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("nc") => Ok(Self::Netcdf),
            Some("csv") => Ok(Self::Csv),
            Some("json") => Ok(Self::Model),
            other => Err(FormatError::new(
                path,
                Problem::Unsuitable {
                    content: "the output".to_owned(),
                    format: "a file of this ending",
                    advice: format!(
                        "the name ends in {:?}; give one that ends in .nc, .csv or .json",
                        other.unwrap_or_default()
                    ),
                },
            )),
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Netcdf => "NetCDF",
            Self::Csv => "measured CSV",
            Self::Model => "model.json",
        }
    }
}

/// Writes `content` as `target`, whole or not at all.
///
/// # Errors
/// [`Problem::Exists`] without `force`; [`Problem::Unsuitable`] where the format cannot hold this content, with what to do instead.
pub fn save(path: &Path, content: &Loaded, target: Target, force: bool) -> Result<Saved, FormatError> {
    let (bytes, saved) = bytes(content, target).map_err(|p| FormatError::new(path, p))?;
    write_file(path, &bytes, force)?;
    Ok(saved)
}

fn bytes(content: &Loaded, target: Target) -> Result<(Vec<u8>, Saved), Problem> {
    let unsuitable = |what: &str, advice: &str| Problem::Unsuitable {
        content: what.to_owned(),
        format: target.name(),
        advice: advice.to_owned(),
    };
    Ok(match (target, content) {
        (Target::Netcdf, Loaded::Table(table)) => (netcdf::write(table)?, Saved::default()),
        (Target::Csv, Loaded::Table(table)) => (measured_csv::write(table).into_bytes(), csv_losses(table)),
        (Target::Csv, Loaded::Scattered(s)) => {
            (measured_csv::write_scattered(s).into_bytes(), Saved::default())
        }
        (Target::Model, Loaded::Model(model)) => ((model.to_json()? + "\n").into_bytes(), Saved::default()),
        (Target::Netcdf, Loaded::Scattered(_)) => {
            return Err(unsuitable("a set of scattered measurements", "it has no grid; write .csv"));
        }
        (Target::Netcdf | Target::Csv, Loaded::Function(_) | Loaded::Model(_)) => {
            return Err(unsuitable("a function", "take its values on a grid first"));
        }
        (Target::Model, _) => return Err(unsuitable("a measurement", "fit a model to it first")),
    })
}

fn csv_losses(table: &Measured) -> Saved {
    let mut losses = Vec::new();
    if matches!(table.meaning, Meaning::CellMean { .. }) {
        losses.push(if table.node.is_some() {
            "cell means are left out: the file holds the node values derived from them".to_owned()
        } else {
            "cell means are written as they are, but readers of this format take them as values at the nodes"
                .to_owned()
        });
    }
    if table.base.is_some() {
        losses.push("the base coat is left out".to_owned());
    }
    if !table.sigma_parts.is_empty() {
        losses.push("the parts of sigma are left out".to_owned());
    }
    if !table.attributes.is_empty() {
        losses.push("sample record and provenance are left out".to_owned());
    }
    Saved { losses }
}
