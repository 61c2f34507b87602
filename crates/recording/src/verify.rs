//! Is a session whole? Every byte of every file is under some checksum, and each is compared here.
//!
//! | bytes | checked by |
//! |---|---|
//! | magic, header, attachments, chunks, message indexes, seals | data-section CRC; each stretch again by its seal |
//! | attachments | their own CRC |
//! | chunks | CRC of the content; SHA-256 of each frame |
//! | data-end record, end magic | their fixed form; the CRC they hold |
//! | summary, summary offsets, footer | summary CRC |

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::RecordingError;
use crate::bytes::Bytes;
use crate::layout::{FOOTER_LENGTH, FORMAT, RECORD_HEAD, attachment};
use crate::segment::{Finding, Segment};
use crate::session::Session;

/// The verdict on a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Every byte is as it was written.
    Intact,
    /// Something is damaged or missing; what is reported whole can be read.
    ReadableWithLoss,
    /// There were poses and none can be read.
    Unreadable,
}

/// A pose that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LostPose {
    /// Its place in the plan.
    pub index: u32,
    /// The file it lies in.
    pub path: PathBuf,
    /// Where its chunk begins.
    pub offset: u64,
    /// Why.
    pub reason: String,
}

/// What [`verify`] found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Report {
    /// The verdict.
    pub status: Status,
    /// The files of the session.
    #[serde(serialize_with = "crate::paths::all_shown")]
    pub files: Vec<PathBuf>,
    /// Whether every file was closed with its summary.
    pub finished: bool,
    /// Poses in the plan, where it can be read.
    pub planned: Option<u32>,
    /// Poses that are whole, ascending.
    pub poses: Vec<u32>,
    /// Frames of those poses.
    pub frames: u64,
    /// Poses that were recorded and cannot be read.
    pub lost: Vec<LostPose>,
    /// Everything that is wrong, lost poses included.
    pub findings: Vec<Finding>,
}

/// Reads the whole session and compares every checksum. Memory holds one pose at a time.
///
/// # Errors
/// As [`Session::open`]; damage is no error but a [`Report`].
pub fn verify(path: &Path) -> Result<Report, RecordingError> {
    verify_session(&Session::open(path)?)
}

pub(crate) fn verify_session(session: &Session) -> Result<Report, RecordingError> {
    let mut findings = session.findings().to_vec();
    for (segment, record) in session.segments.iter().zip(&session.records) {
        check_head(segment, record.is_some(), &mut findings);
        check_seals(segment, &mut findings)?;
        check_end(segment, &mut findings)?;
    }
    for name in [attachment::SESSION, attachment::INSTRUMENT, attachment::PLAN, attachment::SAMPLE] {
        if session.attachment(name).is_none() {
            let f = Finding { path: session.path().to_owned(), offset: 0, what: format!("{name} is lost") };
            findings.push(f);
        }
    }
    let (mut poses, mut lost, mut frames) = (BTreeSet::new(), Vec::new(), 0);
    for (&index, places) in session.places() {
        let mut bad = Vec::new();
        for place in places {
            let path = session.segments.get(place.segment).map_or(session.path(), |s| s.path.as_path());
            match session.read_place(index, place) {
                Ok(p) => {
                    if poses.insert(index) {
                        frames += p.record.exposures.len() as u64;
                    }
                }
                Err(e) => bad.push(LostPose {
                    index,
                    path: path.to_owned(),
                    offset: place.chunk.offset,
                    reason: reason(e),
                }),
            }
        }
        for l in &bad {
            findings.push(Finding {
                path: l.path.clone(),
                offset: l.offset,
                what: format!("pose {index} cannot be read: {}", l.reason),
            });
        }
        if !poses.contains(&index) {
            lost.append(&mut bad);
        }
    }
    for segment in &session.segments {
        for chunk in &segment.chunks {
            let is_pose = session
                .places()
                .values()
                .flatten()
                .any(|p| p.chunk.offset == chunk.offset && same_file(session, p.segment, segment));
            if !is_pose && let Err(e) = segment.chunk(chunk) {
                findings.push(segment.finding(chunk.offset, reason(e)));
            }
        }
    }
    findings.dedup();
    let status = match (findings.is_empty(), poses.is_empty() && !lost.is_empty()) {
        (true, _) => Status::Intact,
        (false, true) => Status::Unreadable,
        (false, false) => Status::ReadableWithLoss,
    };
    Ok(Report {
        status,
        files: session.files().map(Path::to_owned).collect(),
        finished: session.finished(),
        planned: session.record().map(|r| r.planned),
        poses: poses.into_iter().collect(),
        frames,
        lost,
        findings,
    })
}

fn same_file(session: &Session, index: usize, segment: &Segment) -> bool {
    session.segments.get(index).is_some_and(|s| s.path == segment.path)
}

/// Our damage without the file's name and the advice, which the report gives once.
fn reason(e: RecordingError) -> String {
    match e {
        RecordingError::Damaged { what, .. } => what,
        other => other.to_string(),
    }
}

fn check_head(segment: &Segment, has_record: bool, findings: &mut Vec<Finding>) {
    if segment.profile.as_deref() != Some(FORMAT) {
        findings.push(segment.finding(8, "the header record is damaged"));
    }
    if !has_record {
        findings.push(segment.finding(0, format!("{} is lost", attachment::SESSION)));
    }
}

fn check_seals(segment: &Segment, findings: &mut Vec<Finding>) -> Result<(), RecordingError> {
    let mut expected = 0;
    for seal in &segment.seals {
        if seal.covered_from != expected {
            findings.push(segment.finding(expected, "a seal is missing here"));
        }
        expected = seal.end();
        let crc = segment.crc(seal.covered_from, seal.offset)?.finalize();
        if crc != seal.covered_crc {
            findings.push(segment.finding(
                seal.covered_from,
                format!("the {} bytes from here do not match their seal", seal.offset - seal.covered_from),
            ));
        }
    }
    Ok(())
}

fn check_end(segment: &Segment, findings: &mut Vec<Finding>) -> Result<(), RecordingError> {
    let Some(at) = segment.data_end else {
        let end = segment.sealed_end();
        let rest = segment.length.saturating_sub(end);
        findings.push(segment.finding(
            end,
            format!("the file was never finished; {rest} bytes follow the last pose that was done"),
        ));
        return Ok(());
    };
    let record = segment.read(at, RECORD_HEAD + 4)?;
    let stored = Bytes::new(record.get(RECORD_HEAD as usize..).unwrap_or_default()).u32();
    let crc = segment.crc(0, at)?.finalize();
    if stored != Some(crc) {
        findings.push(segment.finding(at, "the data section does not match its CRC"));
    }
    if at != segment.sealed_end() {
        findings
            .push(segment.finding(segment.sealed_end(), "there are bytes between the last seal and the end"));
    }
    if !segment.finished {
        findings.push(segment.finding(at, "the footer or the last eight bytes are damaged"));
        return Ok(());
    }
    // the CRC covers the summary and the footer up to the CRC itself
    let summary_start = at + RECORD_HEAD + 4;
    let crc_at = segment.length - 12;
    let footer = segment.read(segment.length - 8 - FOOTER_LENGTH, FOOTER_LENGTH)?;
    let mut b = Bytes::new(footer.get(RECORD_HEAD as usize..).unwrap_or_default());
    let (start, _, stored) = (b.u64(), b.u64(), b.u32());
    let crc = segment.crc(summary_start, crc_at)?.finalize();
    if stored != Some(crc) || start != Some(summary_start) {
        findings.push(segment.finding(summary_start, "the summary does not match its CRC"));
    }
    Ok(())
}
