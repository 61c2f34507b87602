//! `gonio convert`: from any format that is read to one that is written, or from a model to a renderer's material.

use std::path::Path;

use gonio_brdf::Grid;
use gonio_brdf::formats::{self, Loaded, Problem, Target};
use serde_json::json;

use crate::exporting;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};

/// Reads `input` and writes it as `renderer` or the ending of `output` says; functions and models are sampled on Sopp's grid for tables.
///
/// # Errors
/// [`Failure::Usage`] for files that cannot be read, or written in the form asked for.
pub fn run(
    input: &str,
    output: &Path,
    renderer: Option<&str>,
    force: bool,
    printer: Printer,
) -> Result<Outcome, Failure> {
    output::check_free(output, force)?;
    output::check_apart(output, &[Path::new(input)])?;
    if let Some(renderer) = exporting::renderer(renderer, output, false)? {
        let Loaded::Model(file) = formats::open(Path::new(input)).map_err(Failure::usage)? else {
            return Err(Failure::usage(format!(
                "{input} holds no model and {} takes nothing else: fit one first, gonio fit {input} -o model.json",
                renderer.title()
            )));
        };
        let (text, mut json) = exporting::write(&file, renderer, output)?;
        if let Some(map) = json.as_object_mut() {
            map.insert("input".to_owned(), input.into());
        }
        printer.result(&format!("written to {text}"), &json);
        return Ok(Outcome::Done);
    }
    if output.extension().is_some_and(|e| e.eq_ignore_ascii_case("paint")) {
        return super::car_paint::convert(input, output, printer);
    }
    let target = Target::from_path(output).map_err(Failure::usage)?;
    let loaded = crate::opening::open(input)?;
    let loaded = match (target, loaded) {
        (Target::Netcdf | Target::Csv, l @ (Loaded::Function(_) | Loaded::Model(_))) => {
            match l.to_measured(&Grid::sopp()) {
                Some(table) => Loaded::Table(Box::new(table)),
                None => l,
            }
        }
        (_, l) => l,
    };
    let saved = formats::save(output, &loaded, target, force).map_err(|e| match e.problem {
        Problem::Io(_) => Failure::failed("the conversion cannot be written", e),
        _ => Failure::usage(e),
    })?;
    for loss in &saved.losses {
        eprintln!("note: {loss}");
    }
    printer.result(
        &format!("written to {}", output.display()),
        &json!({ "input": input, "output": output::shown(output), "not_kept": saved.losses }),
    );
    Ok(Outcome::Done)
}
