//! Cameras behind [`gonio_instrument::Camera`].

pub mod fault;
mod message;
pub mod socket;

pub use fault::{CameraFaults, CameraTally, FaultyCamera, Mistreated};
pub use socket::{CameraServer, SocketCamera};
