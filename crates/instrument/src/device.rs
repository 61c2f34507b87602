//! The contracts between the scan and whatever stands behind it: hardware, the virtual instrument, or a recorded session.
//!
//! Both traits block; the driver's threads do the waiting, so nothing here stalls an async runtime. Each long call takes a
//! [`Cancel`] and returns [`DeviceError::Cancelled`] soon after it is raised, with the device safe.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{Cancel, Frame, Pose};

/// Two motors, a shutter, a lamp and a few sensors.
pub trait Stage: Send {
    /// Who answers.
    fn identity(&self) -> StageIdentity;

    /// Finds the reference marks; positions are void before.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn home(&mut self, cancel: &Cancel) -> Result<(), DeviceError>;

    /// Moves to a pose and waits until it stands; returns the position read back.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn move_to(&mut self, pose: Pose, cancel: &Cancel) -> Result<Pose, DeviceError>;

    /// Opens or closes the lamp's shutter and waits until it stands.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn set_shutter(&mut self, open: bool) -> Result<(), DeviceError>;

    /// Sets the lamp's level, 0 (off) to 1, and waits until it is warm.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn set_lamp(&mut self, level: f64, cancel: &Cancel) -> Result<(), DeviceError>;

    /// Reads the sensors now.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn sensors(&mut self) -> Result<Sensors, DeviceError>;

    /// Decelerates to a stop.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn stop(&mut self) -> Result<(), DeviceError>;

    /// Stops at once, shutter closed, lamp off; works in every state.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn emergency_stop(&mut self) -> Result<(), DeviceError>;

    /// Clears a latched fault after its cause is gone.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn rearm(&mut self) -> Result<(), DeviceError>;

    /// How the link has been doing; zeros where there is none.
    fn statistics(&self) -> LinkStatistics;
}

/// A camera that gives raw frames.
pub trait Camera: Send {
    /// What it is.
    fn info(&self) -> CameraInfo;

    /// Takes one frame; the exposure really taken stands in the frame.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError>;
}

impl Camera for Box<dyn Camera> {
    fn info(&self) -> CameraInfo {
        (**self).info()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        (**self).capture(exposure, cancel)
    }
}

/// Identity of a stage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageIdentity {
    /// Name or model.
    pub name: String,
    /// Serial number.
    pub serial: String,
    /// Firmware version.
    pub firmware: String,
    /// How often the firmware has booted; a change voids positions.
    pub boot_counter: u32,
}

/// What the sensors say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sensors {
    /// Lamp monitor, relative to nominal (1.0).
    pub lamp_monitor: f64,
    /// Temperature of the lamp housing, °C.
    pub temperature_c: f64,
    /// Height of the sample surface above F1, mm.
    pub sample_height_mm: f64,
    /// Whether the interlock loop is closed (safe).
    pub interlock_closed: bool,
}

/// Identity and raw format of a camera.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Name or model.
    pub name: String,
    /// Serial number.
    pub serial: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bits of a raw value.
    pub bits: u32,
}

/// Counters of the link to the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkStatistics {
    /// Frames sent, retransmissions included.
    pub sent: u64,
    /// Frames received intact.
    pub received: u64,
    /// Frames sent again.
    pub retransmitted: u64,
    /// Frames refused for a wrong CRC or framing.
    pub corrupted: u64,
    /// Frames received twice.
    pub duplicates: u64,
    /// Smoothed round trip.
    pub round_trip: Duration,
    /// Age of the last sign of life.
    pub silent_for: Duration,
    /// Sessions begun, one more after each silence, hang-up or restart.
    #[serde(default)]
    pub sessions: u32,
    /// The device's clock less the host's since the connection was opened, s; `None` before the first answered heartbeat.
    #[serde(default)]
    pub clock_offset_s: Option<f64>,
    /// How far that may be off, s: half the round trip it was taken over, and the clock's step.
    #[serde(default)]
    pub clock_error_s: Option<f64>,
}

/// What can go wrong with a device; the text says what to do next.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// No such port or device.
    #[error("{device} is not there; check the cable and `gonio doctor`, then try again")]
    Absent {
        /// Port or camera as the user named it.
        device: String,
    },
    /// Another program has it.
    #[error("{device} is in use by another program; close that program, or stop its scan with `gonio stop`")]
    InUse {
        /// Port or camera as the user named it.
        device: String,
    },
    /// The user may not open it.
    #[error(
        "permission to open {device} was denied; add yourself to the group that owns it (`gonio doctor` says how)"
    )]
    Denied {
        /// Port or camera as the user named it.
        device: String,
    },
    /// It went away in mid-work.
    #[error("{device} was unplugged or hung up; reconnect it and continue with --resume")]
    Gone {
        /// Port or camera as the user named it.
        device: String,
    },
    /// No answer in time.
    #[error("{device} did not answer {what} within {waited:?}; check power and cable")]
    Timeout {
        /// Port or camera as the user named it.
        device: String,
        /// What was asked.
        what: String,
        /// How long was waited.
        waited: Duration,
    },
    /// Speaks another protocol.
    #[error("{device} speaks protocol {found}, this program speaks {expected}; update the firmware or gonio")]
    Version {
        /// Port or camera as the user named it.
        device: String,
        /// Found.
        found: String,
        /// Expected.
        expected: String,
    },
    /// Nobody knows any more where its axes stand.
    #[error("positions are void: the device {why}; home it and go on")]
    PositionsVoid {
        /// What it did, or what was found.
        why: String,
    },
    /// The device has latched a fault.
    #[error("the device reports {fault}; {advice}")]
    Fault {
        /// What it says.
        fault: String,
        /// What to do.
        advice: String,
    },
    /// The device has latched a fault whose cause passes: it is waited for.
    #[error("the device reports {fault}; {advice}")]
    Suspended {
        /// What it says.
        fault: String,
        /// What to do.
        advice: String,
    },
    /// The device would not do it.
    #[error("the device refused {command}: {reason}")]
    Refused {
        /// What was asked.
        command: String,
        /// Why not.
        reason: String,
    },
    /// A frame that cannot be used.
    #[error("frame {sequence} is unusable: {reason}")]
    BadFrame {
        /// Number of the frame.
        sequence: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// A recorded session has no more, or something else was asked than was recorded.
    #[error("the recorded session holds no {what}")]
    NotRecorded {
        /// What was asked for.
        what: String,
    },
    /// The operating system said no.
    #[error("{device}: {reason}")]
    Io {
        /// Port or camera as the user named it.
        device: String,
        /// The system's words.
        reason: String,
    },
    /// A stop was asked for.
    #[error("stopped on request")]
    Cancelled,
}
