//! Finds the parts of one file: attachments, chunks, seals. Reads heads only; contents are read and checked when asked for.
//!
//! The walk goes from record to record. Where a record makes no sense it goes back to the last seal and searches for the next
//! one byte by byte; each seal says where its chunk lies, so a damaged length hides nothing but itself.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

use crate::RecordingError;
use crate::bytes::Bytes;
use crate::chunk::Chunk;
use crate::layout::{ATTACHMENT_LIMIT, CHUNK_LIMIT, FOOTER_LENGTH, HEADER_LIMIT, MAGIC, RECORD_HEAD, op};
use crate::seal::{self, Kind, Seal};

/// Something that is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// The file.
    #[serde(serialize_with = "crate::paths::shown")]
    pub path: PathBuf,
    /// Where the part concerned begins.
    pub offset: u64,
    /// What is wrong.
    pub what: String,
}

/// A chunk of the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ChunkEntry {
    pub offset: u64,
    pub length: u64,
    pub seal: Option<Seal>,
}

/// One file of a session.
#[derive(Debug)]
pub(crate) struct Segment {
    pub path: PathBuf,
    file: File,
    pub length: u64,
    pub chunks: Vec<ChunkEntry>,
    pub seals: Vec<Seal>,
    /// Offset and length of the whole attachment records, in file order.
    pub attachments: Vec<(u64, u64)>,
    pub findings: Vec<Finding>,
    /// Offset of the data-end record.
    pub data_end: Option<u64>,
    /// Whether footer and magic stand at the end.
    pub finished: bool,
    /// Whether the MCAP header names our format.
    pub profile: Option<String>,
}

impl Segment {
    /// Opens a file and finds its parts.
    ///
    /// # Errors
    /// Only where the file cannot be opened or is of another kind; damage is noted in `findings`.
    pub(crate) fn open(path: &Path) -> Result<Self, RecordingError> {
        let io = |e: &std::io::Error| RecordingError::io("open", path, 0, e);
        let file = File::open(path).map_err(|e| io(&e))?;
        let meta = file.metadata().map_err(|e| io(&e))?;
        if !meta.is_file() {
            return Err(RecordingError::NotASession {
                path: path.to_owned(),
                found: "not a regular file".to_owned(),
            });
        }
        let mut s = Self {
            path: path.to_owned(),
            file,
            length: meta.len(),
            chunks: Vec::new(),
            seals: Vec::new(),
            attachments: Vec::new(),
            findings: Vec::new(),
            data_end: None,
            finished: false,
            profile: None,
        };
        s.walk()?;
        Ok(s)
    }

    pub(crate) fn finding(&self, offset: u64, what: impl Into<String>) -> Finding {
        Finding { path: self.path.clone(), offset, what: what.into() }
    }

    fn note(&mut self, offset: u64, what: impl Into<String>) {
        let f = self.finding(offset, what);
        self.findings.push(f);
    }

    /// Reads `n` bytes at `offset`; fewer only at the end of the file.
    pub(crate) fn read(&self, offset: u64, n: u64) -> Result<Vec<u8>, RecordingError> {
        let n = n.min(self.length.saturating_sub(offset));
        let mut out = vec![0; usize::try_from(n).unwrap_or(0)];
        self.file
            .read_exact_at(&mut out, offset)
            .map_err(|e| RecordingError::io("read", &self.path, 0, &e))?;
        Ok(out)
    }

    /// CRC-32 of the bytes `from..to`.
    pub(crate) fn crc(&self, from: u64, to: u64) -> Result<crc32fast::Hasher, RecordingError> {
        let mut crc = crc32fast::Hasher::new();
        let mut at = from;
        while at < to {
            let block = self.read(at, (to - at).min(1 << 20))?;
            if block.is_empty() {
                break;
            }
            crc.update(&block);
            at += block.len() as u64;
        }
        Ok(crc)
    }

    /// Reads and checks a chunk.
    pub(crate) fn chunk(&self, entry: &ChunkEntry) -> Result<Chunk, RecordingError> {
        let damaged =
            |what: String| RecordingError::Damaged { path: self.path.clone(), offset: entry.offset, what };
        let bytes = self.chunk_record(entry)?;
        Chunk::read(bytes.get(RECORD_HEAD as usize..).unwrap_or_default()).map_err(damaged)
    }

    /// The bytes of a chunk's record, unchecked.
    pub(crate) fn chunk_record(&self, entry: &ChunkEntry) -> Result<Vec<u8>, RecordingError> {
        // compressed noise may grow a little
        if entry.length > CHUNK_LIMIT + (CHUNK_LIMIT >> 4) {
            return Err(RecordingError::Damaged {
                path: self.path.clone(),
                offset: entry.offset,
                what: format!("a chunk of {} bytes is never written", entry.length),
            });
        }
        self.read(entry.offset, entry.length)
    }

