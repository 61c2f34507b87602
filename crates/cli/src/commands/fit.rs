//! `gonio fit`: a model for a measured BRDF, without starting values.

use std::path::Path;

use gonio_brdf::formats;
use gonio_fitter::Weights;
use serde_json::json;

use crate::arguments::{FitArguments, WeightsName};
use crate::fitting::{self, Subject};
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};
use crate::report::{self, Background};

impl From<WeightsName> for Weights {
    fn from(w: WeightsName) -> Self {
        match w {
            WeightsName::Sopp => Self::Sopp,
            WeightsName::Ngan => Self::Ngan,
            WeightsName::Sigma => Self::Sigma,
            WeightsName::None => Self::None,
        }
    }
}

/// Fits, prints what was found, writes `model.json` and a report where asked.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or fitted; [`Failure::Failed`] where nothing could be fitted.
pub fn run(a: &FitArguments, printer: Printer) -> Result<Outcome, Failure> {
    if a.model.starts_with("flake-map") {
        return super::flake::fit(a, printer);
    }
    for path in a.output.iter().chain(&a.report) {
        output::check_free(path, a.force)?;
        output::check_apart(path, &[Path::new(&a.input)])?;
    }
    if a.output.is_some() && a.output == a.report {
        return Err(Failure::usage("--output and --report name the same file; give each its own"));
    }
    let loaded = formats::open(Path::new(&a.input)).map_err(Failure::usage)?;
    let subject = Subject::of(&loaded)?;
    let options = fitting::options(&a.model, a.weights.map(Into::into), a.max_angle_deg, subject.has_sigma)?;
    let fit = gonio_fitter::fit(&subject.observations, &options);
    let file = fit.to_model_file();
    if let Some(path) = &a.output {
        let text = file.to_json().map_err(|e| Failure::failed("the model cannot be written", e))?;
        output::write_whole(path, text.as_bytes())?;
    }
    if let Some(path) = &a.report {
        let title = Path::new(&a.input).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let background = Background { title, ..Background::default() };
        report::save(&report::build(subject.table.as_ref(), Some(&fit), background), path, None)?;
    }
    let mut text =
        format!("{} ({})\n{}", fit.model.name(), fit.status.name(), fitting::parameter_lines(&fit));
    if let Some(d) = fit.delta_e.beyond_15_deg {
        text += &format!(
            "  ΔE beyond 15° of the mirror direction: mean {:.2}, 95 % {:.2}, max {:.2}\n",
            d.mean, d.p95, d.max
        );
    }
    if let Some(d) = fit.delta_e.within_15_deg {
        text += &format!("  ΔE within 15°: mean {:.2}, 95 % {:.2}, max {:.2}\n", d.mean, d.p95, d.max);
    }
    text +=
        &format!("  {} cells, weights {}; {}\n", fit.cells_used, fit.weights.name(), fitting::verdict(&fit));
    let model = serde_json::to_value(&file).map_err(|e| Failure::failed("the model cannot be written", e))?;
    printer
        .result(&text, &json!({ "input": a.input, "model": model, "output": a.output.as_deref().map(output::shown), "report": a.report.as_deref().map(output::shown) }));
    match fit.status.name() {
        "no-data" | "non-finite" => Err(Failure::Failed(format!("{}: {}", a.input, fitting::verdict(&fit)))),
        _ => Ok(Outcome::Done),
    }
}
