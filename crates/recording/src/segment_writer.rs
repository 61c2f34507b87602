//! Writes one segment. No clock and no thread in it: times are handed in, and `writer.rs` runs it on a thread of its own.
//!
//! Nothing of a pose reaches the file before its end; then chunk, message indexes and seal go out and are made durable
//! together. If that fails the file is cut back to the seal before, so what is in the file is always whole.

use std::path::{Path, PathBuf};

use gonio_instrument::Pose;
use prost::Message as _;

use crate::RecordingError;
use crate::chunk_builder::ChunkBuilder;
use crate::encode::{self, AttachmentSummary, ChunkSummary};
use crate::header::Attachment;
use crate::layout::{FORMAT, MAGIC, Topic, op};
use crate::medium::Medium;
use crate::message::{FrameInfo, Log, PoseInfo, RawImage, Timestamp, pose_state};
use crate::seal::{Kind, Seal};

/// The pose being recorded.
#[derive(Clone, Copy, Debug)]
struct OpenPose {
    index: u32,
    commanded: Pose,
    readback: Pose,
    frames: u32,
}

/// State that a failed write goes back to.
#[derive(Clone)]
struct Mark {
    position: u64,
    data_crc: crc32fast::Hasher,
}

/// What a whole chunk contains, for its seal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Content {
    pub kind: Kind,
    pub pose: u32,
    pub frames: u32,
    pub commanded: Pose,
}

impl Content {
    /// A chunk without a whole pose.
    pub(crate) fn other() -> Self {
        Self { kind: Kind::Other, pose: 0, frames: 0, commanded: Pose::default() }
    }
}

/// The writer of one file.
pub(crate) struct SegmentWriter {
    medium: Box<dyn Medium>,
    path: PathBuf,
    position: u64,
    data_crc: crc32fast::Hasher,
    /// CRC of what follows the last seal.
    open_crc: crc32fast::Hasher,
    /// End of the last seal.
    sealed: Mark,
    definitions: Vec<u8>,
    chunk: Option<ChunkBuilder>,
    chunk_capacity: usize,
    pose: Option<OpenPose>,
    sequence: u32,
    chunks: Vec<ChunkSummary>,
    attachments: Vec<AttachmentSummary>,
}

impl SegmentWriter {
    fn bare(medium: Box<dyn Medium>, path: &Path) -> Self {
        Self {
            medium,
            path: path.to_owned(),
            position: 0,
            data_crc: crc32fast::Hasher::new(),
            open_crc: crc32fast::Hasher::new(),
            sealed: Mark { position: 0, data_crc: crc32fast::Hasher::new() },
            definitions: crate::definitions::definitions(),
            chunk: None,
            chunk_capacity: 0,
            pose: None,
            sequence: 0,
            chunks: Vec::new(),
            attachments: Vec::new(),
        }
    }

    /// Begins a file: header, attachments, seal; durable on return.
    pub(crate) fn create(
        medium: Box<dyn Medium>,
        path: &Path,
        attachments: &[Attachment],
        time: u64,
    ) -> Result<Self, RecordingError> {
        let mut w = Self::bare(medium, path);
        let mut head = MAGIC.to_vec();
        encode::header(&mut head, FORMAT, concat!("gonio-recording ", env!("CARGO_PKG_VERSION")));
        for a in attachments {
            let offset = head.len() as u64;
            encode::attachment(&mut head, &a.name, &a.media_type, &a.data, time);
            w.attachments.push(AttachmentSummary {
                offset,
                length: head.len() as u64 - offset,
                time,
                size: a.data.len() as u64,
                name: a.name.clone(),
                media_type: a.media_type.clone(),
            });
        }
        w.write_sealed(&[&head], Content { kind: Kind::Head, ..Content::other() }, None)?;
        Ok(w)
    }

    /// Goes on with a file whose first `position` bytes are whole and end with a seal; what follows is cut off.
    pub(crate) fn reopen(
        medium: Box<dyn Medium>,
        path: &Path,
        position: u64,
        data_crc: crc32fast::Hasher,
        chunks: Vec<ChunkSummary>,
        attachments: Vec<AttachmentSummary>,
    ) -> Result<Self, RecordingError> {
        let mut w = Self::bare(medium, path);
        w.position = position;
        w.sealed = Mark { position, data_crc: data_crc.clone() };
        w.data_crc = data_crc;
        w.chunks = chunks;
        w.attachments = attachments;
        w.medium.cut(position).map_err(|e| RecordingError::io("cut", path, position, &e))?;
        Ok(w)
    }

