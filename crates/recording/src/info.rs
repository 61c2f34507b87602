//! What a session holds, in a few words; read from heads alone, so it is quick on any size.

use std::path::{Path, PathBuf};

use gonio_instrument::{Plan, SampleRecord};
use serde::Serialize;

use crate::RecordingError;
use crate::layout::{FORMAT, VERSION};
use crate::seal::Kind;
use crate::session::Session;

/// The summary of a session, for people and for `--json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Info {
    /// Always `gonio-session`.
    pub format: &'static str,
    /// Version of the format.
    pub version: u32,
    /// Identity shared by all segments.
    pub id: Option<String>,
    /// The files.
    #[serde(serialize_with = "crate::paths::all_shown")]
    pub files: Vec<PathBuf>,
    /// Their size together.
    pub bytes: u64,
    /// What was measured.
    pub sample: Option<SampleRecord>,
    /// Name of the instrument.
    pub instrument: Option<String>,
    /// The plan.
    pub plan: Option<Plan>,
    /// Poses in the plan.
    pub planned: Option<u32>,
    /// Poses that were done.
    pub poses: Vec<u32>,
    /// Their frames.
    pub frames: u64,
    /// Start, ns since the Unix epoch.
    pub started_ns: Option<u64>,
    /// From the first to the last note, pauses between segments included, s.
    pub duration_s: f64,
    /// Whether every file was closed with its summary.
    pub finished: bool,
    /// Whether every planned pose was done.
    pub complete: bool,
    /// Names of the attachments.
    pub attachments: Vec<String>,
    /// What was found wrong on the way; `verify` looks further.
    pub damage: Vec<String>,
}

/// Looks at a session.
///
/// # Errors
/// As [`Session::open`].
pub fn info(path: &Path) -> Result<Info, RecordingError> {
    Ok(of(&Session::open(path)?))
}

/// The summary of an open session.
#[must_use]
pub fn of(session: &Session) -> Info {
    let record = session.record();
    let times = || session.segments.iter().flat_map(|s| &s.seals).filter(|s| s.kind != Kind::Head);
    let first = times().map(|s| s.first_time).min().unwrap_or(0);
    let last = times().map(|s| s.last_time).max().unwrap_or(0);
    let poses: Vec<u32> = session.pose_indices().collect();
    let planned = record.map(|r| r.planned);
    Info {
        format: FORMAT,
        version: record.map_or(VERSION, |r| r.version),
        id: record.map(|r| r.id.clone()),
        files: session.files().map(Path::to_owned).collect(),
        bytes: session.segments.iter().map(|s| s.length).sum(),
        sample: session.sample().ok(),
        instrument: session.instrument().ok().map(|i| i.name),
        plan: session.plan().ok(),
        planned,
        complete: planned.is_some_and(|n| poses.len() as u64 >= u64::from(n)),
        poses,
        frames: session.frames(),
        started_ns: record.map(|r| r.started_ns),
        duration_s: last.saturating_sub(first) as f64 * 1e-9,
        finished: session.finished(),
        attachments: session.attachment_names().map(str::to_owned).collect(),
        damage: session.findings().iter().map(|f| format!("byte {}: {}", f.offset, f.what)).collect(),
    }
}
