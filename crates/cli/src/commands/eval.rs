//! `gonio eval`: f at the geometries of a CSV file, as the file has it or as another representation would say it.

use std::fmt::Write;
use std::path::Path;

use gonio_brdf::Rgb;
use gonio_brdf::formats::geometry_csv;
use gonio_optics::Geometry;
use gonio_tailor::{Finding, Material, Representation, Standing};
use serde_json::json;

use crate::arguments::EvalArguments;
use crate::effect;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};

/// What is said of one geometry; the standing only by representations that know theirs.
type Said = (Rgb, Option<Standing>);

/// Appends r,g,b (1/sr) to every geometry, and a flag where the representation knows what it covers.
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
    let (said, findings) = match representation {
        Representation::Table => (as_it_is(&material, &geometries)?, Vec::new()),
        _ => as_other(a, &material, representation, &geometries)?,
    };
    effect::say(&findings);
    let flagged = said.iter().any(|s| s.1.is_some());
    let mut text = String::from("theta_i_deg,theta_o_deg,phi_deg,r,g,b");
    text.push_str(if flagged { ",flag\n" } else { "\n" });
    for (g, ([r, green, b], standing)) in geometries.iter().zip(&said) {
        let _ = write!(
            text,
            "{},{},{},{r},{green},{b}",
            g.theta_i.degrees(),
            g.theta_o.degrees(),
            g.phi.degrees()
        );
        let _ = match standing {
            Some(s) if flagged => writeln!(text, ",{}", s.flag()),
            _ => writeln!(text),
        };
    }
    output::write_whole(&a.output, text.as_bytes())?;
    let count = |s: Standing| said.iter().filter(|x| x.1 == Some(s)).count();
    let parts = [
        (count(Standing::CriticalAngle), "beyond the critical angle, where the method's rule decides"),
        (count(Standing::BeyondLargest), "steeper than the map reaches, taken at its edge"),
        (count(Standing::NothingNear), "with no measurement near, continued smoothly"),
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
            "beyond_critical_angle": parts[0].0, "beyond_largest": parts[1].0, "nothing_near": parts[2].0,
            "findings": effect::findings_json(&findings), "output": output::shown(&a.output),
        }),
    );
    Ok(Outcome::Done)
}

fn as_it_is(material: &Material, geometries: &[Geometry]) -> Result<Vec<Said>, Failure> {
    let brdf = material.brdf().ok_or_else(|| {
        Failure::usage(format!(
            "{} holds scattered geometries, nothing in between; use --as flake-map:K, or fit a model to it first",
            material.name
        ))
    })?;
    let map = material.flake_map();
    let at = |g: &Geometry| {
        let (l, v) = g.directions();
        let standing = map.map(|m| if m.covers(l, v) { Standing::Supported } else { Standing::NothingNear });
        (brdf.eval(l, v), standing)
    };
    Ok(geometries.iter().map(at).collect())
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
        (built.eval(l, v), Some(built.standing(l, v)))
    };
    Ok((geometries.iter().map(at).collect(), findings))
}
