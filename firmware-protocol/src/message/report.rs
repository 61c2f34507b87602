//! Device to host.

use serde::{Deserialize, Serialize};

/// Everything a device says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ToHost {
    /// About a command; sent as data.
    Reply {
        /// The command's id.
        id: u32,
        /// What became of it.
        reply: Reply,
    },
    /// A fault has been latched; sent as data, without being asked.
    Fault {
        /// Which.
        fault: Fault,
        /// When, by the device's clock since its start.
        uptime_ms: u32,
    },
    /// Answer to each heartbeat; sent as a datagram.
    Telemetry(Telemetry),
    /// Answer to each emergency stop; sent as a datagram.
    EmergencyStopped {
        /// Id of the emergency stop.
        id: u32,
    },
}

/// What became of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reply {
    /// Begun; another reply follows at its end. Commands that end at once skip this.
    Accepted,
    /// Ended as asked.
    Done(Outcome),
    /// Not begun.
    Rejected(Reason),
    /// Begun and not finished, because of a fault (`Some`), or a stop command (`None`).
    Aborted(Option<Fault>),
}

/// What a finished command gives back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// Nothing to tell.
    Nothing,
    /// The position reached, by the encoders (home, move, stop).
    At(Position),
    /// Sensors.
    Sensors(SensorReadings),
    /// State.
    Status(Status),
    /// Pulses given to the camera since the device's start, this one included.
    Triggered {
        /// How many.
        count: u32,
    },
}

/// Why a command was not begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reason {
    /// A fault is latched; re-arm first.
    FaultLatched(Fault),
    /// Positions are void since the last start; home first.
    NotHomed,
    /// A move or homing is under way.
    Busy,
    /// The target lies outside the axis' limits.
    OutsideLimits {
        /// Which axis.
        axis: Axis,
        /// Lower limit.
        min_udeg: i32,
        /// Upper limit.
        max_udeg: i32,
    },
    /// Speed or acceleration is 0 or above what the device can do.
    Rate {
        /// Largest speed.
        max_speed_udeg_s: u32,
        /// Largest acceleration.
        max_accel_udeg_s2: u32,
    },
    /// The lamp level is above 1,000,000.
    Level,
    /// The interlock is open.
    InterlockOpen,
    /// The command's id is lower than the device can remember; it may have been executed before.
    Forgotten,
    /// The cause of the fault is still there.
    FaultPersists(Fault),
}

/// Why the device made itself safe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// No heartbeat within the motion lease while something moved or the shutter was open.
    LeaseExpired,
    /// An axis did not follow. Positions are void.
    Stall {
        /// Which axis.
        axis: Axis,
    },
    /// The lid was opened.
    InterlockOpen,
    /// The lamp's housing is too hot.
    OverTemperature {
        /// Measured.
        temperature_mc: i32,
    },
    /// The host asked for an emergency stop.
    EmergencyStop,
}

/// An axis of the holder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Axis {
    /// Sets the angle of incidence.
    Tilt,
    /// Turns the sample about its normal.
    Spin,
}

/// Where the axes are, by their encoders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    /// Tilt axis.
    pub tilt_udeg: i32,
    /// Spin axis.
    pub spin_udeg: i32,
}

/// What the axes are doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Motion {
    /// Standing.
    #[default]
    Idle,
    /// Looking for zero.
    Homing,
    /// On the way to a target.
    Moving,
    /// Decelerating to a stop.
    Stopping,
}

/// State of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Starts of the device so far.
    pub boot: u32,
    /// Time since the last start.
    pub uptime_ms: u32,
    /// Positions are valid.
    pub homed: bool,
    /// What the axes are doing.
    pub motion: Motion,
    /// Where they are.
    pub position: Position,
    /// The shutter is open (not closed, that is: a shutter on its way counts as open).
    pub shutter_open: bool,
    /// The lamp burns.
    pub lamp_on: bool,
    /// The lamp burns steadily at the level asked for.
    pub lamp_warm: bool,
    /// Level asked for.
    pub lamp_level_ppm: u32,
    /// The interlock is closed.
    pub interlock_closed: bool,
    /// The latched fault.
    pub fault: Option<Fault>,
    /// Pulses given to the camera since the last start.
    pub triggers: u32,
}

/// Readings of the sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SensorReadings {
    /// Lamp monitor behind the shutter's bypass; 1,000,000 is the nominal output of a warm lamp.
    pub lamp_monitor_ppm: u32,
    /// Temperature of the lamp's housing.
    pub lamp_mc: i32,
    /// Temperature of the air beside the sample.
    pub ambient_mc: i32,
    /// Height of the sample's surface above the mirror's focus F1, along its normal.
    pub sample_height_um: i32,
    /// The interlock is closed.
    pub interlock_closed: bool,
}

/// Short state, sent with every heartbeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Telemetry {
    /// Counter of the heartbeat that this answers.
    pub counter: u32,
    /// State.
    pub status: Status,
}
