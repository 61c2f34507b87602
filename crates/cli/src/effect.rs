//! Effect coatings as the command line asks for them: files turned into materials, flags into options, findings into words.

use std::path::Path;

use gonio_optics::Angle;
use gonio_tailor::{Finding, GlossChoice, Material, Options};
use serde_json::{Value, json};

use crate::arguments::effect::{GlossName, MapArguments};
use crate::opening;
use crate::outcome::Failure;

/// Index of a coat that nothing is said about.
const USUAL_INDEX: f64 = 1.5;

/// Opens what a command was given.
///
/// # Errors
/// [`Failure::Usage`] for a file that cannot be read.
pub fn material(input: &str) -> Result<Material, Failure> {
    let loaded = opening::open(input)?;
    Ok(Material::new(title(input), loaded))
}

/// Name of a file without its folder.
#[must_use]
pub fn title(input: &str) -> String {
    Path::new(input).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The index asked for, else the one in the file, else 1.5.
///
/// # Errors
/// [`Failure::Usage`] for an index outside 1…4.
pub fn index(asked: Option<f64>, material: &Material) -> Result<f64, Failure> {
    let index = asked.or_else(|| material.stated_index()).unwrap_or(USUAL_INDEX);
    if (1.0..=4.0).contains(&index) {
        return Ok(index);
    }
    Err(Failure::usage(format!("--index {index}: expected the refractive index of a coat, 1 (none) to 4")))
}

/// Options of maps from their flags.
///
/// # Errors
/// [`Failure::Usage`] for a number out of its range.
pub fn options(a: &MapArguments, material: &Material) -> Result<Options, Failure> {
    let degrees = |flag: &str, value: f64, least: f64, most: f64| {
        if value > least && value <= most {
            Ok(Angle::from_degrees(value))
        } else {
            Err(Failure::usage(format!("{flag} {value}: expected degrees above {least}, at most {most}")))
        }
    };
    if !(4..=1024).contains(&a.nodes) {
        return Err(Failure::usage(format!("--nodes {}: expected 4 to 1024", a.nodes)));
    }
    let lamp = a.lamp_half_angle_deg.map(|d| degrees("--lamp-half-angle-deg", d, 0.0, 30.0)).transpose()?;
    Ok(Options {
        largest: degrees("--largest-deg", a.largest_deg, 0.0, 90.0)?,
        nodes: a.nodes,
        gloss: match a.gloss {
            GlossName::Auto => GlossChoice::Auto,
            GlossName::Keep => GlossChoice::Keep,
            GlossName::Fresnel => GlossChoice::Fresnel(lamp),
            GlossName::Fill => GlossChoice::Fill(degrees("--gloss-cone-deg", a.gloss_cone_deg, 0.0, 45.0)?),
        },
        ..Options::new(index(a.index, material)?)
    })
}

/// Findings as lines on stderr.
pub fn say(findings: &[Finding]) {
    for f in findings {
        eprintln!("note: {f}");
    }
}

/// Findings for programs.
#[must_use]
pub fn findings_json(findings: &[Finding]) -> Value {
    findings.iter().map(|f| json!({ "kind": f.name(), "text": f.to_string() })).collect()
}
