//! `gonio verify` and `gonio recover`: is a session whole, and what is left of a damaged one.

use std::path::Path;

use gonio_recording::{RecordingError, Report, Status};
use serde_json::{Value, json};

use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};

/// `gonio verify`: exit 0 intact, 3 readable with loss, 1 unreadable.
///
/// # Errors
/// [`Failure::Failed`] for a session of which nothing can be read.
pub fn verify(session: &Path, printer: Printer) -> Result<Outcome, Failure> {
    let report = gonio_recording::verify(session).map_err(|e| unreadable(&e))?;
    printer.result(&words(&report), &value(&report)?);
    verdict(&report)
}

/// `gonio recover`.
///
/// # Errors
/// [`Failure::Usage`] where the output stands in the way, [`Failure::Failed`] where nothing can be read or written.
pub fn recover(session: &Path, output: &Path, force: bool, printer: Printer) -> Result<Outcome, Failure> {
    output::check_free(output, force)?;
    output::check_apart(output, &[session])?;
    let new = !output.exists();
    let report = gonio_recording::recover(session, output, force).map_err(|e| {
        if new {
            // half a copy helps nobody: the damaged session is still there
            let _ = std::fs::remove_file(output);
        }
        match e {
            RecordingError::DiskFull { .. } => Failure::Failed(format!(
                "the disk is full: {} cannot be written; make room or write elsewhere",
                output.display()
            )),
            e => unreadable(&e),
        }
    })?;
    let text = format!("{}written to {}", words(&report), output.display());
    printer.result(&text, &json!({ "source": value(&report)?, "output": output::shown(output) }));
    verdict(&report)
}

fn unreadable(e: &RecordingError) -> Failure {
    Failure::Failed(e.to_string())
}

fn value(report: &Report) -> Result<Value, Failure> {
    serde_json::to_value(report).map_err(|e| Failure::failed("the report cannot be written", e))
}

fn verdict(report: &Report) -> Result<Outcome, Failure> {
    match report.status {
        Status::Intact => Ok(Outcome::Done),
        Status::ReadableWithLoss => Ok(Outcome::WithLoss(format!(
            "{} findings, {} poses cannot be read",
            report.findings.len(),
            report.lost.len()
        ))),
        Status::Unreadable => Err(Failure::Failed("no pose of this session can be read".to_owned())),
    }
}

fn words(report: &Report) -> String {
    let status = match report.status {
        Status::Intact => "intact: every byte is as it was written",
        Status::ReadableWithLoss => "damaged: what is reported whole can be read",
        Status::Unreadable => "unreadable",
    };
    let planned = report.planned.map_or_else(|| "?".to_owned(), |n| n.to_string());
    let mut text = format!(
        "{status}\n  {} of {planned} poses, {} frames, {} file(s){}\n",
        report.poses.len(),
        report.frames,
        report.files.len(),
        if report.finished { "" } else { ", not finished" }
    );
    for f in &report.findings {
        text += &format!("  {} at byte {}: {}\n", f.path.display(), f.offset, f.what);
    }
    text
}