    fn walk(&mut self) -> Result<(), RecordingError> {
        let mut magic_is_damaged = false;
        if self.read(0, 8)? != MAGIC {
            // one flipped bit in the magic must not lose a session: its first seal decides
            if self.next_seal(8)?.is_none() {
                return Err(RecordingError::NotASession {
                    path: self.path.clone(),
                    found: if self.length == 0 { "an empty file" } else { "no MCAP file" }.to_owned(),
                });
            }
            magic_is_damaged = true;
        }
        if magic_is_damaged {
            self.note(0, "the first eight bytes are not those of an MCAP file");
        }
        let mut at = 8;
        // chunks seen since the last seal: if the seal itself is damaged they are all that is known
        let mut unsealed: Vec<ChunkEntry> = Vec::new();
        // where the bytes covered by the next seal begin
        let mut last_seal_end = 0;
        while at < self.length {
            match self.step(at)? {
                Step::Chunk(entry) => {
                    at = entry.offset + entry.length;
                    unsealed.push(entry);
                }
                Step::Skip(next) => at = next,
                Step::Attachment(next) => {
                    self.attachments.push((at, next - at));
                    at = next;
                }
                Step::Seal(mut seal) => {
                    if seal.covered_from > last_seal_end {
                        // a seal before this one was stepped over, or is damaged
                        seal = self.next_seal(last_seal_end.max(8))?.unwrap_or(seal);
                    }
                    at = seal.end();
                    last_seal_end = at;
                    self.take_seal(seal, &mut unsealed);
                }
                Step::DataEnd => {
                    self.data_end = Some(at);
                    break;
                }
                Step::Nonsense(what) => {
                    let truncated = self.length - at;
                    match self.next_seal(last_seal_end.max(8))? {
                        Some(seal) => {
                            self.note(at, what);
                            at = seal.end();
                            last_seal_end = at;
                            self.take_seal(seal, &mut unsealed);
                        }
                        None => {
                            self.note(
                                at,
                                format!("{what}; nothing can be found in the last {truncated} bytes"),
                            );
                            break;
                        }
                    }
                }
            }
        }
        self.chunks.append(&mut unsealed);
        self.chunks.sort_by_key(|c| c.offset);
        self.chunks.dedup_by_key(|c| c.offset);
        self.find_end()
    }

    /// Takes a seal and the chunk it names; other chunks seen since the last seal stay without one.
    fn take_seal(&mut self, seal: Seal, unsealed: &mut Vec<ChunkEntry>) {
        if seal.kind != Kind::Head {
            // a chunk with a damaged length may overlap what the seal knows better
            let end = seal.chunk_offset + seal.chunk_length;
            unsealed.retain(|c| c.offset + c.length <= seal.chunk_offset && c.offset < end);
            self.chunks.push(ChunkEntry {
                offset: seal.chunk_offset,
                length: seal.chunk_length,
                seal: Some(seal.clone()),
            });
        }
        self.chunks.append(unsealed);
        self.seals.push(seal);
    }

    fn step(&mut self, at: u64) -> Result<Step, RecordingError> {
        let head = self.read(at, RECORD_HEAD)?;
        let mut b = Bytes::new(&head);
        let (Some(opcode), Some(length)) = (b.u8(), b.u64()) else {
            return Ok(Step::Nonsense("the file ends inside a record".to_owned()));
        };
        let Some(end) = at.checked_add(RECORD_HEAD).and_then(|a| a.checked_add(length)) else {
            return Ok(Step::Nonsense(format!("a record claims {length} bytes")));
        };
        let known = matches!(
            opcode,
            op::HEADER | op::ATTACHMENT | op::CHUNK | op::MESSAGE_INDEX | op::SEAL | op::DATA_END
        );
        if !known {
            return Ok(Step::Nonsense(format!("a record of unknown kind 0x{opcode:02x}")));
        }
        if end > self.length {
            return Ok(Step::Nonsense(format!(
                "a record of {length} bytes runs past the end of the file ({} bytes)",
                self.length
            )));
        }
        Ok(match opcode {
            op::HEADER if at == 8 && length <= HEADER_LIMIT => {
                let body = self.read(at + RECORD_HEAD, length)?;
                self.profile = Bytes::new(&body).string().map(str::to_owned);
                Step::Skip(end)
            }
            op::ATTACHMENT if length <= ATTACHMENT_LIMIT => Step::Attachment(end),
            op::CHUNK => Step::Chunk(ChunkEntry { offset: at, length: end - at, seal: None }),
            op::MESSAGE_INDEX => Step::Skip(end),
            op::SEAL if length == seal::BODY => {
                let body = self.read(at + RECORD_HEAD, length)?;
                match Seal::decode(&body, at) {
                    Some(s) => Step::Seal(s),
                    None => {
                        self.note(at, "a seal is damaged");
                        Step::Skip(end)
                    }
                }
            }
            op::DATA_END if length == 4 => Step::DataEnd,
            _ => Step::Nonsense(format!("a record of kind 0x{opcode:02x} with {length} bytes")),
        })
    }

