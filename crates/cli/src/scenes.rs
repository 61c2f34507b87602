//! Scenes as the command line asks for them: opened, their findings told, their geometries gathered; and how a scan fills its table.

use std::fmt::Write;
use std::path::Path;

use gonio_acquisition::fill;
use gonio_brdf::formats::Loaded;
use gonio_brdf::{Brdf, Coat, Flag, Measured};
use gonio_optics::Geometry;
use gonio_render::Scene;
use gonio_render::trace::{Gathered, gather};
use gonio_tailor::{Material, Options, body_of};

use crate::outcome::Failure;

/// Opens a scene and tells what was done to its mesh.
///
/// # Errors
/// [`Failure::Usage`] with what would help.
pub fn open(path: &Path) -> Result<Scene, Failure> {
    let scene = Scene::open(path).map_err(Failure::usage)?;
    for f in &scene.findings {
        eprintln!("note: {f}");
    }
    Ok(scene)
}

/// The geometries of a scene at a smaller size.
///
/// # Errors
/// [`Failure::Usage`] where nothing is visible.
pub fn gathered(
    scene: Scene,
    side: u32,
    samples: u32,
    sharpness: f64,
) -> Result<(String, Gathered), Failure> {
    if !(8..=4096).contains(&side) {
        return Err(Failure::usage(format!("--side {side}: expected 8 to 4096 pixels")));
    }
    let small = scene.smaller(side, samples);
    let found = gather(&small, sharpness, true).map_err(Failure::usage)?;
    Ok((small.name, found))
}

/// How sharp a material is at most; where it is not known, as sharp as car paints.
#[must_use]
pub fn sharpness(brdf: Option<&dyn Brdf>) -> f64 {
    let stated = brdf.map_or(0.0, Brdf::sharpness);
    if stated > 0.0 { stated } else { 60.0 }
}

/// Local geometries as CSV.
#[must_use]
pub fn to_csv(geometries: &[(Geometry, f64)]) -> String {
    let mut out = String::from("theta_i_deg,theta_o_deg,phi_deg,weight\n");
    for (g, w) in geometries {
        let _ = writeln!(out, "{},{},{},{w}", g.theta_i.degrees(), g.theta_o.degrees(), g.phi.degrees());
    }
    out
}

/// Fills what a scan did not visit, as the reduction does: in flake space under a coat (the attribute `coat_index`), else by reciprocity and smoothly.
pub fn fill_as_a_scan(m: &mut Measured) {
    let limit = 75.0;
    let index: Option<f64> = m.attributes.get("coat_index").and_then(|s| s.parse().ok());
    let coat = index.filter(|n| *n > 1.0).map(|index| Coat { index });
    fill::fill(m, coat.as_ref(), limit);
}

/// The measured cells alone, without the gloss of a coat that was separated: what was filled is not known.
#[must_use]
pub fn measured_body(table: &Measured) -> Measured {
    let index = table.attributes.get("coat_index").and_then(|s| s.parse().ok()).unwrap_or(1.0);
    let material = Material::new("scan", Loaded::Table(Box::new(table.clone())));
    let body = body_of(&material, &Options::new(index)).ok().and_then(|b| b.0);
    let mut out = body.as_ref().and_then(Material::table).unwrap_or(table).clone();
    (out.base, out.base_single_pass, out.node) = (None, None, None);
    for (flag, value) in out.flag.iter_mut().zip(&mut out.values) {
        if *flag != Flag::Measured {
            *flag = Flag::Invalid;
            *value = [0.0; 3];
        }
    }
    out
}
