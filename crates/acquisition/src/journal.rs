//! Where a scan writes what it measures: the session file, or memory in tests.

use std::time::Duration;

use gonio_instrument::{Exposure, Pose, Sensors};
use gonio_recording::RecordingError;
use gonio_recording::writer::{Level, Writer, now};

/// Keeps a scan. A pose counts as done when [`Journal::end_pose`] has returned.
pub trait Journal {
    /// Whether the scan has room; asked before anything moves.
    ///
    /// # Errors
    /// What is wrong with the place.
    fn check(&mut self) -> Result<(), RecordingError>;

    /// Begins a pose.
    ///
    /// # Errors
    /// What could not be written.
    fn begin_pose(&mut self, index: u32, commanded: Pose, readback: Pose) -> Result<(), RecordingError>;

    /// Keeps a frame with the exposure that was asked for.
    ///
    /// # Errors
    /// What could not be written.
    fn frame(&mut self, exposure: &Exposure, requested: Duration) -> Result<(), RecordingError>;

    /// Ends the pose; it is on the disk on return.
    ///
    /// # Errors
    /// What could not be written.
    fn end_pose(&mut self) -> Result<(), RecordingError>;

    /// Gives the pose up, if one is open.
    ///
    /// # Errors
    /// What could not be written.
    fn give_up_pose(&mut self) -> Result<(), RecordingError>;

    /// Notes what the sensors said.
    ///
    /// # Errors
    /// What could not be written.
    fn sensors(&mut self, sensors: &Sensors) -> Result<(), RecordingError>;

    /// Notes an event; `serious` where something went wrong.
    ///
    /// # Errors
    /// What could not be written.
    fn event(&mut self, serious: bool, text: &str) -> Result<(), RecordingError>;
}

/// Space is asked for by whoever creates the file, with the plan in hand (`gonio_recording::space`).
impl Journal for Writer {
    fn check(&mut self) -> Result<(), RecordingError> {
        Ok(())
    }

    fn begin_pose(&mut self, index: u32, commanded: Pose, readback: Pose) -> Result<(), RecordingError> {
        Self::begin_pose(self, index, commanded, readback)
    }

    fn frame(&mut self, exposure: &Exposure, requested: Duration) -> Result<(), RecordingError> {
        self.frame_requested(exposure, requested)
    }

    fn end_pose(&mut self) -> Result<(), RecordingError> {
        Self::end_pose(self).map(|_| ())
    }

    fn give_up_pose(&mut self) -> Result<(), RecordingError> {
        Self::give_up_pose(self)
    }

    fn sensors(&mut self, sensors: &Sensors) -> Result<(), RecordingError> {
        Self::sensors(self, now(), sensors)
    }

    fn event(&mut self, serious: bool, text: &str) -> Result<(), RecordingError> {
        Self::event(self, now(), if serious { Level::Warning } else { Level::Info }, text)
    }
}
