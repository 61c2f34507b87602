//! What replies mean to a user: each fault and each refusal with what to do next.

use gonio_instrument::DeviceError;
use gonio_protocol::message::{Axis, Command, Fault, Outcome, Reason, Reply};

/// Result of a final reply; `None` while a command has only been accepted.
pub(super) fn result_of(command: Command, reply: Reply) -> Option<Result<Outcome, DeviceError>> {
    match reply {
        Reply::Accepted => None,
        Reply::Done(outcome) => Some(Ok(outcome)),
        Reply::Aborted(None) => Some(Err(DeviceError::Cancelled)),
        Reply::Aborted(Some(fault)) => Some(Err(fault_error(fault))),
        Reply::Rejected(Reason::FaultLatched(fault) | Reason::FaultPersists(fault)) => {
            Some(Err(fault_error(fault)))
        }
        Reply::Rejected(reason) => Some(Err(DeviceError::Refused {
            command: describe_command(command),
            reason: describe_reason(reason),
        })),
    }
}

/// A fault as an error with advice.
pub fn fault_error(fault: Fault) -> DeviceError {
    let advice = match fault {
        Fault::LeaseExpired => "the host was too slow or the cable too bad; re-arm and go on",
        Fault::Stall { .. } => "free the axis, then re-arm and home",
        Fault::InterlockOpen => "close the lid, then re-arm; the lamp has to warm up again",
        Fault::OverTemperature { .. } => "let the lamp cool and see to its fan, then re-arm",
        Fault::EmergencyStop => "re-arm when it is safe; the lamp has to warm up again",
    };
    let (passes, fault) =
        (matches!(fault, Fault::InterlockOpen | Fault::OverTemperature { .. }), describe_fault(fault));
    let advice = advice.to_owned();
    if passes { DeviceError::Suspended { fault, advice } } else { DeviceError::Fault { fault, advice } }
}

/// A fault in words.
pub fn describe_fault(fault: Fault) -> String {
    match fault {
        Fault::LeaseExpired => "that it heard no heartbeat while it was moving or exposed".to_owned(),
        Fault::Stall { axis } => format!("that the {} axis has stalled; positions are void", axis_name(axis)),
        Fault::InterlockOpen => "an open interlock".to_owned(),
        Fault::OverTemperature { temperature_mc } => {
            format!("a lamp housing of {:.1} °C", f64::from(temperature_mc) / 1e3)
        }
        Fault::EmergencyStop => "an emergency stop".to_owned(),
    }
}

/// The error of a command that a restart of the device has ended.
pub(super) fn restarted_error(boot: u32) -> DeviceError {
    DeviceError::PositionsVoid {
        why: format!("has restarted (start number {boot}); see to its power supply"),
    }
}

/// A command in words.
pub(super) fn describe_command(command: Command) -> String {
    let deg = |udeg: i32| f64::from(udeg) / 1e6;
    match command {
        Command::Home => "homing".to_owned(),
        Command::Move { tilt_udeg, spin_udeg, .. } => {
            format!("the move to tilt {}°, spin {}°", deg(tilt_udeg), deg(spin_udeg))
        }
        Command::Stop => "a stop".to_owned(),
        Command::Shutter { open: true } => "opening the shutter".to_owned(),
        Command::Shutter { open: false } => "closing the shutter".to_owned(),
        Command::Lamp { .. } => "switching the lamp".to_owned(),
        Command::Sensors => "reading the sensors".to_owned(),
        Command::CameraTrigger { .. } => "a camera trigger".to_owned(),
        Command::Status => "its status".to_owned(),
        Command::Rearm => "re-arming".to_owned(),
    }
}

fn describe_reason(reason: Reason) -> String {
    let deg = |udeg: i32| f64::from(udeg) / 1e6;
    match reason {
        // Told as faults, see above.
        Reason::FaultLatched(fault) | Reason::FaultPersists(fault) => describe_fault(fault),
        Reason::NotHomed => "its positions are void; home it first".to_owned(),
        Reason::Busy => "it is moving already; wait, or stop it".to_owned(),
        Reason::OutsideLimits { axis, min_udeg, max_udeg } => {
            format!("the {} axis reaches from {}° to {}°", axis_name(axis), deg(min_udeg), deg(max_udeg))
        }
        Reason::Rate { max_speed_udeg_s, max_accel_udeg_s2 } => format!(
            "speed and acceleration must be above 0 and at most {}°/s and {}°/s²",
            f64::from(max_speed_udeg_s) / 1e6,
            f64::from(max_accel_udeg_s2) / 1e6
        ),
        Reason::Level => "the level must be 0 to 1".to_owned(),
        Reason::InterlockOpen => "the interlock is open; close the lid".to_owned(),
        Reason::Forgotten => "it cannot tell whether it has executed the command before".to_owned(),
    }
}

fn axis_name(axis: Axis) -> &'static str {
    match axis {
        Axis::Tilt => "tilt",
        Axis::Spin => "spin",
    }
}
