//! What the engine and whoever runs it say to each other.

use std::time::Duration;

use gonio_instrument::{DeviceError, Pose, Sensors};
use gonio_recording::RecordingError;

use super::PreflightError;
use crate::bracket::FrameSummary;

/// Something to do now. Each is answered by exactly one [`Event`].
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// See whether the journal can take the scan: [`Event::Done`] or [`Event::JournalFailed`].
    CheckJournal,
    /// Read the sensors: [`Event::Sensors`].
    ReadSensors,
    /// Find the reference marks.
    Home,
    /// Set the lamp's level and wait until it is warm.
    Lamp(f64),
    /// Move and settle: [`Event::Moved`].
    MoveTo {
        /// Place in the plan.
        index: u32,
        /// Where to.
        pose: Pose,
    },
    /// Open or close the shutter.
    Shutter(bool),
    /// Begin the pose in the journal.
    BeginPose {
        /// Place in the plan.
        index: u32,
        /// Where the plan wants it.
        commanded: Pose,
        /// Where the encoders say it is.
        readback: Pose,
    },
    /// Take a frame: [`Event::Frame`].
    Capture {
        /// Exposure asked for.
        exposure: Duration,
        /// Whether the lamp's light falls in.
        light: bool,
    },
    /// Keep the frame just taken, with this lamp monitor.
    Record {
        /// Exposure asked for.
        requested: Duration,
        /// Lamp monitor.
        lamp_monitor: f64,
        /// Whether the shutter was open.
        shutter_open: bool,
    },
    /// End the pose in the journal: it is on the disk when [`Event::Done`] comes.
    EndPose,
    /// Give the open pose up in the journal.
    GiveUpPose,
    /// Clear the device's fault, if its cause is gone.
    Rearm,
    /// Stop all motion in a controlled way.
    StopMotion,
    /// Stop everything at once, shutter closed, lamp off.
    EmergencyStop,
}

/// What came of an action, or what somebody asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The action is done.
    Done,
    /// The stage stands here.
    Moved(Pose),
    /// What the sensors say.
    Sensors(Sensors),
    /// A frame was taken.
    Frame(FrameSummary),
    /// The action failed.
    Failed(DeviceError),
    /// The journal could not keep something.
    JournalFailed(RecordingError),
    /// Hold after the frame under way.
    Pause,
    /// Go on.
    Resume,
    /// End in a controlled way.
    Abort,
    /// End at once.
    Emergency,
    /// Time since the scan began.
    Tick(Duration),
}

/// What the engine wants.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Do this, then [`Engine::handle`] its event.
    Do(Action),
    /// Paused: wait for [`Event::Resume`] or an end.
    Wait,
    /// The scan is over.
    End(Outcome),
}

/// A pose that is missing, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct LostPose {
    /// Place in the plan.
    pub index: u32,
    /// What went wrong.
    pub reason: String,
}

/// What follows a pose, as whoever watches the scan wants it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The next of the plan.
    #[default]
    AsPlanned,
    /// This place in the plan.
    This(u32),
    /// No further pose is needed: the scan ends as after its last one.
    Enough,
}

/// How a scan ended. Whatever it says, the device was left safe and what was measured is kept.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Every pose is measured.
    Done,
    /// Some poses are missing, against the plan.
    Partial {
        /// Which.
        lost: Vec<LostPose>,
    },
    /// Ended on request; continue with `--resume`.
    Aborted {
        /// Whether it was the emergency stop.
        emergency: bool,
        /// Poses not taken.
        remaining: u32,
    },
    /// Not begun.
    Refused(PreflightError),
    /// Ended by an error.
    Failed {
        /// What went wrong.
        error: ScanError,
        /// Poses not taken.
        remaining: u32,
    },
}

/// What ends a scan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScanError {
    /// The stage or the camera.
    #[error("{0}; poses already measured are kept, continue with --resume")]
    Device(DeviceError),
    /// The recording.
    #[error("{0}; poses already measured are kept, make room and continue with --resume")]
    Journal(RecordingError),
}

/// What is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Checking.
    Preflight,
    /// Homing.
    Homing,
    /// The lamp warms up.
    Lamp,
    /// Moving to a pose.
    Moving,
    /// Taking dark frames.
    Dark,
    /// Taking frames.
    Exposing,
    /// Held.
    Paused,
    /// Waiting for something to pass.
    Suspended,
    /// Making the device safe.
    Safing,
    /// Over.
    Ended,
}

/// How far the scan is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is under way.
    pub phase: Phase,
    /// Poses done, those of earlier runs included.
    pub poses_done: u32,
    /// Poses of the plan.
    pub poses_total: u32,
    /// Frames kept in this run.
    pub exposures_done: u32,
    /// Frames that the whole run will take, by what the poses so far took.
    pub exposures_total: u32,
    /// Time left, once a pose of this run is done.
    pub remaining: Option<Duration>,
}