    /// Bytes that are whole and durable.
    pub(crate) const fn sealed_bytes(&self) -> u64 {
        self.sealed.position
    }

    fn io(&self, e: &std::io::Error) -> RecordingError {
        RecordingError::io("write", &self.path, self.sealed.position, e)
    }

    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.medium.append(bytes)?;
        self.data_crc.update(bytes);
        self.open_crc.update(bytes);
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Writes the parts and a seal over them, durable on return; on failure the file is as it was before.
    fn write_sealed(
        &mut self,
        parts: &[&[u8]],
        content: Content,
        chunk: Option<&ChunkSummary>,
    ) -> Result<(), RecordingError> {
        let result = self.try_write_sealed(parts, content, chunk);
        if let Err(e) = result {
            let error = self.io(&e);
            self.position = self.sealed.position;
            self.data_crc = self.sealed.data_crc.clone();
            self.open_crc = crc32fast::Hasher::new();
            // if even this fails the seals still tell a reader where whole data end
            let _ = self.medium.cut(self.sealed.position);
            return Err(error);
        }
        Ok(())
    }

    fn try_write_sealed(
        &mut self,
        parts: &[&[u8]],
        content: Content,
        chunk: Option<&ChunkSummary>,
    ) -> std::io::Result<()> {
        for part in parts {
            self.append(part)?;
        }
        let seal = Seal {
            kind: content.kind,
            pose: content.pose,
            frames: content.frames,
            offset: self.position,
            covered_from: self.sealed.position,
            chunk_offset: chunk.map_or(0, |c| c.offset),
            chunk_length: chunk.map_or(0, |c| c.length),
            commanded_radians: [content.commanded.tilt.radians(), content.commanded.spin.radians()],
            first_time: chunk.map_or(0, |c| c.first_time),
            last_time: chunk.map_or(0, |c| c.last_time),
            covered_crc: self.open_crc.clone().finalize(),
        };
        let mut record = Vec::new();
        encode::record(&mut record, op::SEAL, |b| b.extend_from_slice(&seal.encode()));
        self.append(&record)?;
        self.medium.sync()?;
        self.sealed = Mark { position: self.position, data_crc: self.data_crc.clone() };
        self.open_crc = crc32fast::Hasher::new();
        Ok(())
    }

    /// Writes a chunk that is already compressed, with its message indexes and seal.
    pub(crate) fn chunk(
        &mut self,
        mut summary: ChunkSummary,
        compressed: &[u8],
        content: Content,
    ) -> Result<(), RecordingError> {
        let head = encode::chunk_head(&summary);
        summary.offset = self.position;
        summary.length = (head.len() + compressed.len()) as u64;
        let mut indexes = Vec::new();
        let indexes_at = self.position + summary.length;
        encode::message_indexes(&mut indexes, &mut summary, indexes_at);
        self.write_sealed(&[&head, compressed, &indexes], content, Some(&summary))?;
        self.chunks.push(summary);
        Ok(())
    }

    fn open_chunk(&mut self) -> Result<&mut ChunkBuilder, RecordingError> {
        let chunk = match self.chunk.take() {
            Some(c) => c,
            None => ChunkBuilder::new(&self.definitions, self.chunk_capacity)
                .map_err(|e| RecordingError::io("compress", &self.path, self.sealed.position, &e))?,
        };
        Ok(self.chunk.insert(chunk))
    }

    /// Adds a message to the chunk of the pose that is open or comes next.
    pub(crate) fn message(&mut self, topic: Topic, time: u64, payload: &[u8]) -> Result<(), RecordingError> {
        let sequence = self.sequence;
        let (path, sealed) = (self.path.clone(), self.sealed.position);
        self.open_chunk()?
            .message(topic, sequence, time, payload)
            .map_err(|e| RecordingError::io("compress", &path, sealed, &e))?;
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }

    /// Begins a pose.
    pub(crate) fn begin_pose(
        &mut self,
        time: u64,
        index: u32,
        commanded: Pose,
        readback: Pose,
    ) -> Result<(), RecordingError> {
        let info = PoseInfo::new(index, pose_state::BEGUN, commanded, readback, 0);
        self.message(Topic::Pose, time, &info.encode_to_vec())?;
        self.pose = Some(OpenPose { index, commanded, readback, frames: 0 });
        Ok(())
    }

