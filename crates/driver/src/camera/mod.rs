//! Cameras behind [`gonio_instrument::Camera`].

mod message;
pub mod socket;

pub use socket::{CameraServer, SocketCamera};
