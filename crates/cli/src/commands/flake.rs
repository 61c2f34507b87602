//! `gonio fit M --model flake-map:K`: a flake map in a file of its own, which every command loads without computing it again.

use std::path::Path;

use gonio_tailor::{ColourSpread, GeometrySet, Options, Representation, assess};
use serde_json::json;

use crate::arguments::FitArguments;
use crate::effect;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};
use gonio_optics::Angle;
use gonio_render::plots::pareto::size_in_words;

/// Fits the map, says how far it is off, writes it where asked.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or fitted.
pub fn fit(a: &FitArguments, input: &str, printer: Printer) -> Result<Outcome, Failure> {
    let representation: Representation =
        a.model.parse().map_err(|e| Failure::usage(format!("--model: {e}")))?;
    if a.report.is_some() || a.weights.is_some() {
        return Err(Failure::usage(
            "--report and --weights belong to models; of a flake map `gonio trade` makes the report, and its weights are solid angle and σ",
        ));
    }
    if !(a.max_angle_deg > 0.0 && a.max_angle_deg <= 90.0) {
        return Err(Failure::usage(format!(
            "--max-angle-deg {}: expected an angle above 0, at most 90",
            a.max_angle_deg
        )));
    }
    if let Some(path) = &a.output {
        output::check_free(path, a.force)?;
        output::check_apart(path, &[Path::new(input)])?;
    }
    let material = effect::material(input)?;
    let options = Options {
        largest: Angle::from_degrees(a.max_angle_deg),
        ..Options::new(effect::index(a.index, &material)?)
    };
    let (built, difference, findings) = assess(&material, representation, &options, GeometrySet::All)
        .map_err(|e| Failure::usage(format!("{input}: {e}")))?;
    effect::say(&findings);
    let map =
        built.flake_map().ok_or_else(|| Failure::usage(format!("--model {}: no flake map", a.model)))?;
    if let Some(path) = &a.output {
        let text = map.to_json().map_err(|e| Failure::failed("the map cannot be written", e))?;
        output::write_whole(path, text.as_bytes())?;
    }
    let spread = |s: ColourSpread| format!("mean {:.2}, 95 % {:.2}, max {:.2}", s.mean, s.p95, s.max);
    let mut text = format!("{representation}, index {}, {}\n", map.index(), size_in_words(map.bytes()));
    if let Some(s) = difference.beyond_15_deg {
        text += &format!("  ΔE beyond 15° of the mirror direction: {}\n", spread(s));
    }
    if let Some(s) = difference.within_15_deg {
        text += &format!("  ΔE within 15° (the map leaves the gloss out): {}\n", spread(s));
    }
    if let Some([median, p95]) = built.relative_sigma() {
        text += &format!(
            "  relative uncertainty of the luminance: {:.0} % (median), {:.0} % (95th percentile)\n",
            100.0 * median,
            100.0 * p95
        );
    }
    if let Some(path) = &a.output {
        text += &format!("  written to {}\n", path.display());
    }
    printer.result(
        &text,
        &json!({
            "input": input,
            "flake_map": { "index": map.index(), "harmonics": map.harmonics(), "bytes": map.bytes(), "largest_deg": a.max_angle_deg },
            "delta_e": difference, "relative_sigma": built.relative_sigma(), "findings": effect::findings_json(&findings), "output": a.output.as_deref().map(output::shown),
        }),
    );
    Ok(Outcome::Done)
}
