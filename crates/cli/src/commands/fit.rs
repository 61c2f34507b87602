//! `gonio fit`: a model for a measured BRDF, without starting values.

use std::path::Path;

use gonio_brdf::ModelFile;
use gonio_fitter::anneal::{AnnealOptions, fit_by_annealing};
use gonio_fitter::auto::{Chosen, choose};
use gonio_fitter::sopp::{SoppOptions, SoppRun, as_fit, sopp};
use gonio_fitter::{CoatChoice, Fit, ModelChoice, Options, Weights};
use serde_json::{Value, json};

use super::fit_batch;
use crate::arguments::{FitArguments, MethodName, WeightsName};
use crate::batch_inputs;
use crate::candidates;
use crate::colours;
use crate::exporting;
use crate::fitting::{self, Subject};
use crate::opening;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};
use crate::report::{self, Background};

impl From<WeightsName> for Weights {
    fn from(w: WeightsName) -> Self {
        match w {
            WeightsName::Sopp => Self::Sopp,
            WeightsName::Ngan => Self::Ngan,
            WeightsName::Sigma => Self::Sigma,
            WeightsName::LogRelative => Self::LogRelative,
            WeightsName::None => Self::None,
        }
    }
}

/// A fit with all that is told of it.
pub(super) struct Fitted {
    pub subject: Subject,
    pub fit: Fit,
    pub file: ModelFile,
    /// Among what the model was chosen.
    chosen: Option<Chosen>,
    /// The course of Sopp's method.
    run: Option<SoppRun>,
}

/// Fits, prints what was found, writes `model.json`, report and materials where asked. Several inputs go to [`fit_batch`].
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or fitted; [`Failure::Failed`] where nothing could be fitted.
pub fn run(a: &FitArguments, printer: Printer) -> Result<Outcome, Failure> {
    let inputs = batch_inputs::expand(&a.inputs)?;
    if a.model.starts_with("flake-map") {
        let [input] = inputs.wanted.as_slice() else {
            return Err(Failure::usage(format!("--model {}: one input at a time", a.model)));
        };
        return super::flake::fit(a, input, printer);
    }
    if a.model == "car-paint" {
        let [input] = inputs.wanted.as_slice() else {
            return Err(Failure::usage("--model car-paint: one input at a time"));
        };
        return super::car_paint::fit(a, input, printer);
    }
    check_options(a)?;
    let [input] = inputs.wanted.as_slice() else { return fit_batch::run(a, &inputs, printer) };
    if inputs.many {
        return fit_batch::run(a, &inputs, printer);
    }
    single(a, input, printer)
}

/// Words of the command line that no input can mend.
fn check_options(a: &FitArguments) -> Result<(), Failure> {
    options(a, false, CoatChoice::None)?;
    start(a)?;
    let named: ModelChoice = a.model.parse().map_err(Failure::usage)?;
    let sopps = matches!(
        named,
        ModelChoice::Auto | ModelChoice::AshikhminShirleySimplified | ModelChoice::AshikhminShirley
    );
    if a.method == MethodName::Sopp && !sopps {
        return Err(Failure::usage(format!(
            "--method sopp fits ashikhmin-shirley-simplified or ashikhmin-shirley, not {}",
            a.model
        )));
    }
    if !(a.max_delta_e > 0.0 && a.max_delta_e.is_finite()) {
        return Err(Failure::usage(format!("--max-delta-e {}: expected a number above 0", a.max_delta_e)));
    }
    Ok(())
}

/// Options of a fit; `found` is the coat that the data ask for.
fn options(a: &FitArguments, has_sigma: bool, found: CoatChoice) -> Result<Options, Failure> {
    let plain = fitting::options(&a.model, a.weights.map(Into::into), a.max_angle_deg, has_sigma)?;
    let coat = match a.coat.as_str() {
        "auto" => found,
        "none" => CoatChoice::None,
        "fit" => CoatChoice::Fitted,
        index => match index.parse::<f64>() {
            Ok(n) if n.is_finite() && n > 1.0 => CoatChoice::Index(n),
            _ => {
                return Err(Failure::usage(format!(
                    "--coat {index}: expected auto, none, fit, or a refractive index above 1"
                )));
            }
        },
    };
    Ok(Options { loss: a.loss.parse().map_err(Failure::usage)?, coat, ..plain })
}

