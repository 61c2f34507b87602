//! From recorded sessions to a table, the same way for a live scan and a replay.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gonio_acquisition::{Options, PixelMap, Reducer, WhiteBuilder, WhiteReference, reference};
use gonio_brdf::Measured;
use gonio_instrument::{Certificate, Description, PoseRecord, SampleRecord, ScanKind};
use gonio_recording::Session;

use crate::outcome::Failure;
use crate::output::beside;

/// The white reference of a scan and the pixel map it was made with.
pub struct Calibrated {
    /// The camera, traced once.
    pub map: Arc<PixelMap>,
    /// The calibration of every pixel.
    pub white: WhiteReference,
    /// The session it came from.
    pub session: PathBuf,
    /// Poses of it that could not be read, in words.
    pub lost: Vec<String>,
    /// Reference sessions beside it: those that only checks use.
    pub others: Vec<PathBuf>,
}

/// A white reference that may be used.
pub struct White {
    /// The session.
    pub session: Session,
    /// Its certificate.
    pub certificate: Certificate,
    /// What was accepted although it is wrong.
    pub notes: Vec<String>,
}

/// The white reference among `references`, held against the instrument and the day of the scan (`YYYY-MM-DD`).
///
/// # Errors
/// [`Failure::Usage`]: none of them is a white reference, it is expired or of another instrument, or it cannot be read.
pub fn find_white(
    references: &[PathBuf],
    instrument: &Description,
    day: &str,
    accept_stale: bool,
) -> Result<White, Failure> {
    let mut kinds = Vec::new();
    for path in references {
        let session = Session::open(path).map_err(|e| Failure::usage(format!("reference {e}")))?;
        let in_session =
            |e: &dyn std::fmt::Display| Failure::usage(format!("reference {}: {e}", path.display()));
        let kind = session.sample().map_err(|e| in_session(&e))?.kind;
        if kind != ScanKind::White {
            kinds.push(format!("{} ({})", path.display(), kind.name()));
            continue;
        }
        let certificate = session.certificate().map_err(|e| in_session(&e))?.ok_or_else(|| {
            in_session(&"the session holds no certificate; record it again with --certificate")
        })?;
        let measured_on = session.instrument().map_err(|e| in_session(&e))?;
        let notes = reference::validate(&certificate, &measured_on, instrument, day, accept_stale)
            .map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?;
        return Ok(White { session, certificate, notes });
    }
    Err(Failure::usage(if kinds.is_empty() {
        "a white reference is needed: record one with --kind white and name it with --reference".to_owned()
    } else {
        format!("none of {} is a white reference; record one with --kind white", kinds.join(", "))
    }))
}

/// Finds the white reference among `references` and computes the calibration of every pixel from it.
///
/// # Errors
/// As [`find_white`].
pub fn calibrate(
    references: &[PathBuf],
    instrument: &Description,
    day: &str,
    accept_stale: bool,
) -> Result<Calibrated, Failure> {
    let White { session, certificate, notes } = find_white(references, instrument, day, accept_stale)?;
    let path = session.path().to_owned();
    let in_session = |e: &dyn std::fmt::Display| Failure::usage(format!("reference {}: {e}", path.display()));
    let map = Arc::new(PixelMap::new(instrument));
    let mut builder = WhiteBuilder::new(map.clone(), &certificate, notes, &Options::default())
        .map_err(|e| in_session(&e))?;
    let (mut lost, mut dark) = (Vec::new(), false);
    for pose in session.poses() {
        match pose {
            Ok(record) => {
                dark |= record.exposures.iter().any(|e| !e.shutter_open);
                builder.add_pose(&record).map_err(|e| in_session(&e))?;
            }
            Err(e) => lost.push(format!("white reference: {e}")),
        }
    }
    if !dark {
        lost.push(format!("white reference: {NO_DARK}"));
    }
    let white = builder.finish().map_err(|e| in_session(&e))?;
    let others = references.iter().filter(|r| **r != path).cloned().collect();
    Ok(Calibrated { map, white, session: path, lost, others })
}