    /// Adds a frame: `data` are its pixels, 16 bits each, little-endian; `info` is completed with pose and digest.
    pub(crate) fn frame(
        &mut self,
        time: u64,
        data: Vec<u8>,
        mut info: FrameInfo,
    ) -> Result<(), RecordingError> {
        let Some(pose) = &mut self.pose else {
            return Err(RecordingError::Order { call: "record a frame", state: "outside a pose" });
        };
        if self.chunk.as_ref().is_some_and(|c| c.would_overflow(data.len() as u64)) {
            return Err(RecordingError::PoseTooLarge {
                index: pose.index,
                limit: crate::layout::CHUNK_LIMIT,
            });
        }
        pose.frames += 1;
        info.pose = pose.index;
        info.sha256 = crate::digest::pixels(&data).to_vec();
        let image = RawImage {
            timestamp: Some(Timestamp::from_ns(time)),
            width: info.width,
            height: info.height,
            encoding: "mono16".to_owned(),
            step: info.width.saturating_mul(2),
            data,
            frame_id: "camera".to_owned(),
        };
        self.message(Topic::Image, time, &image.encode_to_vec())?;
        self.message(Topic::Frame, time, &info.encode_to_vec())
    }

    /// Ends the pose: when this returns it is on the disk.
    pub(crate) fn end_pose(&mut self, time: u64) -> Result<(), RecordingError> {
        let Some(p) = self.pose.take() else {
            return Err(RecordingError::Order { call: "end a pose", state: "outside a pose" });
        };
        let info = PoseInfo::new(p.index, pose_state::DONE, p.commanded, p.readback, p.frames);
        self.message(Topic::Pose, time, &info.encode_to_vec())?;
        self.flush(Content { kind: Kind::Pose, pose: p.index, frames: p.frames, commanded: p.commanded })
    }

    /// Gives the open pose up: its frames stay in the file, but it does not count as done.
    pub(crate) fn give_up_pose(&mut self, time: u64) -> Result<(), RecordingError> {
        let Some(p) = self.pose.take() else { return Ok(()) };
        let info = PoseInfo::new(p.index, pose_state::GIVEN_UP, p.commanded, p.readback, p.frames);
        self.message(Topic::Pose, time, &info.encode_to_vec())?;
        self.flush(Content::other())
    }

    /// Adds an event.
    pub(crate) fn event(&mut self, time: u64, level: i32, text: &str) -> Result<(), RecordingError> {
        let log = Log {
            timestamp: Some(Timestamp::from_ns(time)),
            level,
            message: text.to_owned(),
            name: "gonio".to_owned(),
        };
        self.message(Topic::Event, time, &log.encode_to_vec())
    }

    fn flush(&mut self, content: Content) -> Result<(), RecordingError> {
        let Some(chunk) = self.chunk.take() else { return Ok(()) };
        if chunk.is_empty() {
            return Ok(());
        }
        let (summary, bytes) = chunk.finish().map_err(|e| self.io(&e))?;
        // the next pose is likely as large
        self.chunk_capacity = bytes.len().saturating_add(bytes.len() / 8);
        self.chunk(summary, &bytes, content)
    }

    /// Writes what is pending, gives an open pose up, and closes the file with its summary; durable on return.
    pub(crate) fn finish(&mut self, time: u64) -> Result<u64, RecordingError> {
        self.give_up_pose(time)?;
        self.flush(Content::other())?;
        self.close()
    }

    /// Drops what is not sealed and closes the file with its summary.
    pub(crate) fn close(&mut self) -> Result<u64, RecordingError> {
        self.chunk = None;
        self.pose = None;
        let tail = encode::tail(
            self.position,
            self.data_crc.clone().finalize(),
            &self.definitions,
            &self.chunks,
            &self.attachments,
        );
        let done = self.medium.append(&tail).and_then(|()| self.medium.sync());
        if let Err(e) = done {
            let error = self.io(&e);
            let _ = self.medium.cut(self.sealed.position);
            return Err(error);
        }
        self.position += tail.len() as u64;
        Ok(self.position)
    }
}
