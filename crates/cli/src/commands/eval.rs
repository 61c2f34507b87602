//! `gonio eval`: f at the geometries of a CSV file, as the file has it or as another representation would say it.

use std::fmt::Write;
use std::path::Path;

use gonio_brdf::Rgb;
use gonio_brdf::formats::geometry_csv;
use gonio_optics::{Geometry, Vec3};
use gonio_tailor::{Finding, Material, Representation, Standing};
use serde_json::json;

use crate::arguments::EvalArguments;
use crate::effect;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};

/// What is said of one geometry.
struct Said {
    /// f in 1/sr.
    value: Rgb,
    /// Standard uncertainty in 1/sr, where the representation states one.
    sigma: Option<Rgb>,
    /// Only by representations that know theirs.
    standing: Option<Standing>,
}

/// Appends r,g,b (1/sr) to every geometry, σ where the representation states one, and a flag where it knows what it covers.
///
/// # Errors
/// [`Failure::Usage`] for files that cannot be read, a representation that is not known or cannot be made of the file.
pub fn run(a: &EvalArguments, printer: Printer) -> Result<Outcome, Failure> {
    let representation: Representation =
        a.representation.parse().map_err(|e| Failure::usage(format!("--as: {e}")))?;
    output::check_free(&a.output, a.force)?;
    output::check_apart(&a.output, &[Path::new(&a.input), &a.geometries])?;
    let material = effect::material(&a.input)?;
    let geometries = geometry_csv::open(&a.geometries).map_err(Failure::usage)?;
    let azimuths = geometry_csv::open_azimuths(&a.geometries).map_err(Failure::usage)?;
    let (said, findings) = match representation {
        Representation::Table => (as_it_is(&material, &geometries, azimuths.as_deref())?, Vec::new()),
        _ => as_other(a, &material, representation, &geometries)?,
    };
    effect::say(&findings);
    let text = to_csv(&geometries, azimuths.as_deref(), &said);
    output::write_whole(&a.output, text.as_bytes())?;
    let count = |s: Standing| said.iter().filter(|x| x.standing == Some(s)).count();
    let parts = [
        (count(Standing::CriticalAngle), "beyond the critical angle, where the method's rule decides"),
        (count(Standing::BeyondLargest), "steeper than the map reaches, taken at its edge"),
        (count(Standing::NothingNear), "with no measurement near, continued smoothly"),
        (count(Standing::Gloss), "about the mirror direction, where the map leaves the gloss out"),
    ];
    let mut lines =
        format!("{} geometries as {representation}, written to {}", geometries.len(), a.output.display());
    for (n, words) in parts.iter().filter(|p| p.0 > 0) {
        let _ = write!(lines, "\n  {n} {words} (flag 2)");
    }
    printer.result(
        &lines,
        &json!({
            "geometries": geometries.len(), "representation": representation.to_string(),
            "beyond_critical_angle": parts[0].0, "beyond_largest": parts[1].0, "nothing_near": parts[2].0, "within_gloss": parts[3].0,
            "findings": effect::findings_json(&findings), "output": output::shown(&a.output),
        }),
    );
    Ok(Outcome::Done)
}

/// `theta_i_deg,theta_o_deg,phi_deg[,phi_i_deg],r,g,b[,sigma_r,sigma_g,sigma_b][,flag]`.
fn to_csv(geometries: &[Geometry], azimuths: Option<&[f64]>, said: &[Said]) -> String {
    let (sigma, flag) = (said.iter().any(|s| s.sigma.is_some()), said.iter().any(|s| s.standing.is_some()));
    let turned = if azimuths.is_some() { "phi_i_deg," } else { "" };
    let mut text = format!("theta_i_deg,theta_o_deg,phi_deg,{turned}r,g,b");
    text.push_str(if sigma { ",sigma_r,sigma_g,sigma_b" } else { "" });
    text.push_str(if flag { ",flag\n" } else { "\n" });
    for (k, (g, s)) in geometries.iter().zip(said).enumerate() {
        let mut cells: Vec<String> =
            [g.theta_i, g.theta_o, g.phi].iter().map(|a| a.degrees().to_string()).collect();
        cells.extend(azimuths.and_then(|a| a.get(k)).map(ToString::to_string));
        cells.extend(s.value.iter().map(ToString::to_string));
        if sigma {
            cells.extend(s.sigma.unwrap_or_default().iter().map(ToString::to_string));
        }
        if flag {
            cells.push(s.standing.map_or(0, Standing::flag).to_string());
        }
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    text
}

/// `azimuths`: of the light on the sample, degrees, for samples that look different when turned.
fn as_it_is(
    material: &Material,
    geometries: &[Geometry],
    azimuths: Option<&[f64]>,
) -> Result<Vec<Said>, Failure> {
    let brdf = material.brdf().ok_or_else(|| {
        Failure::usage(format!(
            "{} holds scattered geometries, nothing in between; use --as flake-map:K, or fit a model to it first",
            material.name
        ))
    })?;
    let map = material.flake_map();
    let at = |(k, g): (usize, &Geometry)| {
        let (sin, cos) = azimuths.and_then(|a| a.get(k)).map_or(0.0, |a| a.to_radians()).sin_cos();
        let turn = |d: Vec3| Vec3::new(cos * d.x - sin * d.y, sin * d.x + cos * d.y, d.z);
        let (l, v) = g.directions();
        let (l, v) = if sin == 0.0 && cos == 1.0 { (l, v) } else { (turn(l), turn(v)) };
        let standing = map.map(|m| m.standing(l, v).into());
        Said { value: brdf.eval(l, v), sigma: map.and_then(|m| m.sigma(l, v)), standing }
    };
    Ok(geometries.iter().enumerate().map(at).collect())
}

fn as_other(
    a: &EvalArguments,
    material: &Material,
    representation: Representation,
    geometries: &[Geometry],
) -> Result<(Vec<Said>, Vec<Finding>), Failure> {
    let options = effect::options(&a.map, material)?;
    let mut findings = Finding::of_coat(material, options.index);
    let built = representation
        .build(material, &options)
        .map_err(|e| Failure::usage(format!("{} as {representation}: {e}", material.name)))?;
    findings.extend(built.findings.iter().cloned());
    let at = |g: &Geometry| {
        let (l, v) = g.directions();
        let sigma = built.flake_map().and_then(|m| m.sigma(l, v));
        Said { value: built.eval(l, v), sigma, standing: Some(built.standing(l, v)) }
    };
    Ok((geometries.iter().map(at).collect(), findings))
}
