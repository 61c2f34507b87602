//! Goes on with a session that was stopped or broke off: says which poses are done, finishes what was left open, begins the next segment.

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::path::Path;

use crate::RecordingError;
use crate::bytes::Bytes;
use crate::chunk;
use crate::encode::{AttachmentSummary, ChunkSummary};
use crate::header::{Header, SessionRecord};
use crate::layout::{RECORD_HEAD, op};
use crate::paths::continuations;
use crate::seal::Kind;
use crate::segment::{ChunkEntry, Segment};
use crate::segment_writer::{Content, SegmentWriter};
use crate::session::Session;
use crate::writer::{Clock, Writer, WriterOptions};

/// How far a session has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Poses that are whole, checked to the last pixel.
    pub done: BTreeSet<u32>,
    /// Poses that were recorded and are damaged: to be taken again.
    pub damaged: BTreeSet<u32>,
    /// Poses in the plan, where it is known.
    pub planned: Option<u32>,
}

impl Progress {
    /// Whether nothing is left to do.
    #[must_use]
    pub fn complete(&self) -> bool {
        self.planned.is_some_and(|n| (0..n).all(|i| self.done.contains(&i)))
    }
}

/// Reads a whole session and says which poses are done.
///
/// # Errors
/// As [`Session::open`].
pub fn progress(path: &Path) -> Result<Progress, RecordingError> {
    Ok(progress_of(&Session::open(path)?))
}

fn progress_of(session: &Session) -> Progress {
    let (done, damaged) = session.pose_indices().partition(|&i| session.pose(i).is_ok());
    Progress { done, damaged, planned: session.record().map(|r| r.planned) }
}

/// Continues the session `first`: checks that it is the same scan, finishes a file that broke off, and creates the next segment.
/// The caller takes the poses that are not in [`Progress::done`].
///
/// # Errors
/// [`RecordingError::Mismatch`] where instrument, plan or kind of scan differ, [`RecordingError::InUse`] while another
/// program writes it; those of [`Session::open`] and [`Writer::create`].
pub fn resume(first: &Path, header: &Header, clock: Clock) -> Result<(Writer, Progress), RecordingError> {
    resume_with(first, header, WriterOptions { clock, ..WriterOptions::default() })
}

/// [`resume`] with the options of the new segment; nothing is ever overwritten.
///
/// # Errors
/// As [`resume`].
pub fn resume_with(
    first: &Path,
    header: &Header,
    mut options: WriterOptions,
) -> Result<(Writer, Progress), RecordingError> {
    let session = Session::open(first)?;
    let mismatch = |what| RecordingError::Mismatch { path: first.to_owned(), what };
    // a part that is lost cannot contradict
    if session.instrument().is_ok_and(|i| i != header.instrument) {
        return Err(mismatch("instrument"));
    }
    if session.plan().is_ok_and(|p| p != header.plan) {
        return Err(mismatch("plan"));
    }
    if session.sample().is_ok_and(|s| s.kind != header.sample.kind) {
        return Err(mismatch("kind of scan"));
    }
    let progress = progress_of(&session);
    for segment in session.segments.iter().filter(|s| !s.finished) {
        finish_in_place(segment)?;
    }
    let number = continuations(first).last().copied().unwrap_or(1) + 1;
    let mut record = SessionRecord::new(header, number, options.clock.time())?;
    if let Some(r) = session.record() {
        record.id.clone_from(&r.id);
    }
    let writer = Writer::create_segment(first, header, &record, options)?;
    Ok((writer, progress))
}

/// Closes a file that broke off: cuts it behind the last seal, seals whole chunks that had none, writes the summary.
fn finish_in_place(segment: &Segment) -> Result<(), RecordingError> {
    let io = |e: &std::io::Error| RecordingError::io("write", &segment.path, 0, e);
    let file = OpenOptions::new().read(true).write(true).open(&segment.path).map_err(|e| io(&e))?;
    crate::writer::lock(&file, &segment.path)?;
    let end = segment.sealed_end();
    if end == 0 {
        // without a seal nothing says what is whole: leave it for `recover`
        return Ok(());
    }
    let (mut kept, mut unsealed) = (Vec::new(), Vec::new());
    for entry in &segment.chunks {
        // a damaged chunk stays in the file, but the summary does not lead readers to it
        let Ok(chunk) = segment.chunk(entry) else { continue };
        if entry.offset < end {
            kept.push(summary_in_place(segment, entry, chunk.summary)?);
        } else {
            unsealed.push((entry, chunk.pose().ok().flatten(), chunk.summary));
        }
    }
    let mut tail = Vec::new();
    for (entry, pose, summary) in unsealed {
        let content = pose.map_or_else(Content::other, |p| Content {
            kind: Kind::Pose,
            pose: p.record.index,
            frames: p.record.exposures.len() as u32,
            commanded: p.record.commanded,
        });
        tail.push((segment.chunk_record(entry)?, summary, content));
    }
    let (attachments, _) = segment.read_attachments()?;
    let attachments = attachments.into_iter().map(|(name, a)| AttachmentSummary {
        offset: a.offset,
        length: a.length,
        time: a.time,
        size: a.data.len() as u64,
        name,
        media_type: a.media_type,
    });
    let crc = segment.crc(0, end)?;
    let mut w = SegmentWriter::reopen(Box::new(file), &segment.path, end, crc, kept, attachments.collect())?;
    for (record, summary, content) in tail {
        if let Some((_, bytes)) = chunk::parse_head(record.get(RECORD_HEAD as usize..).unwrap_or_default()) {
            w.chunk(fresh(summary), bytes, content)?;
        }
    }
    w.close().map(|_| ())
}

/// A summary as the writer wants it: places are its own to fill in.
pub(crate) fn fresh(mut s: ChunkSummary) -> ChunkSummary {
    (s.offset, s.length, s.index_length) = (0, 0, 0);
    s.index_offsets.clear();
    s
}

/// Completes a summary with the places of chunk and message indexes as they stand in the file.
fn summary_in_place(
    segment: &Segment,
    entry: &ChunkEntry,
    mut s: ChunkSummary,
) -> Result<ChunkSummary, RecordingError> {
    (s.offset, s.length) = (entry.offset, entry.length);
    let start = entry.offset + entry.length;
    let end = entry.seal.as_ref().map_or(start, |seal| seal.offset);
    let bytes = segment.read(start, end.saturating_sub(start))?;
    let mut b = Bytes::new(&bytes);
    while !b.is_empty() {
        let at = start + (bytes.len() - b.rest().len()) as u64;
        let id = match b.record() {
            Some((op::MESSAGE_INDEX, body)) => Bytes::new(body).u16(),
            _ => None,
        };
        let Some(id) = id else {
            // damaged: readers find the messages without an index
            s.index_offsets.clear();
            s.index_length = 0;
            return Ok(s);
        };
        s.index_offsets.insert(id, at);
    }
    s.index_length = bytes.len() as u64;
    Ok(s)
}
