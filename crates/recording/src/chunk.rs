//! Reads a chunk whole: decompress, check the CRC, check every frame's digest; only then does anything leave this file.

use std::io::Read as _;
use std::ops::Range;
use std::time::Duration;

use gonio_instrument::{Exposure, Frame, PoseRecord};

use crate::bytes::Bytes;
use crate::digest;
use crate::encode::ChunkSummary;
use crate::layout::{CHUNK_LIMIT, COMPRESSION, RECORD_HEAD, Topic, op};
use crate::message::{FrameInfo, PoseInfo, RawImage, pose_state};

/// A message of a chunk.
#[derive(Clone, Debug)]
pub(crate) struct MessageAt {
    pub topic: Option<Topic>,
    pub sequence: u32,
    pub time: u64,
    payload: Range<usize>,
}

/// A chunk whose checksum holds.
#[derive(Debug)]
pub(crate) struct Chunk {
    content: Vec<u8>,
    pub messages: Vec<MessageAt>,
    /// As the chunk's own head says, with times and messages recomputed from what is inside.
    pub summary: ChunkSummary,
}

/// Splits a chunk record's body into head and compressed bytes.
pub(crate) fn parse_head(body: &[u8]) -> Option<(ChunkSummary, &[u8])> {
    let mut b = Bytes::new(body);
    let mut s = ChunkSummary {
        first_time: b.u64()?,
        last_time: b.u64()?,
        uncompressed: b.u64()?,
        uncompressed_crc: b.u32()?,
        ..ChunkSummary::default()
    };
    s.compression = b.string()?.to_owned();
    s.compressed = b.u64()?;
    (s.compressed == b.rest().len() as u64).then(|| (s, b.rest()))
}

impl Chunk {
    /// Checks the body of a chunk record and takes it apart.
    pub(crate) fn read(body: &[u8]) -> Result<Self, String> {
        let (head, compressed) = parse_head(body).ok_or("the head of the chunk is damaged")?;
        if head.uncompressed > CHUNK_LIMIT {
            return Err(format!(
                "the chunk claims {} bytes, more than {CHUNK_LIMIT} are never written",
                head.uncompressed
            ));
        }
        let content = match head.compression.as_str() {
            "" => compressed.to_owned(),
            COMPRESSION => decompress(compressed, head.uncompressed)?,
            other => {
                return Err(format!("the chunk is compressed with {other:?}, expected {COMPRESSION:?}"));
            }
        };
        if content.len() as u64 != head.uncompressed {
            return Err(format!(
                "the chunk holds {} bytes, its head says {}",
                content.len(),
                head.uncompressed
            ));
        }
        // a stored CRC of zero means "unchecked" to MCAP; here it is compared like any other
        let crc = crc32fast::hash(&content);
        if crc != head.uncompressed_crc {
            return Err(format!("the chunk's CRC is {crc:08x}, its head says {:08x}", head.uncompressed_crc));
        }
        let mut chunk = Self { content, messages: Vec::new(), summary: head };
        chunk.split().ok_or("the records inside the chunk do not fit together")?;
        Ok(chunk)
    }

    fn split(&mut self) -> Option<()> {
        let mut b = Bytes::new(&self.content);
        let s = &mut self.summary;
        (s.first_time, s.last_time) = (u64::MAX, 0);
        while !b.is_empty() {
            let offset = self.content.len() - b.rest().len();
            let (opcode, body) = b.record()?;
            if opcode != op::MESSAGE {
                continue;
            }
            let mut m = Bytes::new(body);
            let channel = m.u16()?;
            let sequence = m.u32()?;
            let time = m.u64()?;
            m.u64()?;
            let end = offset + RECORD_HEAD as usize + body.len();
            let payload = end - m.rest().len()..end;
            s.first_time = s.first_time.min(time);
            s.last_time = s.last_time.max(time);
            s.messages.entry(channel).or_default().push((time, offset as u64));
            self.messages.push(MessageAt { topic: Topic::from_id(channel), sequence, time, payload });
        }
        if self.messages.is_empty() {
            s.first_time = 0;
        }
        Some(())
    }

    /// Payload of a message of this chunk.
    pub(crate) fn payload(&self, m: &MessageAt) -> &[u8] {
        self.content.get(m.payload.clone()).unwrap_or_default()
    }

