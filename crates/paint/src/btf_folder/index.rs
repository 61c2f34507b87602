//! The TOML of a folder: which picture belongs to which angles.

use std::path::Path;

use gonio_optics::Angle;
use serde::{Deserialize, Serialize};

use super::BtfFolderError;
use crate::car_paint::Through;

/// Name of the TOML in its folder.
pub const INDEX_NAME: &str = "slices.toml";
const FORMAT: &str = "gonio-flake-btf";
const VERSION: u32 = 1;
/// Angles closer than this are one, degrees.
const SAME_DEG: f64 = 1e-6;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub format: String,
    pub version: u32,
    pub texel_mm: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coat_index: Option<f64>,
    #[serde(default = "two_way")]
    pub through: String,
    #[serde(default)]
    pub slice: Vec<Slice>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Slice {
    pub half_deg: f64,
    pub incidence_deg: f64,
    pub file: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub full_scale: Option<f64>,
}

fn two_way() -> String {
    Through::TwoWay.name().to_owned()
}

/// The slices in order of half angle, then angle of incidence, with their axes.
#[derive(Debug)]
pub(super) struct Index {
    pub half: Vec<Angle>,
    pub incidence: Vec<Angle>,
    pub slices: Vec<Slice>,
    pub texel_mm: f64,
    pub coat_index: Option<f64>,
    pub through: Through,
}

impl File {
    pub(super) fn new(texel_mm: f64, coat_index: Option<f64>, through: Through, slice: Vec<Slice>) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            texel_mm,
            coat_index,
            through: through.name().to_owned(),
            slice,
        }
    }
}

impl Index {
    pub(super) fn parse(path: &Path, text: &str) -> Result<Self, BtfFolderError> {
        let refuse = |reason: String| BtfFolderError::Index { path: path.to_owned(), reason };
        let value = |key: &str, found: &dyn std::fmt::Display, expected| BtfFolderError::Value {
            path: path.to_owned(),
            key: key.to_owned(),
            found: found.to_string(),
            expected,
        };
        let file: File = toml::from_str(text).map_err(|e| refuse(e.to_string()))?;
        if file.format != FORMAT {
            return Err(value("format", &file.format, "gonio-flake-btf"));
        }
        if file.version > VERSION {
            return Err(value("version", &file.version, "1, the newest this program reads"));
        }
        if !(file.texel_mm > 0.0 && file.texel_mm.is_finite()) {
            return Err(value("texel_mm", &file.texel_mm, "a length above 0, in mm"));
        }
        if let Some(n) = file.coat_index
            && !(n > 1.0 && n <= 4.0)
        {
            return Err(value("coat_index", &n, "above 1, at most 4; leave it out for no coat"));
        }
        let through = Through::from_name(&file.through)
            .ok_or_else(|| value("through", &file.through, "two-way or refracted-only"))?;
        for (k, s) in file.slice.iter().enumerate() {
            for (key, deg) in [("half_deg", s.half_deg), ("incidence_deg", s.incidence_deg)] {
                if !(0.0..=90.0).contains(&deg) {
                    return Err(value(&format!("slice[{k}].{key}"), &deg, "an angle within 0 … 90 degrees"));
                }
            }
            if let Some(scale) = s.full_scale
                && !(scale > 0.0 && scale.is_finite())
            {
                return Err(value(&format!("slice[{k}].full_scale"), &scale, "a number above 0, in 1/sr"));
            }
        }
        if file.slice.is_empty() {
            return Err(refuse("it lists no slice; add a [[slice]] for each picture".to_owned()));
        }
        let half = distinct(file.slice.iter().map(|s| s.half_deg));
        let incidence = distinct(file.slice.iter().map(|s| s.incidence_deg));
        let slices = ordered(path, file.slice, &half, &incidence)?;
        let angles = |deg: Vec<f64>| deg.into_iter().map(Angle::from_degrees).collect();
        Ok(Self {
            half: angles(half),
            incidence: angles(incidence),
            slices,
            texel_mm: file.texel_mm,
            coat_index: file.coat_index,
            through,
        })
    }
}

/// Rising angles that occur.
fn distinct(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = angles.collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|b, a| (*b - *a).abs() < SAME_DEG);
    all
}

/// Every pair of angles with its slice.
fn ordered(
    path: &Path,
    slices: Vec<Slice>,
    half: &[f64],
    incidence: &[f64],
) -> Result<Vec<Slice>, BtfFolderError> {
    let place = |axis: &[f64], deg: f64| axis.partition_point(|a| *a < deg - SAME_DEG).min(axis.len() - 1);
    let total = half.len() * incidence.len();
    // a list that lacks more than it has is told before a table is made for it
    let missing = |count, k: usize| BtfFolderError::Missing {
        path: path.to_owned(),
        count,
        total,
        half_deg: half[k / incidence.len()],
        incidence_deg: incidence[k % incidence.len()],
    };
    let mut sorted: Vec<(usize, Slice)> = slices
        .into_iter()
        .map(|s| (place(half, s.half_deg) * incidence.len() + place(incidence, s.incidence_deg), s))
        .collect();
    sorted.sort_by_key(|(k, _)| *k);
    if let Some(w) = sorted.windows(2).find(|w| w[0].0 == w[1].0) {
        return Err(BtfFolderError::Twice {
            path: path.to_owned(),
            half_deg: w[0].1.half_deg,
            incidence_deg: w[0].1.incidence_deg,
            first: w[0].1.file.clone(),
            second: w[1].1.file.clone(),
        });
    }
    if sorted.len() != total {
        let first = sorted.iter().enumerate().find(|(k, s)| *k != s.0).map_or(sorted.len(), |(k, _)| k);
        return Err(missing(total - sorted.len(), first));
    }
    Ok(sorted.into_iter().map(|(_, s)| s).collect())
}