    /// The first valid seal at or after `from`.
    fn next_seal(&self, from: u64) -> Result<Option<Seal>, RecordingError> {
        const BLOCK: u64 = 1 << 20;
        let first = seal::MARK.first().copied().unwrap_or_default();
        let mut at = from;
        while at < self.length {
            // blocks overlap by a seal, so that none is cut in two
            let block = self.read(at, BLOCK + RECORD_HEAD + seal::BODY)?;
            let mut i = 0;
            while let Some(hit) = block.get(i..).and_then(|b| b.iter().position(|&c| c == first)) {
                let body_at = i + hit;
                i = body_at + 1;
                let Some(record_at) = (at + body_at as u64).checked_sub(RECORD_HEAD) else { continue };
                if record_at < from {
                    continue;
                }
                if let Some(s) = block
                    .get(body_at..body_at + seal::BODY as usize)
                    .and_then(|body| Seal::decode(body, record_at))
                {
                    return Ok(Some(s));
                }
            }
            if at + block.len() as u64 >= self.length {
                break;
            }
            at += BLOCK;
        }
        Ok(None)
    }

    fn find_end(&mut self) -> Result<(), RecordingError> {
        let (Some(footer_at), Some(data_end)) = (self.length.checked_sub(FOOTER_LENGTH + 8), self.data_end)
        else {
            return Ok(());
        };
        let tail = self.read(footer_at, FOOTER_LENGTH + 8)?;
        let mut b = Bytes::new(&tail);
        let is_footer = b.record().is_some_and(|(o, body)| o == op::FOOTER && body.len() == 20);
        self.finished = is_footer && b.rest() == MAGIC;
        if self.finished {
            // a damaged length among the attachments hides those behind it; the summary knows them too
            let from = data_end + RECORD_HEAD + 4;
            let summary = self.read(from, footer_at.saturating_sub(from))?;
            let mut b = Bytes::new(&summary);
            while let Some((opcode, body)) = b.record() {
                let mut i = Bytes::new(body);
                if opcode == op::ATTACHMENT_INDEX
                    && let (Some(offset), Some(length)) = (i.u64(), i.u64())
                    && length <= ATTACHMENT_LIMIT
                    && offset.checked_add(length).is_some_and(|end| end <= data_end)
                    && !self.attachments.contains(&(offset, length))
                {
                    self.attachments.push((offset, length));
                }
            }
        }
        Ok(())
    }

    /// End of the last seal: up to here everything is known to have been durable.
    pub(crate) fn sealed_end(&self) -> u64 {
        self.seals.iter().map(Seal::end).max().unwrap_or(0)
    }

    /// The attachments whose CRC holds, by name; the others as findings.
    pub(crate) fn read_attachments(
        &self,
    ) -> Result<(BTreeMap<String, ReadAttachment>, Vec<Finding>), RecordingError> {
        let (mut good, mut bad) = (BTreeMap::new(), Vec::new());
        for &(offset, length) in &self.attachments {
            let record = self.read(offset, length)?;
            match parse_attachment(record.get(RECORD_HEAD as usize..).unwrap_or_default()) {
                Some((name, mut a)) => {
                    (a.offset, a.length) = (offset, length);
                    good.insert(name, a);
                }
                None => bad.push(self.finding(offset, "an attachment does not match its CRC")),
            }
        }
        Ok((good, bad))
    }
}

/// An attachment whose CRC holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReadAttachment {
    pub media_type: String,
    pub data: Vec<u8>,
    pub time: u64,
    pub offset: u64,
    pub length: u64,
}

fn parse_attachment(body: &[u8]) -> Option<(String, ReadAttachment)> {
    let (checked, crc) = body.split_at_checked(body.len().checked_sub(4)?)?;
    if Bytes::new(crc).u32()? != crc32fast::hash(checked) {
        return None;
    }
    let mut b = Bytes::new(checked);
    let time = b.u64()?;
    b.u64()?;
    let name = b.string()?.to_owned();
    let media_type = b.string()?.to_owned();
    let n = b.u64()?;
    let data = b.take(n)?.to_owned();
    b.is_empty().then_some((name, ReadAttachment { media_type, data, time, offset: 0, length: 0 }))
}

/// What stands at a place of the file.
enum Step {
    Chunk(ChunkEntry),
    Attachment(u64),
    Seal(Seal),
    Skip(u64),
    DataEnd,
    Nonsense(String),
}