    /// The whole pose of this chunk, every frame checked against its digest; `None` if it holds no whole pose.
    pub(crate) fn pose(&self) -> Result<Option<RecordedPose>, String> {
        let mut begun: Option<PoseInfo> = None;
        let mut image: Option<(u32, RawImage)> = None;
        let (mut exposures, mut requested) = (Vec::new(), Vec::new());
        for m in &self.messages {
            let payload = self.payload(m);
            match m.topic {
                Some(Topic::Pose) => {
                    let info = decode::<PoseInfo>(payload, m)?;
                    match (info.state, &begun) {
                        (pose_state::BEGUN, None) => begun = Some(info),
                        (pose_state::DONE, Some(b)) if b.index == info.index && image.is_none() => {
                            if info.frames as usize != exposures.len() {
                                return Err(format!(
                                    "pose {} holds {} frames, its end says {}",
                                    info.index,
                                    exposures.len(),
                                    info.frames
                                ));
                            }
                            return Ok(Some(RecordedPose {
                                record: PoseRecord {
                                    index: info.index,
                                    commanded: info.commanded(),
                                    readback: info.readback(),
                                    exposures,
                                },
                                requested,
                            }));
                        }
                        (pose_state::GIVEN_UP, Some(_)) => return Ok(None),
                        _ => return Err("poses begin and end out of order".to_owned()),
                    }
                }
                Some(Topic::Image) if begun.is_some() && image.is_none() => {
                    image = Some((m.sequence, decode::<RawImage>(payload, m)?));
                }
                Some(Topic::Frame) => {
                    let info = decode::<FrameInfo>(payload, m)?;
                    let (sequence, image) =
                        image.take().ok_or("a frame's record stands without its image")?;
                    if sequence.wrapping_add(1) != m.sequence
                        || begun.as_ref().is_none_or(|b| b.index != info.pose)
                    {
                        return Err("a frame's record belongs to another image".to_owned());
                    }
                    requested.push(Duration::from_nanos(info.requested_ns));
                    exposures.push(exposure(&info, &image)?);
                }
                Some(Topic::Image) => return Err("an image stands without its frame's record".to_owned()),
                _ => {}
            }
        }
        if begun.is_some() {
            return Err("the pose was never ended".to_owned());
        }
        Ok(None)
    }
}

/// A whole pose with the exposures that were asked for, one for each frame.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedPose {
    /// The pose.
    pub record: PoseRecord,
    /// The exposure asked for, frame by frame; the camera may have rounded it.
    pub requested: Vec<Duration>,
}

fn decode<M: prost::Message + Default>(payload: &[u8], m: &MessageAt) -> Result<M, String> {
    M::decode(payload).map_err(|e| format!("message {} cannot be decoded: {e}", m.sequence))
}

fn exposure(info: &FrameInfo, image: &RawImage) -> Result<Exposure, String> {
    let size = u64::from(info.width) * u64::from(info.height) * 2;
    if image.encoding != "mono16"
        || (image.width, image.height) != (info.width, info.height)
        || image.data.len() as u64 != size
    {
        return Err(format!(
            "frame {} is {} × {} {:?} with {} bytes, expected {} × {} \"mono16\" with {size}",
            info.sequence,
            image.width,
            image.height,
            image.encoding,
            image.data.len(),
            info.width,
            info.height
        ));
    }
    if digest::pixels(&image.data).as_slice() != info.sha256 {
        return Err(format!("the pixels of frame {} do not match their SHA-256", info.sequence));
    }
    Ok(Exposure {
        frame: Frame {
            width: info.width,
            height: info.height,
            pixels: digest::from_bytes(&image.data),
            exposure: Duration::from_nanos(info.exposure_ns),
            sequence: info.sequence,
            stamp: Duration::from_nanos(info.stamp_ns),
            sensor_temperature_c: info.sensor_temperature_c,
        },
        lamp_monitor: info.lamp_monitor,
        shutter_open: info.shutter_open,
    })
}

/// Decompresses at most `size` bytes and one, so that no damaged or hostile stream fills memory.
fn decompress(compressed: &[u8], size: u64) -> Result<Vec<u8>, String> {
    // a damaged head may claim anything: grow from here as data really come
    let first = usize::try_from(size.min(64 << 20)).unwrap_or(0);
    let mut out = Vec::with_capacity(first + 1);
    zstd::stream::read::Decoder::with_buffer(compressed)
        .map(zstd::stream::read::Decoder::single_frame)
        .and_then(|d| d.take(size.saturating_add(1)).read_to_end(&mut out))
        .map_err(|e| format!("the chunk cannot be decompressed: {e}"))?;
    Ok(out)
}
