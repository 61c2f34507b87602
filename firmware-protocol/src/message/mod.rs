//! What the two ends say to each other. Bodies are postcard: an enum is its variant number as a varint, then its
//! fields in order; integers above one byte are varints (signed ones zigzag first); a bool is one byte; an
//! optional value is 0, or 1 and the value.
//!
//! Integers only, units in the names: `_udeg` micro-degrees, `_ppm` millionths, `_mc` thousandths of a degree
//! Celsius, `_um` micrometres, `_us` and `_ms` micro- and milliseconds.

mod command;
mod report;

pub use command::{Command, ToDevice};
pub use report::{
    Axis, Fault, Motion, Outcome, Position, Reason, Reply, SensorReadings, Status, Telemetry, ToHost,
};

use crate::frame::{Body, MAX_BODY};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Why a body is not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageError {
    /// The bytes do not decode: unknown variant, or too short.
    Malformed,
    /// A message, and then more bytes.
    Trailing {
        /// How many.
        bytes: usize,
    },
    /// Does not fit in a body.
    TooLong,
}

impl fmt::Display for MessageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MessageError::Malformed => write!(f, "body is not a message of this protocol version"),
            MessageError::Trailing { bytes } => write!(f, "{bytes} bytes after the end of the message"),
            MessageError::TooLong => write!(f, "message is longer than {MAX_BODY} bytes"),
        }
    }
}

impl core::error::Error for MessageError {}

/// Writes a message as a body.
pub fn to_body<T: Serialize>(message: &T) -> Result<Body, MessageError> {
    let mut buffer = [0u8; MAX_BODY];
    let bytes = postcard::to_slice(message, &mut buffer).map_err(|_| MessageError::TooLong)?;
    Body::new(bytes).ok_or(MessageError::TooLong)
}

/// Reads a body as a message; bytes left over are an error.
pub fn from_body<T: for<'a> Deserialize<'a>>(body: &Body) -> Result<T, MessageError> {
    let (message, rest) =
        postcard::take_from_bytes::<T>(body.as_slice()).map_err(|_| MessageError::Malformed)?;
    if rest.is_empty() { Ok(message) } else { Err(MessageError::Trailing { bytes: rest.len() }) }
}
