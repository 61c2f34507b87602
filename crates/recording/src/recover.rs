//! Copies what is whole of a damaged session into a new one, and says what was lost.

use std::collections::BTreeSet;
use std::path::Path;

use crate::RecordingError;
use crate::chunk;
use crate::header::{Attachment, SessionRecord};
use crate::layout::{FORMAT, RECORD_HEAD, VERSION, attachment};
use crate::resume::fresh;
use crate::seal::Kind;
use crate::segment_writer::{Content, SegmentWriter};
use crate::session::Session;
use crate::verify::{Report, verify_session};

/// Copies into `to` every attachment, pose and note of the session `from` that verifies, all segments into one file. Chunks are copied
/// as they are: nothing damaged gets a fresh checksum. Returns what [`crate::verify::verify`] finds in `from`; the same stands in
/// the copy as `recovery.json`.
///
/// # Errors
/// As [`Session::open`]; [`RecordingError::Exists`] where `to` exists and `overwrite` is off, or is a file of `from`; and what writing
/// brings.
pub fn recover(from: &Path, to: &Path, overwrite: bool) -> Result<Report, RecordingError> {
    let session = Session::open(from)?;
    let report = verify_session(&session)?;
    if let Ok(target) = to.canonicalize()
        && session.files().any(|f| f.canonicalize().is_ok_and(|f| f == target))
    {
        return Err(RecordingError::Exists { path: to.to_owned() });
    }
    let record = match session.record() {
        Some(r) => SessionRecord { segment: 1, ..r.clone() },
        None => SessionRecord {
            format: FORMAT.to_owned(),
            version: VERSION,
            id: "unknown".to_owned(),
            segment: 1,
            started_ns: 0,
            planned: session.plan().map_or(0, |p| u32::try_from(p.poses().len()).unwrap_or(u32::MAX)),
        },
    };
    let json =
        |e: serde_json::Error| RecordingError::Header { what: attachment::RECOVERY, reason: e.to_string() };
    let mut attachments = vec![
        Attachment::text(
            attachment::SESSION,
            "application/json",
            &serde_json::to_string_pretty(&record).map_err(json)?,
        ),
        Attachment::text(
            attachment::RECOVERY,
            "application/json",
            &serde_json::to_string_pretty(&report).map_err(json)?,
        ),
    ];
    for (name, a) in session.read_attachments() {
        if name != attachment::SESSION && name != attachment::RECOVERY {
            let (media_type, data) = (a.media_type.clone(), a.data.clone());
            attachments.push(Attachment { name: name.clone(), media_type, data });
        }
    }
    let file = crate::writer::create_file(to, overwrite)?;
    let mut w = SegmentWriter::create(Box::new(file), to, &attachments, record.started_ns)?;
    let mut copied = BTreeSet::new();
    for segment in &session.segments {
        for entry in &segment.chunks {
            let Ok(chunk) = segment.chunk(entry) else { continue };
            let content = match chunk.pose() {
                Ok(Some(p)) if copied.insert(p.record.index) => Content {
                    kind: Kind::Pose,
                    pose: p.record.index,
                    frames: p.record.exposures.len() as u32,
                    commanded: p.record.commanded,
                },
                Ok(None) => Content::other(),
                // taken again later in the session, or its frames do not match their digests
                Ok(Some(_)) | Err(_) => continue,
            };
            let record = segment.chunk_record(entry)?;
            if let Some((_, bytes)) =
                chunk::parse_head(record.get(RECORD_HEAD as usize..).unwrap_or_default())
            {
                w.chunk(fresh(chunk.summary), bytes, content)?;
            }
        }
    }
    w.close()?;
    Ok(report)
}
