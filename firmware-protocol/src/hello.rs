//! The hello: fixed bytes that stay as they are in every protocol version, so that two ends which understand
//! nothing else of each other can still say why.
//!
//! ```text
//!  0  4 bytes  magic "GNIO"
//!  4  u8       role: 0 host asks, 1 device answers, 2 device announces itself (after a start, or when it hears a
//!              session it does not know)
//!  5  u8       protocol version of the sender
//!  6  u16 LE   receive window: data frames the sender can hold out of order
//!  8  u64 LE   schema hash
//! 16  3×u16 LE version of the sender's program: major, minor, patch
//! 22  u32 LE   boot counter of the device (0 from a host)
//! 26  u32 LE   session id: chosen by the host, repeated by the answer, 0 in an announcement
//! 30  u32 LE   client id: chosen by the host once per program run, repeated by the answer
//! 34  16 bytes serial number, ASCII, padded with zeros (all zero from a host)
//! 50
//! ```

use core::fmt;

/// First four bytes of a hello. No protocol version may be 0x47, so a frame cannot be mistaken for one.
pub const MAGIC: [u8; 4] = *b"GNIO";
/// Bytes of a hello.
pub const HELLO_LEN: usize = 50;

/// Who speaks, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Role {
    /// A host asks for a session.
    Ask = 0,
    /// The device answers that.
    Answer = 1,
    /// The device says unasked that it is there and knows no session.
    Announce = 2,
}

/// Version of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Version {
    /// Incompatible changes.
    pub major: u16,
    /// Additions.
    pub minor: u16,
    /// Corrections.
    pub patch: u16,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

/// Serial number of a device: up to 16 ASCII characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Serial(pub [u8; 16]);

impl Serial {
    /// Takes the first 16 bytes of `text`.
    pub fn new(text: &str) -> Serial {
        let mut bytes = [0; 16];
        for (to, from) in bytes.iter_mut().zip(text.bytes()) {
            *to = from;
        }
        Serial(bytes)
    }

    /// The characters before the padding; empty if they are not text.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|&b| b == 0).unwrap_or(self.0.len());
        self.0.get(..end).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or("")
    }
}

/// A greeting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Who speaks, and why.
    pub role: Role,
    /// Protocol version of the sender.
    pub protocol: u8,
    /// Data frames the sender can hold out of order.
    pub window: u16,
    /// Hash of the sender's message schema.
    pub schema: u64,
    /// Version of the sender's program.
    pub version: Version,
    /// How often the device has started; 0 from a host.
    pub boot: u32,
    /// Session asked for or answered; 0 in an announcement.
    pub session: u32,
    /// The host program's run.
    pub client: u32,
    /// Serial number of the device.
    pub serial: Serial,
}

impl Hello {
    /// The fifty bytes.
    pub fn to_bytes(&self) -> [u8; HELLO_LEN] {
        let mut out = [0; HELLO_LEN];
        out[..4].copy_from_slice(&MAGIC);
        out[4] = self.role as u8;
        out[5] = self.protocol;
        out[6..8].copy_from_slice(&self.window.to_le_bytes());
        out[8..16].copy_from_slice(&self.schema.to_le_bytes());
        out[16..18].copy_from_slice(&self.version.major.to_le_bytes());
        out[18..20].copy_from_slice(&self.version.minor.to_le_bytes());
        out[20..22].copy_from_slice(&self.version.patch.to_le_bytes());
        out[22..26].copy_from_slice(&self.boot.to_le_bytes());
        out[26..30].copy_from_slice(&self.session.to_le_bytes());
        out[30..34].copy_from_slice(&self.client.to_le_bytes());
        out[34..].copy_from_slice(&self.serial.0);
        out
    }

    /// Reads the fifty bytes; `None` without the magic or with an unknown role.
    pub fn from_bytes(bytes: &[u8; HELLO_LEN]) -> Option<Hello> {
        if !bytes.starts_with(&MAGIC) {
            return None;
        }
        let role = match bytes[4] {
            0 => Role::Ask,
            1 => Role::Answer,
            2 => Role::Announce,
            _ => return None,
        };
        let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let u32_at = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let mut serial = [0; 16];
        serial.copy_from_slice(&bytes[34..]);
        Some(Hello {
            role,
            protocol: bytes[5],
            window: u16_at(6),
            schema: u64::from(u32_at(8)) | u64::from(u32_at(12)) << 32,
            version: Version { major: u16_at(16), minor: u16_at(18), patch: u16_at(20) },
            boot: u32_at(22),
            session: u32_at(26),
            client: u32_at(30),
            serial: Serial(serial),
        })
    }
}
