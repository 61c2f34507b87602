//! Cameras behind [`gonio_instrument::Camera`].

pub mod fault;
mod message;
pub mod socket;
#[cfg(feature = "cameras")]
pub mod v4l;

pub use fault::{CameraFaults, CameraTally, FaultyCamera, Mistreated};
pub use socket::{CameraServer, SocketCamera};