/// Start values of Sopp's method.
fn start(a: &FitArguments) -> Result<SoppOptions, Failure> {
    let numbers: Vec<f64> = a.start.split(',').filter_map(|x| x.trim().parse().ok()).collect();
    let [exponent, diffuse, specular] = numbers[..] else {
        return Err(Failure::usage(format!("--start {}: expected three numbers N,CD,CS", a.start)));
    };
    let finite = [exponent, diffuse, specular].iter().all(|x| x.is_finite());
    if !finite || exponent < 0.0 {
        return Err(Failure::usage(format!("--start {}: expected finite numbers, N not below 0", a.start)));
    }
    let defaults = SoppOptions::default();
    let r0 = (a.model == "ashikhmin-shirley").then_some(0.1);
    let iterations = a.iterations.unwrap_or(defaults.iterations);
    Ok(SoppOptions { exponent, diffuse, specular, r0, iterations, ..defaults })
}

/// Fits one input.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read; [`Failure::Failed`] where nothing could be fitted.
pub(super) fn fit_one(a: &FitArguments, input: &str) -> Result<Fitted, Failure> {
    let loaded = opening::open(input)?;
    let subject = Subject::of(&loaded)?;
    let options = options(a, subject.has_sigma, subject.coat())?;
    let mut fitted = by_method(a, subject, &options)?;
    if !fitted.fit.status.is_fitted() {
        return Err(Failure::Failed(format!("{input}: {}", fitted.fit.sentence())));
    }
    let extra = fitted.told();
    if let (Some(Value::Object(fit)), Value::Object(extra)) = (fitted.file.fit.as_mut(), extra) {
        fit.extend(extra);
    }
    Ok(fitted)
}

fn by_method(a: &FitArguments, subject: Subject, options: &Options) -> Result<Fitted, Failure> {
    let obs = &subject.observations;
    let (mut chosen, mut run) = (None, None);
    let fit = match a.method {
        MethodName::Projection if options.model == ModelChoice::Auto => {
            let c = choose(obs, options, a.max_delta_e);
            let fit = c.fit.clone();
            chosen = Some(c);
            fit
        }
        MethodName::Projection => gonio_fitter::fit(obs, options),
        MethodName::Sopp => {
            let made = sopp(obs, options, &start(a)?);
            let fit = as_fit(obs, options, &made);
            run = Some(made);
            fit
        }
        MethodName::Anneal => {
            let defaults = AnnealOptions::default();
            let iterations = a.iterations.map_or(defaults.iterations, |i| i as u64);
            fit_by_annealing(obs, options, AnnealOptions { iterations, seed: a.seed, ..defaults })
        }
    };
    let file = fit.to_model_file();
    Ok(Fitted { subject, fit, file, chosen, run })
}

impl Fitted {
    /// What the `"fit"` key holds beside the fit itself.
    fn told(&self) -> Value {
        let mut out = serde_json::Map::new();
        if let Some(c) = &self.chosen {
            out.insert("choice".to_owned(), candidates::to_json(c));
        }
        if let Some(r) = &self.run {
            let stages: Vec<Value> = r
                .stages
                .iter()
                .map(|s| {
                    json!({
                        "name": s.name, "ended": s.ended.name(), "accepted": s.accepted, "rejected": s.rejected,
                        "lambda": s.lambda, "cosine": finite(s.cosine), "condition": finite(s.condition),
                        "condition_scaled": finite(s.condition_scaled),
                    })
                })
                .collect();
            out.insert("method".to_owned(), "sopp".into());
            out.insert("stages".to_owned(), stages.into());
        }
        Value::Object(out)
    }

