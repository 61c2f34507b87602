//! Frames: how a packet of bytes survives a byte stream.
//!
//! ```text
//! on the wire     COBS( packet ‖ crc32(packet) as u32 LE ) ‖ 0x00
//! packet          a hello (starts with "GNIO", see `hello`) or a frame:
//!   0  u8   protocol version
//!   1  u8   kind: 0 data, 1 acknowledgement alone, 2 datagram
//!   2  u32  session id, LE
//!   6  u16  sequence number of this data frame, LE (0 in other kinds)
//!   8  u16  cumulative acknowledgement, LE: the sequence number expected next
//!  10  …    body: one postcard message of at most MAX_BODY bytes (empty in kind 1)
//! ```
//!
//! CRC-32 is the one of Ethernet and zip (ISO-HDLC, polynomial 0x04C11DB7 reflected). It is checked before any
//! field is looked at. A zero byte always ends a frame, so a receiver that joins in the middle is in step after
//! at most one lost frame; empty frames (two zeros in a row) mean nothing and may be sent to force that.

use crate::PROTOCOL_VERSION;
use crate::hello::{HELLO_LEN, Hello, MAGIC};
use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc};

/// Longest body of a frame in bytes.
pub const MAX_BODY: usize = 128;
/// Bytes before the body.
pub const HEADER_LEN: usize = 10;
/// Bytes of the checksum.
pub const CRC_LEN: usize = 4;
/// Longest packet with its checksum, before COBS.
pub const MAX_PACKET: usize = HEADER_LEN + MAX_BODY + CRC_LEN;
/// Longest run of bytes on the wire for one frame: COBS adds one byte below 255, the terminator another.
pub const MAX_ENCODED: usize = MAX_PACKET + 2;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Sequenced and repeated until acknowledged; delivered once and in order.
    Data = 0,
    /// Carries an acknowledgement and nothing else.
    Ack = 1,
    /// Neither sequenced nor repeated by the link: heartbeats, telemetry, emergency stop.
    Datagram = 2,
}

/// The ten bytes before the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// What the frame is for.
    pub kind: Kind,
    /// The session both ends agreed on in their hellos.
    pub session: u32,
    /// Sequence number of a data frame.
    pub seq: u16,
    /// Sequence number the sender expects next from its peer.
    pub ack: u16,
}

/// A body: up to [`MAX_BODY`] bytes held in place.
#[derive(Clone, Copy)]
pub struct Body {
    len: u8,
    bytes: [u8; MAX_BODY],
}

impl Body {
    /// A body without bytes.
    pub const EMPTY: Body = Body { len: 0, bytes: [0; MAX_BODY] };

    /// Copies `bytes`; `None` if they are longer than [`MAX_BODY`].
    pub fn new(bytes: &[u8]) -> Option<Body> {
        let mut body = Body::EMPTY;
        body.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        body.len = u8::try_from(bytes.len()).ok()?;
        Some(body)
    }

    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&[])
    }
}

impl fmt::Debug for Body {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Body").field(&self.as_slice()).finish()
    }
}

impl PartialEq for Body {
    fn eq(&self, other: &Body) -> bool {
        self.as_slice() == other.as_slice()
    }
}

/// What came out of a complete frame whose checksum holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Packet {
    /// A greeting.
    Hello(Hello),
    /// A frame of this protocol version.
    Frame(Header, Body),
}

/// Why a run of bytes was thrown away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// More bytes than any frame has came without a terminator.
    TooLong,
    /// The bytes are not COBS.
    Cobs,
    /// Shorter than a header (or, starting with the magic, not as long as a hello) and a checksum.
    Length {
        /// Bytes found after COBS, checksum included.
        found: usize,
    },
    /// The checksum does not hold.
    Crc {
        /// Found at the end of the frame.
        found: u32,
        /// Computed over the bytes before it.
        computed: u32,
    },
    /// A frame of another protocol version.
    Version {
        /// Found in the first byte.
        found: u8,
    },
    /// A kind this version does not know.
    Kind {
        /// Found in the second byte.
        found: u8,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameError::TooLong => write!(f, "no end of frame within {MAX_ENCODED} bytes"),
            FrameError::Cobs => write!(f, "frame is not valid COBS"),
            FrameError::Length { found } => write!(f, "frame of {found} bytes has an impossible length"),
            FrameError::Crc { found, computed } => {
                write!(f, "checksum of frame is {found:08x}, its bytes give {computed:08x}")
            }
            FrameError::Version { found } => {
                write!(f, "frame of protocol version {found}, expected {PROTOCOL_VERSION}")
            }
            FrameError::Kind { found } => write!(f, "frame of unknown kind {found}"),
        }
    }
}

impl core::error::Error for FrameError {}

/// The encoded bytes of one frame, terminator included.
#[derive(Clone, Copy, Debug)]
pub struct Encoded {
    len: usize,
    bytes: [u8; MAX_ENCODED],
}

impl Encoded {
    /// The bytes to send.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&[])
    }
}

