//! What is kept of a pose: its frames with the state of the lamp, and the position read back.

use crate::{Frame, Pose};

/// A frame with what was read beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// The raw frame.
    pub frame: Frame,
    /// Lamp monitor during the exposure, relative to nominal (1.0).
    pub lamp_monitor: f64,
    /// Whether the shutter let the lamp through; closed frames are dark frames.
    pub shutter_open: bool,
}

/// A finished pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseRecord {
    /// Place in the plan, from 0.
    pub index: u32,
    /// Where the plan wanted it.
    pub commanded: Pose,
    /// Where the encoders said it was.
    pub readback: Pose,
    /// Every frame taken there, dark ones included, in the order taken.
    pub exposures: Vec<Exposure>,
}
