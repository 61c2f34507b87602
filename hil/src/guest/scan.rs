//! Whole scans of the tiny instrument with the program that users run.

use std::process::Command;
use std::time::Instant;

use super::Guest;
use super::stage::Link;
use crate::line::FromGuest;
use gonio_instrument::ScanKind;

/// Lines of the program's log that are shown where it fails.
const TAIL: usize = 12;

/// Scans the sample through a link and the camera; the session is complete and every byte of it verifies.
pub fn whole(guest: &mut Guest, link: Link) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: false })?;
    guest.control.ask(&FromGuest::Sample { kind: ScanKind::Sample })?;
    let name = link.device().name();
    let session = guest.folder.join(format!("{name}.mcap"));
    let device = link.argument().map_err(|e| e.to_string())?;
    let camera = format!("v4l:{}", crate::camera::SERIAL);
    let start = Instant::now();
    program(
        guest,
        &[
            "scan",
            "--device",
            &device,
            "--camera",
            &camera,
            "--instrument",
            "tiny",
            "--sample",
            "hil",
            "-o",
            &session.display().to_string(),
        ],
    )?;
    let seconds = start.elapsed().as_secs_f64();
    program(guest, &["verify", &session.display().to_string()])?;
    guest.figure(&format!("a scan through {name} and the camera"), seconds, "s", None, "6 poses, tiny instrument")
}

/// Runs the program; its exit status must be 0.
fn program(guest: &Guest, arguments: &[&str]) -> Result<(), String> {
    let output = Command::new(&guest.gonio)
        .args(arguments)
        .output()
        .map_err(|e| format!("{}: {e}", guest.gonio.display()))?;
    if output.status.success() {
        return Ok(());
    }
    let words = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = words.lines().collect();
    let tail = lines[lines.len().saturating_sub(TAIL)..].join("\n");
    Err(format!("gonio {} ended with {}:\n{tail}", arguments.join(" "), output.status))
}
