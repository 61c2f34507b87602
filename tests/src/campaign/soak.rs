//! Scan after scan under faults of line and camera, for an hour: memory and file descriptors stay flat, and every frame is accounted for.
//!
//! The tiny instrument runs two hundred times faster than life. Its line loses, damages, repeats and overtakes; now and then its plug is pulled; its
//! camera drops, tears, freezes, repeats and delays frames. Each scan draws its own faults.

use std::path::Path;
use std::time::{Duration, Instant};

use gonio_acquisition::PixelMap;
use gonio_acquisition::engine::Outcome;
use gonio_acquisition::runner::FrameCounts;
use gonio_driver::camera::CameraFaults;
use gonio_driver::transport::LineFaults;
use gonio_instrument::{Camera, Cancel, DeviceError};
use gonio_recording::{Session, Status, verify};
use gonio_sim::firmware::{Faults, What};

use super::dice::Dice;
use super::instrument::{Tiny, scan};
use super::{Figure, Settings, grouped};

/// Scans after which memory has found its level.
const WARM: usize = 10;

/// Runs the campaign.
///
/// # Panics
/// Where the temporary folder cannot be written.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let long = Duration::from_secs_f64((3600.0 * settings.share).max(1.0));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.mcap");
    let mut dice = Dice::new(settings.seed, 70);
    let begun = Instant::now();
    let (mut scans, mut partial, mut failed, mut damaged) = (0u64, 0u64, 0u64, 0u64);
    let (mut frames, mut dropped, mut unaccounted) = (0u64, 0u64, 0u64);
    let (mut memory, mut descriptors) = (Vec::new(), Vec::new());
    let mut map = None;
    while begun.elapsed() < long || scans < 3 {
        let mut faults = Faults::default();
        if dice.happens(0.3) {
            faults = faults.at_move(What::HangUp, 1 + dice.below(5) as u32);
            if let Some(event) = faults.events.last_mut() {
                event.for_s = Some(40.0);
            }
        }
        let tiny = Tiny::new(None, 200.0, faults);
        let map = map.get_or_insert_with(|| PixelMap::new(&tiny.description));
        let line = LineFaults {
            loss: 0.05 * dice.fraction(),
            corruption: 0.05 * dice.fraction(),
            duplication: 0.05 * dice.fraction(),
            reorder: 0.02 * dice.fraction(),
            ..LineFaults::default()
        };
        let bad = CameraFaults {
            dropped: 0.05 * dice.fraction(),
            torn: 0.05 * dice.fraction(),
            frozen: 0.03 * dice.fraction(),
            duplicated: 0.03 * dice.fraction(),
            late: 0.02 * dice.fraction(),
            late_by: Duration::from_millis(5),
            unplugged_after: None,
        };
        let (outcome, told, done) = {
            let Ok(mut stage) = tiny.stage(Some((line, dice.next_u64())), None) else {
                failed += 1;
                scans += 1;
                continue;
            };
            let (mut camera, tally) = tiny.camera(bad, dice.next_u64());
            let (outcome, mut told) = scan(&tiny, map, &mut stage, &mut camera, &path, &Cancel::new());
            one_more(&mut camera, &mut told.frames);
            (outcome, told, tally.counts())
        };
        drop(tiny);
        scans += 1;
        match &outcome {
            Outcome::Done => {}
            Outcome::Partial { .. } => partial += 1,
            _ => {
                eprintln!("scan {scans}: {outcome:?}");
                failed += 1;
            }
        }
        let counts = told.frames;
        frames += counts.sound;
        dropped += done.dropped;
        // a frame given twice takes the place of one that never comes
        // this camera's first frame is number 0
        let missing = counts.missing + counts.first.unwrap_or(0);
        let before = unaccounted;
        unaccounted += missing.abs_diff(done.dropped + done.duplicated);
        unaccounted += counts.repeated.abs_diff(done.duplicated);
        unaccounted += counts.timed_out.abs_diff(done.late);
        if unaccounted > before {
            eprintln!("scan {scans}, {outcome:?}: the camera did {done:?}, the scan saw {counts:?}");
        }
        damaged += u64::from(!verify(&path).is_ok_and(|r| r.status == Status::Intact));
        let kept: u64 =
            Session::open(&path).map_or(0, |s| s.poses().flatten().map(|p| p.exposures.len() as u64).sum());
        unaccounted += u64::from(kept > counts.sound);
        memory.push(resident_kib());
        // beside other tests in one process only what is open of this campaign's own files is its own
        descriptors.push(open_descriptors((!settings.timed).then(|| folder.path())));
    }
    let size = format!("{} scans in {:.0} s", grouped(scans), begun.elapsed().as_secs_f64());
    let settled = memory.get(WARM.min(memory.len() / 3)..).unwrap_or(&memory);
    let third = (settled.len() / 3).max(1);
    let mean = |v: &[u64]| v.iter().sum::<u64>() as f64 / v.len().max(1) as f64;
    let growth = mean(&settled[settled.len() - third..]) / mean(&settled[..third]) - 1.0;
    let more =
        descriptors.last().copied().unwrap_or(0).saturating_sub(descriptors.first().copied().unwrap_or(0));
    vec![
        Figure::time(
            settings,
            "memory, last third over first third after warm-up",
            growth * 100.0,
            "%",
            5.0,
            &size,
        ),
        Figure::exactly("file descriptors more at the end than after the first scan", more, 0, &size),
        Figure::exactly(
            "frames unaccounted for",
            unaccounted,
            0,
            &format!("{} kept, {} dropped", grouped(frames), grouped(dropped)),
        ),
        Figure::exactly("scans that failed", failed, 0, &size),
        Figure::exactly("sessions not intact", damaged, 0, &size),
        Figure::told("scans with a pose given up after three tries at a frame", partial.to_string(), &size),
        Figure::told(
            "memory at the end",
            format!("{:.1} MiB", memory.last().copied().unwrap_or(0) as f64 / 1024.0),
            &size,
        ),
    ]
}

/// What was lost behind the last frame of a scan shows in the number of the next one only.
fn one_more(camera: &mut impl Camera, counts: &mut FrameCounts) {
    while let Some(last) = counts.last {
        match camera.capture(Duration::from_millis(1), &Cancel::new()) {
            Ok(frame) if frame.sequence > last => {
                counts.missing += frame.sequence - last - 1;
                return;
            }
            Ok(_) => counts.repeated += 1,
            Err(DeviceError::Timeout { .. }) => counts.timed_out += 1,
            Err(_) => return,
        }
    }
}

/// Resident memory of this process, KiB; 0 where the system does not tell.
fn resident_kib() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with("VmRSS:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|n| n.parse().ok()).unwrap_or(0)
}

/// Descriptors that this process has open, all or those of files in a folder.
fn open_descriptors(within: Option<&Path>) -> u64 {
    let Ok(all) = std::fs::read_dir("/proc/self/fd") else { return 0 };
    let counts = |at: &Path| {
        within.is_none_or(|folder| std::fs::read_link(at).is_ok_and(|target| target.starts_with(folder)))
    };
    all.flatten().filter(|e| counts(&e.path())).count() as u64
}
