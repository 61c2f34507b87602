//! Host to device.

use serde::{Deserialize, Serialize};

/// Everything a host says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ToDevice {
    /// Do something; sent as data. Ids rise by one or more with each command of a client.
    Command {
        /// Repeated in every reply to this command.
        id: u32,
        /// What to do.
        command: Command,
    },
    /// The host lives; sent as a datagram. Renews both leases if `counter` is above all heard in this session.
    Heartbeat {
        /// Rises by one with each heartbeat of a session.
        counter: u32,
    },
    /// Stop at once, close the shutter, latch a fault; sent as a datagram, past every queue, and repeated by the
    /// host until [`ToHost::EmergencyStopped`](super::ToHost::EmergencyStopped) with the same id comes back.
    EmergencyStop {
        /// Repeated in the answer.
        id: u32,
    },
}

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// Find the zero of both axes. Until that is done no move is accepted.
    Home,
    /// Turn both axes to a position; they start together and each ends as soon as it can.
    Move {
        /// Target of the tilt axis.
        tilt_udeg: i32,
        /// Target of the spin axis.
        spin_udeg: i32,
        /// Largest speed of either axis, micro-degrees per second, not 0.
        speed_udeg_s: u32,
        /// Acceleration and deceleration, micro-degrees per second², not 0.
        accel_udeg_s2: u32,
    },
    /// Decelerate to a stop; positions stay valid. The move under way ends as aborted.
    Stop,
    /// Open or close the shutter before the lamp.
    Shutter {
        /// Open it.
        open: bool,
    },
    /// Switch the lamp, or change its level.
    Lamp {
        /// Burn.
        on: bool,
        /// Level while burning, of the nominal level; up to 1,000,000.
        level_ppm: u32,
    },
    /// Read the sensors.
    Sensors,
    /// Give the camera's trigger line a pulse.
    CameraTrigger {
        /// Length of the pulse.
        exposure_us: u32,
    },
    /// Tell the state.
    Status,
    /// Clear a latched fault, if its cause is gone.
    Rearm,
}
