//! `gonio status` and `gonio stop`: the scans that run on this machine.

use serde_json::json;

use crate::control::{Ask, ScanState, ask_all};
use crate::outcome::{Failure, Outcome};
use crate::output::Printer;

/// `gonio status`.
///
/// # Errors
/// [`Failure::Failed`] where the folder of running scans cannot be read.
pub fn status(printer: Printer) -> Result<Outcome, Failure> {
    let scans = ask(Ask::Status)?;
    let text =
        if scans.is_empty() { "no scan is running".to_owned() } else { scans.iter().map(line).collect() };
    printer.result(&text, &json!({ "scans": scans }));
    Ok(Outcome::Done)
}

/// `gonio stop`, with `--emergency`, `--pause` or `--resume`.
///
/// # Errors
/// [`Failure::Failed`] where nothing runs or the folder of running scans cannot be read.
pub fn tell(printer: Printer, what: Ask) -> Result<Outcome, Failure> {
    let scans = ask(what)?;
    if scans.is_empty() {
        return Err(Failure::Failed("no scan of yours is running on this machine".to_owned()));
    }
    let done = match what {
        Ask::Stop => "asked to stop",
        Ask::EmergencyStop => "asked for an emergency stop",
        Ask::Pause => "asked to pause",
        Ask::Resume => "asked to go on",
        Ask::Status => "asked",
    };
    let text: String = scans.iter().map(|s| format!("{done}: {} (process {})\n", s.session, s.pid)).collect();
    printer.result(&text, &json!({ "asked": what, "scans": scans }));
    Ok(Outcome::Done)
}

fn ask(what: Ask) -> Result<Vec<ScanState>, Failure> {
    ask_all(what).map_err(|e| Failure::failed("running scans cannot be found", e))
}

fn line(s: &ScanState) -> String {
    let link = &s.link;
    let link = if link.sent == 0 {
        String::new()
    } else {
        format!(
            "\n  link: round trip {:.1} ms, {} of {} frames sent again, {} damaged, last heard {} ms ago, {} sessions",
            link.round_trip.as_secs_f64() * 1e3,
            link.retransmitted,
            link.sent,
            link.corrupted,
            link.silent_for.as_millis(),
            link.sessions
        )
    };
    let waits =
        if s.waiting_for.is_empty() { String::new() } else { format!("\n  waiting: {}", s.waiting_for) };
    format!(
        "{} ({}, process {}): {}, {} of {} poses done{}{}{}{waits}{link}\n",
        s.session,
        s.kind,
        s.pid,
        s.step,
        s.poses_done,
        s.poses_total,
        if s.remaining_s > 0.0 { format!(", about {:.0} s to go", s.remaining_s) } else { String::new() },
        if s.paused && s.step != "paused" { ", to be paused" } else { "" },
        if s.fit.is_empty() { String::new() } else { format!("; {}", s.fit) },
    )
}
