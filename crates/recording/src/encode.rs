//! MCAP records as bytes. Each function appends one whole record; field order is that of the MCAP specification.

use std::collections::BTreeMap;

use crate::layout::op;

fn string(out: &mut Vec<u8>, s: &str) {
    out.extend_from_slice(&(s.len() as u32).to_le_bytes());
    out.extend_from_slice(s.as_bytes());
}

fn u16(out: &mut Vec<u8>, v: u16) {
    out.extend_from_slice(&v.to_le_bytes());
}

fn u32(out: &mut Vec<u8>, v: u32) {
    out.extend_from_slice(&v.to_le_bytes());
}

fn u64(out: &mut Vec<u8>, v: u64) {
    out.extend_from_slice(&v.to_le_bytes());
}

/// Writes opcode and length around what `body` appends.
pub(crate) fn record(out: &mut Vec<u8>, opcode: u8, body: impl FnOnce(&mut Vec<u8>)) {
    out.push(opcode);
    let at = out.len();
    u64(out, 0);
    body(out);
    let length = (out.len() - at - 8) as u64;
    if let Some(place) = out.get_mut(at..at + 8) {
        place.copy_from_slice(&length.to_le_bytes());
    }
}

pub(crate) fn header(out: &mut Vec<u8>, profile: &str, library: &str) {
    record(out, op::HEADER, |b| {
        string(b, profile);
        string(b, library);
    });
}

pub(crate) fn schema(out: &mut Vec<u8>, id: u16, name: &str, encoding: &str, data: &[u8]) {
    record(out, op::SCHEMA, |b| {
        u16(b, id);
        string(b, name);
        string(b, encoding);
        u32(b, data.len() as u32);
        b.extend_from_slice(data);
    });
}

pub(crate) fn channel(out: &mut Vec<u8>, id: u16, schema: u16, topic: &str, encoding: &str) {
    record(out, op::CHANNEL, |b| {
        u16(b, id);
        u16(b, schema);
        string(b, topic);
        string(b, encoding);
        u32(b, 0); // no metadata
    });
}

/// Head of a message record whose payload of `payload` bytes follows.
pub(crate) fn message_head(channel: u16, sequence: u32, time: u64, payload: u64) -> Vec<u8> {
    let mut b = Vec::with_capacity(31);
    b.push(op::MESSAGE);
    u64(&mut b, 22 + payload);
    u16(&mut b, channel);
    u32(&mut b, sequence);
    u64(&mut b, time);
    u64(&mut b, time);
    b
}

/// What a chunk index says of its chunk; also the fields of the chunk's own head.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ChunkSummary {
    pub first_time: u64,
    pub last_time: u64,
    pub offset: u64,
    pub length: u64,
    pub uncompressed: u64,
    pub uncompressed_crc: u32,
    pub compression: String,
    pub compressed: u64,
    /// Messages by channel: log time and offset inside the uncompressed chunk.
    pub messages: BTreeMap<u16, Vec<(u64, u64)>>,
    /// Where the message index of each channel stands.
    pub index_offsets: BTreeMap<u16, u64>,
    pub index_length: u64,
}

/// Opcode, length and head of a chunk record; the compressed bytes follow.
pub(crate) fn chunk_head(c: &ChunkSummary) -> Vec<u8> {
    let mut b = Vec::with_capacity(64);
    b.push(op::CHUNK);
    u64(&mut b, 8 + 8 + 8 + 4 + 4 + c.compression.len() as u64 + 8 + c.compressed);
    u64(&mut b, c.first_time);
    u64(&mut b, c.last_time);
    u64(&mut b, c.uncompressed);
    u32(&mut b, c.uncompressed_crc);
    string(&mut b, &c.compression);
    u64(&mut b, c.compressed);
    b
}

/// The message index records of a chunk, to stand at file offset `at`; notes where each stands.
pub(crate) fn message_indexes(out: &mut Vec<u8>, c: &mut ChunkSummary, at: u64) {
    let start = out.len() as u64;
    for (&id, entries) in &c.messages {
        c.index_offsets.insert(id, at + out.len() as u64 - start);
        record(out, op::MESSAGE_INDEX, |b| {
            u16(b, id);
            u32(b, (entries.len() * 16) as u32);
            for &(time, offset) in entries {
                u64(b, time);
                u64(b, offset);
            }
        });
    }
    c.index_length = out.len() as u64 - start;
}

fn chunk_index(out: &mut Vec<u8>, c: &ChunkSummary) {
    record(out, op::CHUNK_INDEX, |b| {
        u64(b, c.first_time);
        u64(b, c.last_time);
        u64(b, c.offset);
        u64(b, c.length);
        u32(b, (c.index_offsets.len() * 10) as u32);
        for (&id, &at) in &c.index_offsets {
            u16(b, id);
            u64(b, at);
        }
        u64(b, c.index_length);
        string(b, &c.compression);
        u64(b, c.compressed);
        u64(b, c.uncompressed);
    });
}