    fn lines(&self) -> String {
        let fit = &self.fit;
        let mut text = format!(
            "{} ({})\n{}",
            fitting::model_name(fit),
            fit.status.name(),
            fitting::parameter_lines(fit)
        );
        if let Some(d) = fit.delta_e.beyond_15_deg {
            text += &format!(
                "  ΔE beyond 15° of the mirror direction: mean {:.2}, 95 % {:.2}, max {:.2}\n",
                d.mean, d.p95, d.max
            );
        }
        if let Some(d) = fit.delta_e.within_15_deg {
            text += &format!("  ΔE within 15°: mean {:.2}, 95 % {:.2}, max {:.2}\n", d.mean, d.p95, d.max);
        }
        text += &format!("  {} cells, weights {}; {}\n", fit.cells_used, fit.weights.name(), fit.sentence());
        for note in &fit.notes {
            text += &format!("  note: {note}\n");
        }
        if let Some(r) = &self.run {
            for s in &r.stages {
                text += &format!(
                    "  {}: {} after {} better and {} worse steps, λ {:.2e}, condition {:.1e}\n",
                    s.name,
                    s.ended.name(),
                    s.accepted,
                    s.rejected,
                    s.lambda,
                    s.condition_scaled
                );
            }
        }
        if let Some(c) = &self.chosen {
            text += &candidates::table(c);
        }
        text
    }
}

fn finite(x: f64) -> Value {
    serde_json::Number::from_f64(x).map_or(Value::Null, Value::Number)
}

fn single(a: &FitArguments, input: &str, printer: Printer) -> Result<Outcome, Failure> {
    let outputs: Vec<&std::path::PathBuf> = a.output.iter().chain(&a.report).chain(&a.export).collect();
    for (i, path) in outputs.iter().enumerate() {
        output::check_free(path, a.force)?;
        output::check_apart(path, &[Path::new(input)])?;
        if outputs.iter().skip(i + 1).any(|other| other == path) {
            return Err(Failure::usage(format!(
                "{}: two outputs name the same file; give each its own",
                path.display()
            )));
        }
    }
    let materials = a
        .export
        .iter()
        .map(|path| match exporting::renderer(None, path, true)? {
            Some(renderer) => Ok((path, renderer)),
            None => Err(Failure::usage(format!(
                "--export {}: give a name that ends in .xml (Mitsuba 3), .mtlx (MaterialX), .gltf or .csv (Sopp's shader)",
                path.display()
            ))),
        })
        .collect::<Result<Vec<_>, _>>()?;
    let fitted = fit_one(a, input)?;
    if let Some(path) = &a.output {
        let text = fitted.file.to_json().map_err(|e| Failure::failed("the model cannot be written", e))?;
        output::write_whole(path, text.as_bytes())?;
    }
    if let Some(path) = &a.report {
        let title = Path::new(input).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let sections = fitted.chosen.iter().map(candidates::section).collect();
        // a table of a scan says what its colours are; one from elsewhere does not
        let table = fitted.subject.table.as_ref();
        let scanned = table.filter(|t| t.attributes.contains_key("sample_kind"));
        let notices = scanned.map(|t| colours::notice(&t.attributes)).into_iter().collect();
        let background = Background { title, sections, notices, ..Background::default() };
        report::save(
            &report::build(fitted.subject.table.as_ref(), Some(&fitted.fit), background),
            path,
            None,
        )?;
    }
    let mut text = fitted.lines();
    let mut exported = Vec::new();
    for (path, renderer) in materials {
        let (lines, json) = exporting::write(&fitted.file, renderer, path)?;
        text += &lines;
        exported.push(json);
    }
    let model =
        serde_json::to_value(&fitted.file).map_err(|e| Failure::failed("the model cannot be written", e))?;
    printer.result(
        &text,
        &json!({
            "input": input,
            "model": model,
            "output": a.output.as_deref().map(output::shown),
            "report": a.report.as_deref().map(output::shown),
            "exports": exported,
        }),
    );
    Ok(Outcome::Done)
}
