//! `gonio fit A B C …`: many measurements on all cores, one report, one JSON object; a bad file does not stop the rest.

use std::path::PathBuf;

use gonio_render::Report;
use gonio_render::plots::{self, Curve, Lobe};
use gonio_render::report::{Block, Figure, KeyFigure, Notice, Section, Weight, significant};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::fit::{Fitted, fit_one};
use crate::arguments::FitArguments;
use crate::batch_inputs::{Inputs, file_names};
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};
use crate::report;

/// What became of one input.
struct Entry {
    input: String,
    name: String,
    /// Where its model.json went.
    output: Option<PathBuf>,
    result: Result<Done, String>,
}

struct Done {
    fitted: Fitted,
    lobe: Option<Figure>,
}

/// Fits all, prints a line for each, writes models and the report where asked.
///
/// # Errors
/// [`Failure::Usage`] before anything is fitted where outputs stand in the way; [`Failure::Failed`] where nothing could be fitted.
pub fn run(a: &FitArguments, inputs: &Inputs, printer: Printer) -> Result<Outcome, Failure> {
    if !a.export.is_empty() {
        return Err(Failure::usage(
            "--export takes one input; write models with -o and convert them one by one",
        ));
    }
    let names = file_names(&inputs.wanted);
    let outputs = outputs(a, &names)?;
    let entries: Vec<Entry> = inputs
        .wanted
        .par_iter()
        .zip(names)
        .zip(outputs)
        .enumerate()
        .map(|(k, ((input, name), output))| one(a, input, name, output, k))
        .collect();
    let failed: Vec<&Entry> = entries.iter().filter(|e| e.result.is_err()).collect();
    if let Some(path) = &a.report {
        report::save(&build(&entries, inputs), path, None)?;
    }
    printer.result(&text(&entries, inputs), &to_json(a, &entries, inputs));
    let why: Vec<String> =
        failed.iter().filter_map(|e| e.result.as_ref().err().map(|w| format!("{}: {w}", e.input))).collect();
    match (failed.len(), entries.len()) {
        (0, _) => Ok(Outcome::Done),
        (f, all) if f == all => Err(Failure::Failed(format!("nothing could be fitted; {}", why.join("; ")))),
        (f, all) => {
            Ok(Outcome::WithLoss(format!("{f} of {all} inputs could not be fitted: {}", why.join("; "))))
        }
    }
}

/// The model.json of each input, in a folder that is made where it is not there.
fn outputs(a: &FitArguments, names: &[String]) -> Result<Vec<Option<PathBuf>>, Failure> {
    if let Some(path) = &a.report {
        output::check_free(path, a.force)?;
    }
    let Some(folder) = &a.output else { return Ok(vec![None; names.len()]) };
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::usage(format!(
            "{} is a file; of several inputs -o names the folder for their models",
            folder.display()
        )));
    }
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::usage(format!("folder {} cannot be made: {e}", folder.display())))?;
    let paths: Vec<PathBuf> = names.iter().map(|n| folder.join(format!("{n}.model.json"))).collect();
    for path in &paths {
        output::check_free(path, a.force)?;
    }
    Ok(paths.into_iter().map(Some).collect())
}

fn one(a: &FitArguments, input: &str, name: String, output: Option<PathBuf>, k: usize) -> Entry {
    let result = fit_one(a, input).map_err(|e| e.to_string()).and_then(|fitted| {
        if let Some(path) = &output {
            let text = fitted.file.to_json().map_err(|e| e.to_string())?;
            output::write_whole(path, text.as_bytes()).map_err(|e| e.to_string())?;
        }
        let lobe = a.report.is_some().then(|| lobe(&fitted, &name, k)).flatten();
        Ok(Done { fitted, lobe })
    });
    Entry { input: input.to_owned(), name, output, result }
}

/// Points and curves in the plane of incidence; scattered measurements have no grid to draw.
fn lobe(fitted: &Fitted, name: &str, k: usize) -> Option<Figure> {
    let table = fitted.subject.table.as_ref()?;
    let curve = Curve { label: fitted.file.model.name(), brdf: &fitted.file };
    Some(Figure {
        name: format!("lobe-{:03}", k + 1),
        picture: plots::lobe(table, &[curve], &Lobe { title: name.to_owned(), ..Lobe::default() }),
        caption: format!("{name}: points as measured, lines as fitted, in the plane of incidence."),
        alt: format!("Measured and fitted lobes of {name}."),
    })
}

