//! Names, numbers and limits of the session file. `docs/session-file.md` says the same in prose.

/// Format name in `session.json` and profile of the MCAP header.
pub const FORMAT: &str = "gonio-session";
/// Newest version of the format.
pub const VERSION: u32 = 1;

/// The eight bytes at both ends of an MCAP file.
pub(crate) const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n'];

/// Opcodes of MCAP, and ours.
pub(crate) mod op {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const ATTACHMENT: u8 = 0x09;
    pub const ATTACHMENT_INDEX: u8 = 0x0A;
    pub const STATISTICS: u8 = 0x0B;
    pub const SUMMARY_OFFSET: u8 = 0x0E;
    pub const DATA_END: u8 = 0x0F;
    /// Private record: the seal behind each pose. Readers skip opcodes of 0x80 and above that they do not know.
    pub const SEAL: u8 = 0x80;
}

/// A record begins with its opcode and a 64-bit length.
pub(crate) const RECORD_HEAD: u64 = 9;
/// Length of the footer record, head included.
pub(crate) const FOOTER_LENGTH: u64 = RECORD_HEAD + 20;
/// Compression of chunks: of noisy 12-bit frames zstd level 1 leaves 48 %, lz4 71 %; `cargo bench -p gonio-recording` measures.
pub(crate) const COMPRESSION: &str = "zstd";
/// Level of that compression.
pub(crate) const COMPRESSION_LEVEL: i32 = 1;
/// Most bytes of one chunk before compression; a larger one is refused by the writer and the reader.
pub(crate) const CHUNK_LIMIT: u64 = 1 << 32;
/// Most bytes of one attachment.
pub(crate) const ATTACHMENT_LIMIT: u64 = 1 << 28;
/// Most bytes of the MCAP header record.
pub(crate) const HEADER_LIMIT: u64 = 1 << 16;

/// Channels with their fixed ids; a channel's schema has the same id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Topic {
    /// `foxglove.RawImage`: the frame itself.
    Image = 1,
    /// `gonio.FrameInfo`: what was read beside the frame, and its digest.
    Frame = 2,
    /// `gonio.PoseInfo`: a pose begins, ends, or is given up.
    Pose = 3,
    /// `foxglove.Log`: an event.
    Event = 4,
    /// `gonio.Wire`: bytes on the wire.
    Wire = 5,
    /// `gonio.Sensors`: what the stage's sensors said.
    Sensors = 6,
}

impl Topic {
    pub(crate) const ALL: [Self; 6] =
        [Self::Image, Self::Frame, Self::Pose, Self::Event, Self::Wire, Self::Sensors];

    /// Channel and schema id.
    pub(crate) const fn id(self) -> u16 {
        self as u16
    }

    /// Topic name as viewers show it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Image => "/camera/raw",
            Self::Frame => "/camera/frame",
            Self::Pose => "/pose",
            Self::Event => "/events",
            Self::Wire => "/wire",
            Self::Sensors => "/sensors",
        }
    }

    /// Full name of the protobuf message.
    pub(crate) const fn schema(self) -> &'static str {
        match self {
            Self::Image => "foxglove.RawImage",
            Self::Frame => "gonio.FrameInfo",
            Self::Pose => "gonio.PoseInfo",
            Self::Event => "foxglove.Log",
            Self::Wire => "gonio.Wire",
            Self::Sensors => "gonio.Sensors",
        }
    }

    /// The channel with this id.
    pub(crate) fn from_id(id: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.id() == id)
    }
}

/// Names of the attachments.
pub mod attachment {
    /// Format, version, session id, segment number, start.
    pub const SESSION: &str = "session.json";
    /// The instrument description.
    pub const INSTRUMENT: &str = "instrument.toml";
    /// The plan.
    pub const PLAN: &str = "plan.toml";
    /// The sample record.
    pub const SAMPLE: &str = "sample.json";
    /// The certificate of a reference sample.
    pub const CERTIFICATE: &str = "certificate.json";
    /// Identity of stage and camera.
    pub const DEVICES: &str = "devices.json";
    /// Anything else worth knowing, as name and value.
    pub const PROVENANCE: &str = "provenance.json";
    /// In a recovered session: what was lost.
    pub const RECOVERY: &str = "recovery.json";
    /// All of these.
    pub const OURS: [&str; 8] =
        [SESSION, INSTRUMENT, PLAN, SAMPLE, CERTIFICATE, DEVICES, PROVENANCE, RECOVERY];
}