/// What an attachment index says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AttachmentSummary {
    pub offset: u64,
    pub length: u64,
    pub time: u64,
    pub size: u64,
    pub name: String,
    pub media_type: String,
}

/// An attachment record with its CRC over every field before it.
pub(crate) fn attachment(out: &mut Vec<u8>, name: &str, media_type: &str, data: &[u8], time: u64) {
    record(out, op::ATTACHMENT, |b| {
        let start = b.len();
        u64(b, time);
        u64(b, time);
        string(b, name);
        string(b, media_type);
        u64(b, data.len() as u64);
        b.extend_from_slice(data);
        let crc = crc32fast::hash(b.get(start..).unwrap_or_default());
        u32(b, crc);
    });
}

fn attachment_index(out: &mut Vec<u8>, a: &AttachmentSummary) {
    record(out, op::ATTACHMENT_INDEX, |b| {
        u64(b, a.offset);
        u64(b, a.length);
        u64(b, a.time);
        u64(b, a.time);
        u64(b, a.size);
        string(b, &a.name);
        string(b, &a.media_type);
    });
}

/// The end of a file: data end, summary, summary offsets, footer, magic. `at` is the file offset where it will stand.
pub(crate) fn tail(
    at: u64,
    data_crc: u32,
    definitions: &[u8],
    chunks: &[ChunkSummary],
    attachments: &[AttachmentSummary],
) -> Vec<u8> {
    let mut out = Vec::new();
    record(&mut out, op::DATA_END, |b| u32(b, data_crc));
    let summary_start = out.len();
    let mut groups = Vec::new();
    // schemas and channels are kept as two runs of records, schemas first
    let mut group = |out: &mut Vec<u8>, opcode: u8, write: &mut dyn FnMut(&mut Vec<u8>)| {
        let start = out.len();
        write(out);
        if out.len() > start {
            groups.push((opcode, at + start as u64, (out.len() - start) as u64));
        }
    };
    let schemas = crate::definitions::schemas_length(definitions);
    let (schemas, channels) = definitions.split_at(schemas);
    group(&mut out, op::SCHEMA, &mut |o| o.extend_from_slice(schemas));
    group(&mut out, op::CHANNEL, &mut |o| o.extend_from_slice(channels));
    group(&mut out, op::STATISTICS, &mut |o| statistics(o, chunks, attachments.len()));
    group(&mut out, op::CHUNK_INDEX, &mut |o| chunks.iter().for_each(|c| chunk_index(o, c)));
    group(&mut out, op::ATTACHMENT_INDEX, &mut |o| attachments.iter().for_each(|a| attachment_index(o, a)));
    let offsets_start = out.len();
    for (opcode, start, length) in groups {
        record(&mut out, op::SUMMARY_OFFSET, |b| {
            b.push(opcode);
            u64(b, start);
            u64(b, length);
        });
    }
    // the summary CRC covers everything from the summary's start to the footer's last field but one
    let mut footer = Vec::new();
    record(&mut footer, op::FOOTER, |b| {
        u64(b, at + summary_start as u64);
        u64(b, at + offsets_start as u64);
        u32(b, 0);
    });
    footer.truncate(footer.len() - 4);
    out.extend_from_slice(&footer);
    let crc = crc32fast::hash(out.get(summary_start..).unwrap_or_default());
    u32(&mut out, crc);
    out.extend_from_slice(&crate::layout::MAGIC);
    out
}

fn statistics(out: &mut Vec<u8>, chunks: &[ChunkSummary], attachments: usize) {
    let mut counts: BTreeMap<u16, u64> = BTreeMap::new();
    for (&id, entries) in chunks.iter().flat_map(|c| &c.messages) {
        *counts.entry(id).or_default() += entries.len() as u64;
    }
    let topics = crate::layout::Topic::ALL.len();
    record(out, op::STATISTICS, |b| {
        u64(b, counts.values().sum());
        u16(b, topics as u16);
        u32(b, topics as u32);
        u32(b, attachments as u32);
        u32(b, 0);
        u32(b, chunks.len() as u32);
        u64(b, chunks.iter().map(|c| c.first_time).min().unwrap_or(0));
        u64(b, chunks.iter().map(|c| c.last_time).max().unwrap_or(0));
        u32(b, (counts.len() * 10) as u32);
        for (&id, &n) in &counts {
            u16(b, id);
            u64(b, n);
        }
    });
}