fn build(entries: &[Entry], inputs: &Inputs) -> Report {
    let done: Vec<(&Entry, &Done)> =
        entries.iter().filter_map(|e| Some((e, e.result.as_ref().ok()?))).collect();
    let mut notices: Vec<Notice> = entries
        .iter()
        .filter_map(|e| Some((e, e.result.as_ref().err()?)))
        .map(|(e, why)| Notice { weight: Weight::Failure, text: format!("{}: {why}", e.input) })
        .collect();
    for (file, why) in &inputs.skipped {
        notices.push(Notice { weight: Weight::Note, text: format!("{file} was left out: {why}.") });
    }
    let rows = done
        .iter()
        .map(|(e, d)| {
            let fit = &d.fitted.fit;
            let spread = fit.delta_e.beyond_15_deg.or(fit.delta_e.all);
            let delta = |of: fn(&gonio_fitter::Spread) -> f64| {
                spread.as_ref().map_or_else(|| "–".to_owned(), |s| significant(of(s), 3))
            };
            vec![
                e.name.clone(),
                fit.model.name().to_owned(),
                fit.status.name().to_owned(),
                delta(|s| s.mean),
                delta(|s| s.p95),
                delta(|s| s.max),
                significant(fit.weighted_error, 3),
                fit.cells_used.to_string(),
            ]
        })
        .collect();
    let head = ["Measurement", "model", "status", "mean ΔE", "95 %", "max", "weighted error", "cells"]
        .map(str::to_owned);
    let mut blocks = vec![Block::Table {
        caption: "ΔE is CIEDE2000 beyond 15° of the mirror direction".to_owned(),
        head: head.to_vec(),
        rows,
    }];
    let figures: Vec<Figure> = done.iter().filter_map(|(_, d)| d.lobe.clone()).collect();
    if !figures.is_empty() {
        blocks.push(Block::Pictures(figures));
    }
    let mut means: Vec<f64> =
        done.iter().filter_map(|(_, d)| d.fitted.fit.delta_e.beyond_15_deg.map(|s| s.mean)).collect();
    means.sort_by(f64::total_cmp);
    let mut key_figures = vec![KeyFigure {
        label: "fitted".to_owned(),
        value: format!("{} of {}", done.len(), entries.len()),
        note: String::new(),
    }];
    if let Some(median) = means.get(means.len() / 2) {
        key_figures.push(KeyFigure {
            label: "median of the mean ΔE beyond 15°".to_owned(),
            value: significant(*median, 2),
            note: format!("worst {}", significant(means.last().copied().unwrap_or(0.0), 2)),
        });
    }
    Report {
        title: "Fits of several measurements".to_owned(),
        subtitle: "Bidirectional reflectance, f in 1/sr without the cosine; φ = 180° is the mirror side"
            .to_owned(),
        key_figures,
        notices,
        sections: vec![Section { heading: "Fits".to_owned(), intro: String::new(), blocks }],
        footer: format!("gonio {}", env!("CARGO_PKG_VERSION")),
    }
}

fn text(entries: &[Entry], inputs: &Inputs) -> String {
    let mut out = String::new();
    for e in entries {
        match &e.result {
            Ok(d) => {
                let fit = &d.fitted.fit;
                let delta = fit.delta_e.beyond_15_deg.or(fit.delta_e.all);
                let delta = delta.map_or_else(String::new, |s| {
                    format!("  ΔE beyond 15° {:.2} / {:.2} / {:.2}", s.mean, s.p95, s.max)
                });
                out += &format!("{:<28} {} ({}){delta}\n", e.name, fit.model.name(), fit.status.name());
            }
            Err(why) => out += &format!("{:<28} failed: {why}\n", e.name),
        }
    }
    let done = entries.iter().filter(|e| e.result.is_ok()).count();
    out += &format!("{done} of {} fitted", entries.len());
    if !inputs.skipped.is_empty() {
        out += &format!(", {} files of folders left out", inputs.skipped.len());
    }
    out + " (ΔE: mean / 95 % / max)\n"
}

fn to_json(a: &FitArguments, entries: &[Entry], inputs: &Inputs) -> Value {
    let fits: Vec<Value> = entries
        .iter()
        .map(|e| match &e.result {
            Ok(d) => json!({
                "input": e.input,
                "model": serde_json::to_value(&d.fitted.file).unwrap_or(Value::Null),
                "output": e.output.as_deref().map(output::shown),
            }),
            Err(why) => json!({ "input": e.input, "error": why }),
        })
        .collect();
    let skipped: Vec<Value> =
        inputs.skipped.iter().map(|(file, why)| json!({ "input": file, "why": why })).collect();
    json!({
        "fits": fits,
        "fitted": entries.iter().filter(|e| e.result.is_ok()).count(),
        "failed": entries.iter().filter(|e| e.result.is_err()).count(),
        "skipped": skipped,
        "report": a.report.as_deref().map(output::shown),
    })
}
