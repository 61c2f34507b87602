//! The wire contract between a host and the motion controller of a gonioreflectometer.
//!
//! What this crate does: byte framing ([`frame`]), the greeting that never changes ([`hello`]), the messages
//! ([`message`]), a reliable ordered link over a lossy byte stream ([`link`]), the two protocol state machines
//! ([`host`], [`device`]), leases ([`lease`]), an estimate of the device's clock ([`clock`]) and the memory that keeps a repeated command from being executed
//! twice ([`dedup`]). Everything is sans-I/O: bytes and a clock are handed in, bytes and events come out, so the
//! same code runs in firmware, in the host and in tests with virtual time. The clock is a
//! [`core::time::Duration`] since an arbitrary start; it must not run backwards.
//!
//! What it leaves to others: ports and threads, what a command means to a motor, and the host's operating system.
//! `SPEC.md` beside this crate says the same byte by byte for authors who do not read Rust.
#![no_std]

pub mod clock;
pub mod dedup;
pub mod device;
pub mod frame;
pub mod hello;
pub mod host;
pub mod lease;
pub mod link;
pub mod message;

/// Version of everything but the hello. Two ends with different versions exchange hellos and nothing else.
pub const PROTOCOL_VERSION: u8 = 1;

/// FNV-1a (64 bit) of the schema block in `SPEC.md`. Changes whenever a message changes, even by accident.
pub const SCHEMA_HASH: u64 = 0xCFEA0F1C6BB0AEA9;

/// How often a connected host sends a heartbeat.
pub const HEARTBEAT_INTERVAL: core::time::Duration = core::time::Duration::from_millis(30);

/// How long the device keeps moving, or holds the shutter open, without hearing a heartbeat.
pub const MOTION_LEASE: core::time::Duration = core::time::Duration::from_millis(150);

/// How long the device keeps the lamp burning without hearing a heartbeat, unless configured otherwise.
pub const LAMP_LEASE: core::time::Duration = core::time::Duration::from_secs(60);

/// Commands that a host may have without a final reply. The device has room for the replies to that many while the host does not
/// acknowledge, and remembers more than that.
pub const UNANSWERED: usize = 8;
