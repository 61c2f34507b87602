//! What the two ends of a camera socket say to each other.
//!
//! ```text
//!  0  4 bytes  "GCAM"
//!  4  u8       version: 1
//!  5  u8       kind: 1 info?, 2 info, 3 capture?, 4 frame, 5 error, 6 cancel
//!  6  u16 LE   0
//!  8  u32 LE   length n of the payload
//! 12  n bytes  payload
//!  …  u64 LE   CRC-64/XZ of everything before
//!
//! info     width, height, bits (u32 each), then name and serial (u32 length and UTF-8 each)
//! capture? exposure in ns, u64
//! frame    width, height (u32), exposure in ns, sequence, stamp in ns (u64), 0 or 1 (u8), sensor temperature (f64, °C; 0 if absent),
//!          then width·height counts, u16
//! error    code (u8), text (UTF-8); codes: 0 other, 1 in use, 2 cancelled, 3 gone, 4 bad frame (text), 5 timeout
//! ```

use crc::{CRC_64_XZ, Crc, Digest, Table};
use gonio_instrument::{CameraInfo, DeviceError, Frame};
use std::io::{self, Read, Write};
use std::time::Duration;

type Sixteen = Table<16>;
const CRC: Crc<u64, Sixteen> = Crc::<u64, Sixteen>::new(&CRC_64_XZ);
const MAGIC: [u8; 4] = *b"GCAM";
const VERSION: u8 = 1;
const HEAD: usize = 12;
/// Longest payload: a frame of 16,384 × 8,192 pixels.
const MAX_PAYLOAD: u32 = 1 << 28;

/// One message.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Message {
    AskInfo,
    Info(CameraInfo),
    Capture(Duration),
    Frame(Frame),
    Error(DeviceError),
    Cancel,
}

/// Why no message could be read.
#[derive(Debug)]
pub(super) enum ReadError {
    /// The other end has closed between two messages.
    Closed,
    /// The other end has closed within a message, or the socket is broken.
    Broken,
    /// Not a message: which bytes are wrong.
    Malformed(&'static str),
}

impl From<io::Error> for ReadError {
    fn from(_: io::Error) -> ReadError {
        ReadError::Broken
    }
}

impl Message {
    /// Writes the message.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let (kind, payload) = self.payload();
        let length = u32::try_from(payload.len()).ok().filter(|&n| n <= MAX_PAYLOAD).ok_or_else(|| {
            io::Error::new(io::ErrorKind::InvalidInput, "frame too large for the camera socket")
        })?;
        let mut head = [0u8; HEAD];
        head[..4].copy_from_slice(&MAGIC);
        head[4] = VERSION;
        head[5] = kind;
        head[8..].copy_from_slice(&length.to_le_bytes());
        let mut digest: Digest<'_, u64, Sixteen> = CRC.digest();
        digest.update(&head);
        digest.update(&payload);
        out.write_all(&head)?;
        out.write_all(&payload)?;
        out.write_all(&digest.finalize().to_le_bytes())?;
        out.flush()
    }

    /// Reads one message, which is checked before it is looked at.
    pub fn read(input: &mut impl Read) -> Result<Message, ReadError> {
        let mut head = [0u8; HEAD];
        match input.read(&mut head)? {
            0 => return Err(ReadError::Closed),
            n => input.read_exact(head.get_mut(n..).unwrap_or(&mut []))?,
        }
        if !head.starts_with(&MAGIC) {
            return Err(ReadError::Malformed("it does not start with GCAM"));
        }
        if head[4] != VERSION {
            return Err(ReadError::Malformed("it is of another version"));
        }
        let length = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
        if length > MAX_PAYLOAD {
            return Err(ReadError::Malformed("its length is impossible"));
        }
        let mut payload = Vec::new();
        // `take` lets the memory grow with what really comes.
        input.take(u64::from(length)).read_to_end(&mut payload)?;
        let mut crc = [0u8; 8];
        input.read_exact(&mut crc)?;
        let mut digest: Digest<'_, u64, Sixteen> = CRC.digest();
        digest.update(&head);
        digest.update(&payload);
        if digest.finalize() != u64::from_le_bytes(crc) {
            return Err(ReadError::Malformed("its checksum does not hold"));
        }
        parse(head[5], &payload).ok_or(ReadError::Malformed("its contents do not fit its kind"))
    }

    fn payload(&self) -> (u8, Vec<u8>) {
        let mut p = Vec::new();
        let kind = match self {
            Message::AskInfo => 1,
            Message::Info(info) => {
                for number in [info.width, info.height, info.bits] {
                    p.extend(number.to_le_bytes());
                }
                for text in [&info.name, &info.serial] {
                    p.extend((text.len() as u32).to_le_bytes());
                    p.extend(text.as_bytes());
                }
                2
            }
            Message::Capture(exposure) => {
                p.extend(nanos(*exposure).to_le_bytes());
                3
            }
            Message::Frame(frame) => {
                p.reserve(45 + frame.pixels.len() * 2);
                p.extend(frame.width.to_le_bytes());
                p.extend(frame.height.to_le_bytes());
                for number in [nanos(frame.exposure), frame.sequence, nanos(frame.stamp)] {
                    p.extend(number.to_le_bytes());
                }
                p.push(u8::from(frame.sensor_temperature_c.is_some()));
                p.extend(frame.sensor_temperature_c.unwrap_or_default().to_le_bytes());
                p.extend(frame.pixels.iter().flat_map(|count| count.to_le_bytes()));
                4
            }
            Message::Error(error) => {
                let (code, text) = coded(error);
                p.push(code);
                p.extend(text.as_bytes());
                5
            }
            Message::Cancel => 6,
        };
        (kind, p)
    }
}

