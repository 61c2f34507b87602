//! `gonio show`: the pictures of a measured BRDF or a model, and a report.

use std::path::Path;

use gonio_brdf::{Grid, formats};
use serde_json::json;

use crate::arguments::ShowArguments;
use crate::fitting::{self, Subject};
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, shown};
use crate::report::{self, Background};

/// Draws into a folder; measurements are fitted for the comparison, models drawn as they are.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or drawn.
pub fn run(a: &ShowArguments, printer: Printer) -> Result<Outcome, Failure> {
    let html = a.output.join("report.html");
    if html.exists() && !a.force {
        return Err(Failure::usage(format!(
            "{} exists; choose another folder or say --force",
            html.display()
        )));
    }
    let loaded = crate::opening::open(&a.input)?;
    let title = Path::new(&a.input).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let background = Background { title, ..Background::default() };
    let report = if matches!(loaded, formats::Loaded::Model(_)) {
        report::build(loaded.to_measured(&Grid::sopp()).as_ref(), None, background)
    } else {
        let subject = Subject::of(&loaded)?;
        let options = fitting::options("auto", None, 75.0, subject.has_sigma)?;
        let fit = gonio_fitter::fit(&subject.observations, &options);
        report::build(subject.table.as_ref(), Some(&fit), background)
    };
    std::fs::create_dir_all(&a.output)
        .map_err(|e| Failure::usage(format!("folder {} cannot be made: {e}", a.output.display())))?;
    let pictures = report::save(&report, &html, Some(&a.output)).inspect_err(|_| {
        // an empty folder is not left behind
        let _ = std::fs::remove_dir(&a.output);
    })?;
    printer.result(
        &format!("{} and {} pictures", html.display(), pictures.len()),
        &json!({ "report": shown(&html), "pictures": pictures.iter().map(|p| shown(p)).collect::<Vec<_>>() }),
    );
    Ok(Outcome::Done)
}