/// Encodes a frame.
pub fn encode(header: &Header, body: &Body) -> Encoded {
    let mut packet = [0u8; HEADER_LEN + MAX_BODY];
    packet[0] = PROTOCOL_VERSION;
    packet[1] = header.kind as u8;
    packet[2..6].copy_from_slice(&header.session.to_le_bytes());
    packet[6..8].copy_from_slice(&header.seq.to_le_bytes());
    packet[8..10].copy_from_slice(&header.ack.to_le_bytes());
    let body = body.as_slice();
    packet[HEADER_LEN..HEADER_LEN + body.len()].copy_from_slice(body);
    seal(&packet[..HEADER_LEN + body.len()])
}

/// Encodes a greeting.
pub fn encode_hello(hello: &Hello) -> Encoded {
    seal(&hello.to_bytes())
}

/// Adds checksum, COBS and terminator. `packet` is at most `HEADER_LEN + MAX_BODY` bytes: both callers hold that.
fn seal(packet: &[u8]) -> Encoded {
    let mut sealed = [0u8; MAX_PACKET];
    let end = packet.len();
    sealed[..end].copy_from_slice(packet);
    sealed[end..end + CRC_LEN].copy_from_slice(&CRC.checksum(packet).to_le_bytes());
    let mut encoded = Encoded { len: 0, bytes: [0; MAX_ENCODED] };
    let coded = cobs::encode(&sealed[..end + CRC_LEN], &mut encoded.bytes);
    // The byte after the coded ones is still the zero it was created with: the terminator.
    encoded.len = coded + 1;
    encoded
}

/// Takes bytes one by one and gives packets. Holds one frame; needs no allocation.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: [u8; MAX_ENCODED],
    len: usize,
    overrun: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder between frames.
    pub const fn new() -> Self {
        Decoder { buffer: [0; MAX_ENCODED], len: 0, overrun: false }
    }

    /// Takes one byte. `None` while a frame is incomplete; a packet or the reason for its loss at its end.
    pub fn push(&mut self, byte: u8) -> Option<Result<Packet, FrameError>> {
        if byte != 0 {
            match self.buffer.get_mut(self.len) {
                Some(slot) => {
                    *slot = byte;
                    self.len += 1;
                }
                None => self.overrun = true,
            }
            return None;
        }
        let (len, overrun) = (self.len, self.overrun);
        self.len = 0;
        self.overrun = false;
        if overrun {
            return Some(Err(FrameError::TooLong));
        }
        if len == 0 {
            return None;
        }
        Some(self.open(len))
    }

    fn open(&mut self, len: usize) -> Result<Packet, FrameError> {
        let coded = self.buffer.get(..len).ok_or(FrameError::TooLong)?;
        let mut packet = [0u8; MAX_ENCODED];
        let found = uncobs(coded, &mut packet).ok_or(FrameError::Cobs)?;
        let sealed = packet.get(..found).ok_or(FrameError::Cobs)?;
        parse(sealed)
    }
}

/// Strict COBS: `None` when a code byte points past the end. Written out because the frame must be refused, not
/// cut short, when its last block is incomplete.
fn uncobs(coded: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut len = 0;
    let mut rest = coded;
    while let Some((&code, tail)) = rest.split_first() {
        let run = usize::from(code).checked_sub(1)?;
        let block = tail.get(..run)?;
        out.get_mut(len..len + run)?.copy_from_slice(block);
        len += run;
        rest = tail.get(run..)?;
        if code < 0xff && !rest.is_empty() {
            *out.get_mut(len)? = 0;
            len += 1;
        }
    }
    Some(len)
}

/// Checks and reads a packet with its checksum, after COBS.
fn parse(sealed: &[u8]) -> Result<Packet, FrameError> {
    let found = sealed.len();
    let (packet, crc) = sealed.split_last_chunk::<CRC_LEN>().ok_or(FrameError::Length { found })?;
    let (crc, computed) = (u32::from_le_bytes(*crc), CRC.checksum(packet));
    if crc != computed {
        return Err(FrameError::Crc { found: crc, computed });
    }
    if packet.starts_with(&MAGIC) {
        let bytes: &[u8; HELLO_LEN] = packet.try_into().map_err(|_| FrameError::Length { found })?;
        return Ok(Packet::Hello(Hello::from_bytes(bytes).ok_or(FrameError::Length { found })?));
    }
    let (&[version, kind, s0, s1, s2, s3, q0, q1, a0, a1], body) =
        packet.split_first_chunk::<HEADER_LEN>().ok_or(FrameError::Length { found })?;
    if version != PROTOCOL_VERSION {
        return Err(FrameError::Version { found: version });
    }
    let kind = match kind {
        0 => Kind::Data,
        1 => Kind::Ack,
        2 => Kind::Datagram,
        found => return Err(FrameError::Kind { found }),
    };
    let header = Header {
        kind,
        session: u32::from_le_bytes([s0, s1, s2, s3]),
        seq: u16::from_le_bytes([q0, q1]),
        ack: u16::from_le_bytes([a0, a1]),
    };
    Ok(Packet::Frame(header, Body::new(body).ok_or(FrameError::Length { found })?))
}