/// The reference sessions of a recorded session: those named, else the one recorded with it, else the one that stands beside it.
#[must_use]
pub fn references_of(session_path: &Path, session: &Session, named: &[PathBuf]) -> Vec<PathBuf> {
    if !named.is_empty() {
        return named.to_vec();
    }
    let recorded = session.provenance().ok().and_then(|p| p.get("reference").cloned());
    let candidates = recorded
        .into_iter()
        .map(|name| session_path.with_file_name(name))
        .chain(std::iter::once(beside(session_path, "white.mcap")));
    candidates.filter(|p| p.exists()).take(1).collect()
}

/// A reducer for a scan.
///
/// # Errors
/// [`Failure::Failed`] for settings outside their range.
pub fn reducer(
    calibrated: &Calibrated,
    sample: &SampleRecord,
    options: &Options,
) -> Result<Reducer, Failure> {
    Reducer::new(calibrated.map.clone(), calibrated.white.clone(), sample.clone(), options.clone())
        .map_err(|e| Failure::failed("the reduction cannot begin", e))
}

/// What a whole session gives.
pub struct Reduced {
    /// The table, holes filled.
    pub table: Measured,
    /// What each pose gave.
    pub reducer: Reducer,
    /// Poses that could not be read or used, with the reason.
    pub lost: Vec<String>,
}

/// Reduces every readable pose of a session, in the order of the plan. `seen` is called before each pose with its place and their number.
///
/// # Errors
/// [`Failure::Failed`] where no pose can be used.
pub fn reduce(
    session: &Session,
    calibrated: &Calibrated,
    options: &Options,
    mut seen: impl FnMut(usize, usize),
) -> Result<Reduced, Failure> {
    let sample = session.sample().map_err(Failure::usage)?;
    let mut reducer = reducer(calibrated, &sample, options)?;
    let mut lost = calibrated.lost.clone();
    let total = session.pose_indices().count();
    for (k, pose) in session.poses().enumerate() {
        seen(k, total);
        match pose {
            Ok(record) => add(&mut reducer, &record, &mut lost),
            Err(e) => lost.push(e.to_string()),
        }
    }
    if reducer.statistics().is_empty() {
        let why = if lost.is_empty() { "the session holds none".to_owned() } else { lost.join("; ") };
        return Err(Failure::Failed(format!("{}: no pose can be used: {why}", session.path().display())));
    }
    let table = reducer.finish();
    lost.extend(without_dark(&table));
    Ok(Reduced { table, reducer, lost })
}

/// What is missing where no dark frame is.
const NO_DARK: &str = "no dark frames could be read: the nominal black level stands for them, dark current is not taken off and hot pixels are not known; \
                       record the session again";

/// What a table says that was made without any dark frame.
#[must_use]
pub fn without_dark(table: &Measured) -> Option<String> {
    (table.attributes.get("dark_frames").is_some_and(|n| n == "0")).then(|| NO_DARK.to_owned())
}

/// Adds a pose; one that cannot be used is named and left out.
pub fn add(reducer: &mut Reducer, record: &PoseRecord, lost: &mut Vec<String>) {
    if let Err(e) = reducer.add_pose(record) {
        lost.push(format!("pose {} ({}): {e}", record.index, record.commanded));
    }
}

/// The day on which a session was begun.
#[must_use]
pub fn day_of(session: &Session) -> String {
    day(std::time::Duration::from_nanos(session.record().map_or(0, |r| r.started_ns)))
}

/// `YYYY-MM-DD` of a time since the Unix epoch, UTC (days to civil date after Hinnant).
#[must_use]
pub fn day(since_epoch: std::time::Duration) -> String {
    let z = (since_epoch.as_secs() / 86_400) as i64 + 719_468;
    let era = z.div_euclid(146_097);
    let doe = z.rem_euclid(146_097);
    let yoe = (doe - doe / 1_460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let (d, m) = (doy - (153 * mp + 2) / 5 + 1, if mp < 10 { mp + 3 } else { mp - 9 });
    format!("{:04}-{m:02}-{d:02}", yoe + era * 400 + i64::from(m <= 2))
}

#[cfg(test)]
mod tests {
    use super::day;
    use std::time::Duration;

    #[test]
    fn days_are_those_of_the_calendar() {
        for (secs, want) in [(0, "1970-01-01"), (951_782_400, "2000-02-29"), (1_795_305_600, "2026-11-22")] {
            assert_eq!(day(Duration::from_secs(secs)), want);
        }
    }
}
