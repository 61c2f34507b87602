//! What a file holds, whatever its format.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{
    Format, FormatError, Problem, cornell, detect, mbsdf, measured_csv, merl, nbrdf, netcdf, read_file, rgl,
};
use crate::maps::FlakeMap;
use crate::{Brdf, Grid, Measured, ModelFile, Scattered};

/// The content of a file.
#[derive(Debug)]
pub enum Loaded {
    /// A measured table.
    Table(Box<Measured>),
    /// Measurements at scattered geometries.
    Scattered(Scattered),
    /// Something that can be evaluated anywhere.
    Function(Function),
    /// A reflectance model with its parameters.
    Model(Box<ModelFile>),
}

/// A material that is evaluated by its format's own rule.
pub struct Function {
    /// f.
    pub brdf: Box<dyn Brdf>,
    /// Where it comes from.
    pub format: Format,
    /// Name of the material, as its file says.
    pub name: String,
    /// What else the file says of it.
    pub notes: BTreeMap<String, String>,
    /// The map itself, where the file holds a flake map: it knows what it covers.
    pub flake_map: Option<Arc<FlakeMap>>,
}

impl std::fmt::Debug for Function {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Function")
            .field("format", &self.format)
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Opens a file of any known format; `FILE#NAME` asks for one material of several.
///
/// # Errors
/// [`FormatError`]: path, place, what was found and what was expected.
pub fn open(path: &Path) -> Result<Loaded, FormatError> {
    let (file, material) = split(path);
    let bytes = read_file(&file)?;
    let names_path = file.with_extension("names.txt");
    let names_text = if names_path.is_file() { Some(read_file(&names_path)?) } else { None };
    let fail = |p: Problem| FormatError::new(path, p);
    let format = detect(&bytes, names_text.is_some()).map_err(fail)?;
    let names = match (format, names_text) {
        (Format::NeuralBrdf, Some(text)) => {
            nbrdf::names(&text, bytes.len() as u64).map_err(|p| FormatError::new(&names_path, p))?
        }
        _ => Vec::new(),
    };
    if let (Some(name), true) = (&material, names.is_empty()) {
        let available = format!("a {} holds one material without a name", format.name());
        return Err(fail(Problem::Material { name: name.clone(), available }));
    }
    parse(&bytes, format, &names, material.as_deref().unwrap_or_default(), &file).map_err(fail)
}

/// The format of a file by its content, without decoding it.
///
/// # Errors
/// [`FormatError`] where it cannot be read or its content is not known.
pub fn identify(path: &Path) -> Result<Format, FormatError> {
    let (file, _) = split(path);
    let named = file.with_extension("names.txt").is_file();
    detect(&read_file(&file)?, named).map_err(|p| FormatError::new(path, p))
}

/// File and material of `FILE#NAME`; a file whose own name has a `#` is that file.
fn split(path: &Path) -> (PathBuf, Option<String>) {
    if !path.exists()
        && let Some((file, name)) = path.to_str().and_then(|p| p.rsplit_once('#'))
    {
        return (PathBuf::from(file), Some(name.to_owned()));
    }
    (path.to_owned(), None)
}

fn parse(
    bytes: &[u8],
    format: Format,
    names: &[String],
    material: &str,
    file: &Path,
) -> Result<Loaded, Problem> {
    let stem = || file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let function = |brdf: Box<dyn Brdf>, name: String, notes| {
        Loaded::Function(Function { brdf, format, name, notes, flake_map: None })
    };
    Ok(match format {
        Format::Netcdf if netcdf::has_azimuths(bytes) => {
            let table = netcdf::read_anisotropic(bytes)?;
            let mut notes = table.attributes.clone();
            notes.insert("azimuths_of_light".to_owned(), table.phi_i_deg.len().to_string());
            let name = notes.get("sample_name").cloned().unwrap_or_else(stem);
            function(Box::new(table), name, notes)
        }
        Format::Netcdf => Loaded::Table(Box::new(netcdf::read(bytes)?)),
        Format::MeasuredCsv => match measured_csv::read(bytes)? {
            measured_csv::Contents::Table(table) => Loaded::Table(table),
            measured_csv::Contents::Scattered(points) => Loaded::Scattered(points),
        },
        Format::Model => {
            let text = std::str::from_utf8(bytes)
                .map_err(|e| Problem::malformed("model.json", "text", e, "JSON in UTF-8"))?;
            Loaded::Model(Box::new(ModelFile::from_json(text)?))
        }
        Format::FlakeMap => {
            let text = std::str::from_utf8(bytes)
                .map_err(|e| Problem::malformed("flake map", "text", e, "JSON in UTF-8"))?;
            let map = Arc::new(FlakeMap::from_json(text)?);
            Loaded::Function(Function {
                brdf: Box::new(Arc::clone(&map)),
                format,
                name: map.name().to_owned(),
                notes: map_notes(&map),
                flake_map: Some(map),
            })
        }
        // its model lives in a crate above this one, which opens it first
        Format::CarPaint => {
            return Err(Problem::Unsuitable {
                content: "a car paint".to_owned(),
                format: "a table or model",
                advice: "give it to a command that takes paints (gonio eval, render, convert, info, paint)"
                    .to_owned(),
            });
        }
        Format::Mbsdf => Loaded::Table(Box::new(mbsdf::read(bytes)?)),
        Format::Cornell => Loaded::Scattered(cornell::read(bytes)?),
        Format::Merl => {
            let merl = merl::read(bytes)?;
            let notes =
                BTreeMap::from([("cells_without_measurement".to_owned(), merl.unmeasured().to_string())]);
            function(Box::new(merl), stem(), notes)
        }
        Format::NeuralBrdf => {
            let network = nbrdf::read(bytes, names, material)?;
            function(Box::new(network), material.to_owned(), BTreeMap::new())
        }
        Format::Rgl => {
            let rgl = rgl::read(bytes)?;
            let kind = if rgl.is_isotropic() { "isotropic" } else { "anisotropic" };
            let notes = BTreeMap::from([("kind".to_owned(), kind.to_owned())]);
            let name = if rgl.description().is_empty() { stem() } else { rgl.description().to_owned() };
            function(Box::new(rgl), name, notes)
        }
    })
}

fn map_notes(map: &FlakeMap) -> BTreeMap<String, String> {
    let region = map.region();
    BTreeMap::from([
        ("index".to_owned(), map.index().to_string()),
        ("harmonics".to_owned(), map.harmonics().to_string()),
        ("bytes".to_owned(), map.bytes().to_string()),
        ("largest_deg".to_owned(), format!("{:.4}", region.largest.degrees())),
        ("from_mirror_deg".to_owned(), format!("{:.4}", region.from_mirror.degrees())),
    ])
}

impl Loaded {
    /// f everywhere: of tables by interpolation, of models without the gloss of their coat. `None` for scattered measurements.
    #[must_use]
    pub fn as_brdf(&self) -> Option<&dyn Brdf> {
        match self {
            Self::Table(table) => Some(table.as_ref()),
            Self::Function(function) => Some(&*function.brdf),
            Self::Model(model) => Some(model.as_ref()),
            Self::Scattered(_) => None,
        }
    }

    /// A table: the file's own where it holds one (then `grid` is of no account), else node values of the function on `grid`.
    /// `None` for scattered measurements.
    #[must_use]
    pub fn to_measured(&self, grid: &Grid) -> Option<Measured> {
        if let Self::Table(table) = self {
            return Some((**table).clone());
        }
        let mut table = Measured::sampled(grid.clone(), self.as_brdf()?);
        if let Self::Function(function) = self {
            table.attributes.insert("source_format".to_owned(), function.format.name().to_owned());
            table.attributes.insert("source_name".to_owned(), function.name.clone());
        }
        if let Self::Model(model) = self {
            table.attributes.insert("source_format".to_owned(), "model".to_owned());
            table.attributes.insert("source_name".to_owned(), model.model.name().to_owned());
        }
        Some(table)
    }
}
