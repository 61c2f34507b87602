//! One chunk in the making: messages are compressed as they come, and the whole record is written at once.

use std::io::Write as _;

use crate::encode::{self, ChunkSummary};
use crate::layout::{CHUNK_LIMIT, COMPRESSION, COMPRESSION_LEVEL, Topic};

/// Compresses the messages of one pose.
pub(crate) struct ChunkBuilder {
    compressor: zstd::stream::write::Encoder<'static, Vec<u8>>,
    crc: crc32fast::Hasher,
    summary: ChunkSummary,
}

impl ChunkBuilder {
    /// An empty chunk that begins with the schema and channel records.
    pub(crate) fn new(definitions: &[u8], capacity: usize) -> std::io::Result<Self> {
        let mut chunk = Self {
            compressor: zstd::stream::write::Encoder::new(Vec::with_capacity(capacity), COMPRESSION_LEVEL)?,
            crc: crc32fast::Hasher::new(),
            summary: ChunkSummary {
                first_time: u64::MAX,
                compression: COMPRESSION.to_owned(),
                ..ChunkSummary::default()
            },
        };
        chunk.put(definitions)?;
        Ok(chunk)
    }

    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.crc.update(bytes);
        self.summary.uncompressed += bytes.len() as u64;
        self.compressor.write_all(bytes)
    }

    /// Whether `bytes` more would pass the limit.
    pub(crate) const fn would_overflow(&self, bytes: u64) -> bool {
        self.summary.uncompressed.saturating_add(bytes).saturating_add(1024) > CHUNK_LIMIT
    }

    /// Whether it holds no message.
    pub(crate) fn is_empty(&self) -> bool {
        self.summary.messages.is_empty()
    }

    /// Adds a message.
    pub(crate) fn message(
        &mut self,
        topic: Topic,
        sequence: u32,
        time: u64,
        payload: &[u8],
    ) -> std::io::Result<()> {
        let offset = self.summary.uncompressed;
        self.put(&encode::message_head(topic.id(), sequence, time, payload.len() as u64))?;
        self.put(payload)?;
        self.summary.messages.entry(topic.id()).or_default().push((time, offset));
        self.summary.first_time = self.summary.first_time.min(time);
        self.summary.last_time = self.summary.last_time.max(time);
        Ok(())
    }

    /// The compressed bytes and what is known of them; offset and length are the writer's to fill in.
    pub(crate) fn finish(self) -> std::io::Result<(ChunkSummary, Vec<u8>)> {
        let bytes = self.compressor.finish()?;
        let mut summary = self.summary;
        summary.uncompressed_crc = self.crc.finalize();
        summary.compressed = bytes.len() as u64;
        if summary.messages.is_empty() {
            summary.first_time = 0;
        }
        Ok((summary, bytes))
    }
}
