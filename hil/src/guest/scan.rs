//! Whole scans of the tiny instrument with the program that users run.

use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::Guest;
use super::stage::Link;
use crate::files;
use crate::line::{Device, FromGuest};
use gonio_instrument::ScanKind;

/// Lines of the program's log that are shown where it fails.
const TAIL: usize = 12;

/// When plugs are pulled in a scan, s after its start, and for how long.
const PULLED_AT: [f64; 2] = [3.0, 5.0];
const PULLED_FOR: Duration = Duration::from_millis(500);

/// Scans what is to be scanned through a link and the camera; the session is complete and every byte of it verifies.
pub fn whole(guest: &mut Guest, link: Link, kind: ScanKind) -> Result<(), String> {
    let seconds = scan(guest, link, kind, &[])?;
    let name = format!("a scan ({}) through {} and the camera", word(kind)?, link.device().name());
    guest.figure(&name, seconds, "s", None, "6 poses, tiny instrument")
}

/// Scans the sample with the plug of the stage pulled for a moment in the midst of it, then that of the camera: it costs time, no pose.
pub fn disturbed(guest: &mut Guest, link: Link) -> Result<(), String> {
    let seconds = scan(guest, link, ScanKind::Sample, &[link.device(), Device::Camera])?;
    let name = format!("a scan through {} and the camera, plugs pulled", link.device().name());
    guest.figure(&name, seconds, "s", None, "6 poses, each plug pulled once")
}

/// A kind as the command line has it.
fn word(kind: ScanKind) -> Result<String, String> {
    match serde_json::to_value(kind) {
        Ok(serde_json::Value::String(word)) => Ok(word),
        other => Err(format!("{kind:?} is written as {other:?}")),
    }
}

fn scan(guest: &mut Guest, link: Link, kind: ScanKind, pulled: &[Device]) -> Result<f64, String> {
    guest.control.ask(&FromGuest::Chart { on: false })?;
    guest.control.ask(&FromGuest::Sample { kind })?;
    let kind = word(kind)?;
    let in_folder = |file: &str| guest.folder.join(file).display().to_string();
    let session = in_folder(&format!("{}-{kind}.mcap", link.device().name()));
    let (instrument, certificate) = (in_folder(files::INSTRUMENT), in_folder(files::CERTIFICATE));
    let device = link.argument().map_err(|e| e.to_string())?;
    let camera = format!("v4l:{}", crate::camera::SERIAL);
    let mut arguments = vec!["scan", "--device", &device, "--camera", &camera, "--instrument", &instrument];
    arguments.extend(["--kind", &kind, "--sample", "hil", "-o", &session]);
    if kind == "white" {
        arguments.extend(["--certificate", &certificate]);
    }
    let start = Instant::now();
    let mut child = program(guest, &arguments);
    let child = child.spawn().map_err(|e| format!("{}: {e}", guest.gonio.display()))?;
    let done = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&done);
    // its words are read all the while: a full pipe would hold it up
    let waiter = std::thread::spawn(move || {
        let output = child.wait_with_output();
        seen.store(true, Ordering::SeqCst);
        output
    });
    for (device, at) in pulled.iter().zip(PULLED_AT) {
        std::thread::sleep(Duration::from_secs_f64(at).saturating_sub(start.elapsed()));
        guest.control.plug(*device, false)?;
        std::thread::sleep(PULLED_FOR);
        guest.control.plug(*device, true)?;
        if done.load(Ordering::SeqCst) {
            break;
        }
    }
    let early = done.load(Ordering::SeqCst);
    let output = waiter.join().map_err(|_| "the thread that waits for the scan panicked".to_owned())?;
    let seconds = start.elapsed().as_secs_f64();
    judge(&arguments, &output.map_err(|e| e.to_string())?)?;
    if early && !pulled.is_empty() {
        return Err(format!("the scan had ended after {seconds:.1} s, before all plugs were pulled"));
    }
    let arguments = ["verify", &session];
    judge(&arguments, &program(guest, &arguments).output().map_err(|e| e.to_string())?)?;
    Ok(seconds)
}

/// The program with its words kept.
fn program(guest: &Guest, arguments: &[&str]) -> Command {
    let mut command = Command::new(&guest.gonio);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Its exit status must be 0.
fn judge(arguments: &[&str], output: &Output) -> Result<(), String> {
    if output.status.success() {
        return Ok(());
    }
    let words = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = words.lines().collect();
    let tail = lines[lines.len().saturating_sub(TAIL)..].join("\n");
    Err(format!("gonio {} ended with {}:\n{tail}", arguments.join(" "), output.status))
}
