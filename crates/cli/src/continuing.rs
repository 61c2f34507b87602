//! Going on with a session: it must be the same scan, of the same sample on the same instrument.

use std::path::Path;

use gonio_acquisition::engine::Outcome;
use gonio_acquisition::runner::FrameCounts;
use gonio_instrument::{LinkStatistics, SampleRecord};
use gonio_recording::Session;
use gonio_sim::Truth;

use crate::arguments::ScanArguments;
use crate::outcome::Failure;
use crate::rig::Simulated;
use crate::scanning::{Job, Recorded};

/// Refuses names that would bring a session to harm: `S.nc`, which `--fit` writes, and `S.2.mcap`, which a continued `S.mcap` is looked
/// for in.
///
/// # Errors
/// [`Failure::Usage`] with a better name.
pub fn check_name(output: &Path) -> Result<(), Failure> {
    if output.extension().is_none_or(|e| e != "mcap") {
        return Err(Failure::usage(format!(
            "{}: a session is named NAME.mcap, its table and report stand beside it; say -o {}",
            output.display(),
            output.with_extension("mcap").display()
        )));
    }
    let stem = Path::new(output.file_stem().unwrap_or_default());
    let number = stem.extension().and_then(|e| e.to_str()).and_then(|e| e.parse::<u32>().ok());
    if let (Some(2..), Some(base)) = (number, stem.file_stem()) {
        let first = output.with_file_name(base).with_added_extension("mcap");
        if first.exists() {
            return Err(Failure::usage(format!(
                "{} would be taken for a continuation of {}; choose another name, or go on with that one by --resume",
                output.display(),
                first.display()
            )));
        }
    }
    Ok(())
}

/// Holds what is asked for against what the session was begun with. What the command line leaves open is taken from the session: who and
/// what was measured, and the truth of a virtual sample.
///
/// # Errors
/// [`Failure::Usage`] naming what differs and what it was.
pub fn check(
    begun: &Session,
    a: &ScanArguments,
    simulated: Option<&mut Simulated>,
    sample: &mut SampleRecord,
) -> Result<(), Failure> {
    let differs = |what: &str, was: &str| {
        Failure::usage(format!(
            "{} was begun with {what} {was}; go on with the same, or record a new session",
            begun.path().display()
        ))
    };
    // a part that is lost cannot contradict
    if let Ok(was) = begun.sample() {
        if was.kind != sample.kind {
            return Err(differs("--kind", was.kind.name()));
        }
        for (what, now, was) in [
            ("--sample", &mut sample.id, was.id),
            ("--name", &mut sample.name, was.name),
            ("--batch", &mut sample.batch, was.batch),
            ("--operator", &mut sample.operator, was.operator),
            ("--note", &mut sample.note, was.note),
        ] {
            if now.is_empty() {
                *now = was;
            } else if *now != was {
                return Err(differs(what, &format!("\"{was}\"")));
            }
        }
    }
    let Ok(provenance) = begun.provenance() else { return Ok(()) };
    let seed = provenance.get("seed");
    let Some(simulated) = simulated else {
        return match seed {
            Some(_) => Err(differs("--device", "sim")),
            None => Ok(()),
        };
    };
    match seed {
        None => return Err(differs("--device", "serial:PATH, not the virtual instrument")),
        Some(was) if *was != simulated.seed.to_string() => return Err(differs("--seed", was)),
        Some(_) => {}
    }
    let errors = serde_json::to_string(&simulated.errors).unwrap_or_default();
    if provenance.get("misalignment").is_some_and(|was| *was != errors) {
        return Err(differs("another --misalignment", "than this"));
    }
    let truth = begun.attachment("truth.json").and_then(|t| std::str::from_utf8(t).ok());
    match (truth, &a.simulated.truth) {
        (Some(was), None) => {
            simulated.truth = Truth::from_bytes(was.as_bytes()).map_err(Failure::usage)?;
            simulated.truth_text = Some(was.to_owned());
        }
        (Some(was), Some(path)) if simulated.truth_text.as_deref() != Some(was) => {
            return Err(differs("another --truth than", &format!("{} (leave --truth out)", path.display())));
        }
        (None, None) => return Err(differs("a --truth", "that the session does not hold: name its file")),
        _ => {}
    }
    Ok(())
}

/// The session as it is, where every pose of it is done already.
///
/// # Errors
/// [`Failure::Usage`] where it cannot be read, or is of another instrument or plan.
pub fn nothing_left(job: &Job<'_>) -> Result<Option<Recorded>, Failure> {
    let session = Session::open(job.output).map_err(Failure::usage)?;
    let same = session.instrument().is_ok_and(|i| i == *job.instrument)
        && session.plan().is_ok_and(|p| p == *job.plan);
    let progress = gonio_recording::progress(job.output).map_err(Failure::usage)?;
    if !(same && session.finished() && progress.complete()) {
        return Ok(None);
    }
    let devices = session.devices().map_err(Failure::usage)?;
    let poses = progress.planned.unwrap_or_default();
    crate::outcome::told(&format!(
        "note: every pose of {} is done already, nothing is measured again",
        job.output.display()
    ));
    Ok(Some(Recorded {
        outcome: Outcome::Done,
        poses_done: poses,
        poses_total: poses,
        frames: 0,
        link: LinkStatistics::default(),
        camera_frames: FrameCounts::default(),
        stage: devices.stage,
        camera: devices.camera,
    }))
}
