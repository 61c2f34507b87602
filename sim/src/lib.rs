//! The virtual instrument: firmware behaviour and ray-traced optics.
//!
//! [`firmware`] behaves like the motion controller behind the wire protocol, [`camera`] like the camera behind
//! [`gonio_instrument::Camera`]; both live in one [`world`], which holds what is physically the case. [`optics`] traces what the camera sees of a
//! [`truth`] or of a reference sample.
//!
//! What it does not know: the driver that talks to it, recordings, and how frames are evaluated. Mirror, lens and frame chain are its own, so
//! that an error in the evaluation cannot hide by being made twice.

pub mod camera;
pub mod firmware;
pub mod flakes;
pub mod optics;
pub mod truth;
pub mod world;

pub use camera::{CameraFaults, VirtualCamera};
pub use truth::{Truth, TruthError};
