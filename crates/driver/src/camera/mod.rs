//! Cameras behind [`gonio_instrument::Camera`].

#[cfg(any(feature = "cameras", feature = "genicam"))]
mod asking;
#[cfg(feature = "cameras")]
pub mod colour;
pub mod fault;
#[cfg(feature = "genicam")]
pub mod genicam;
#[cfg(any(feature = "cameras", feature = "genicam"))]
mod guard;
mod message;
#[cfg(any(feature = "cameras", feature = "genicam"))]
pub mod raw;
pub mod socket;
#[cfg(feature = "cameras")]
pub mod v4l;

pub use fault::{CameraFaults, CameraTally, FaultyCamera, Mistreated};
pub use socket::{CameraServer, SocketCamera};