/// Three hundred years of nanoseconds fit.
fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn coded(error: &DeviceError) -> (u8, String) {
    match error {
        DeviceError::InUse { device } => (1, device.clone()),
        DeviceError::Cancelled => (2, String::new()),
        DeviceError::Gone { device } => (3, device.clone()),
        DeviceError::BadFrame { reason, .. } => (4, reason.clone()),
        DeviceError::Timeout { what, .. } => (5, what.clone()),
        other => (0, other.to_string()),
    }
}

fn parse(kind: u8, payload: &[u8]) -> Option<Message> {
    let mut rest = payload;
    let message = match kind {
        1 => Message::AskInfo,
        2 => {
            let (width, height, bits) = (u32_of(&mut rest)?, u32_of(&mut rest)?, u32_of(&mut rest)?);
            let (name, serial) = (text_of(&mut rest)?, text_of(&mut rest)?);
            Message::Info(CameraInfo { name, serial, width, height, bits })
        }
        3 => Message::Capture(Duration::from_nanos(u64_of(&mut rest)?)),
        4 => {
            let (width, height) = (u32_of(&mut rest)?, u32_of(&mut rest)?);
            let exposure = Duration::from_nanos(u64_of(&mut rest)?);
            let (sequence, stamp) = (u64_of(&mut rest)?, Duration::from_nanos(u64_of(&mut rest)?));
            let told = *take(&mut rest, 1)?.first()? != 0;
            let temperature = f64::from_bits(u64_of(&mut rest)?);
            let pixels = u64::from(width) * u64::from(height);
            if rest.len() as u64 != pixels.checked_mul(2)? {
                return None;
            }
            let pixels = rest.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
            rest = &[];
            let sensor_temperature_c = told.then_some(temperature);
            Message::Frame(Frame { width, height, pixels, exposure, sequence, stamp, sensor_temperature_c })
        }
        5 => {
            let code = *take(&mut rest, 1)?.first()?;
            let text = std::str::from_utf8(std::mem::take(&mut rest)).ok()?.to_owned();
            Message::Error(match code {
                1 => DeviceError::InUse { device: text },
                2 => DeviceError::Cancelled,
                3 => DeviceError::Gone { device: text },
                4 => DeviceError::BadFrame { sequence: 0, reason: text },
                5 => DeviceError::Timeout { device: "the camera".into(), what: text, waited: Duration::ZERO },
                _ => DeviceError::Io { device: "the camera".into(), reason: text },
            })
        }
        6 => Message::Cancel,
        _ => return None,
    };
    rest.is_empty().then_some(message)
}

fn take<'a>(rest: &mut &'a [u8], n: usize) -> Option<&'a [u8]> {
    let (taken, left) = rest.split_at_checked(n)?;
    *rest = left;
    Some(taken)
}

fn u32_of(rest: &mut &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(take(rest, 4)?.try_into().ok()?))
}

fn u64_of(rest: &mut &[u8]) -> Option<u64> {
    Some(u64::from_le_bytes(take(rest, 8)?.try_into().ok()?))
}

fn text_of(rest: &mut &[u8]) -> Option<String> {
    let length = u32_of(rest)? as usize;
    Some(std::str::from_utf8(take(rest, length)?).ok()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes_of(message: &Message) -> Vec<u8> {
        let mut bytes = Vec::new();
        message.write(&mut bytes).expect("memory takes it");
        bytes
    }

    fn frame() -> Frame {
        Frame {
            width: 3,
            height: 2,
            pixels: vec![0, 1, 255, 256, 4095, 65535],
            exposure: Duration::from_nanos(123_456_789),
            sequence: u64::MAX,
            stamp: Duration::from_secs(5),
            sensor_temperature_c: Some(-12.5),
        }
    }

    fn samples() -> Vec<Message> {
        let info = CameraInfo { name: "näme".into(), serial: String::new(), width: 3, height: 2, bits: 12 };
        vec![
            Message::AskInfo,
            Message::Info(info),
            Message::Capture(Duration::from_micros(20)),
            Message::Frame(frame()),
            Message::Frame(Frame { sensor_temperature_c: None, ..frame() }),
            Message::Error(DeviceError::InUse { device: "it".into() }),
            Message::Error(DeviceError::Cancelled),
            Message::Cancel,
        ]
    }

    #[test]
    fn messages_come_back() {
        for message in samples() {
            let read = Message::read(&mut bytes_of(&message).as_slice());
            assert!(matches!(&read, Ok(m) if *m == message), "{message:?} {read:?}");
        }
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_noticed() {
        for message in samples() {
            let bytes = bytes_of(&message);
            for bit in 0..bytes.len() * 8 {
                let mut bytes = bytes.clone();
                bytes[bit / 8] ^= 1 << (bit % 8);
                assert!(Message::read(&mut bytes.as_slice()).is_err(), "bit {bit} of {message:?}");
            }
            for end in 0..bytes.len() {
                assert!(Message::read(&mut &bytes[..end]).is_err());
            }
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_the_reader_panic_or_ask_for_much(kind in 0u8..8, payload in proptest::collection::vec(any::<u8>(), 0..80)) {
            let _ = parse(kind, &payload);
            let mut soup = payload.clone();
            soup.splice(0..0, *b"GCAM\x01\x04\x00\x00\xff\xff\xff\x0f");
            prop_assert!(Message::read(&mut soup.as_slice()).is_err());
        }
    }
}
