//! The settings of a camera: everything automatic off, gain and exposure by hand, and what it took read back.
//!
//! Order matters: while automatic exposure is on, many cameras refuse an exposure time or take it and go on changing it. What a camera takes need not be
//! what it was given; the value read back is the one that is used and recorded.

use crate::camera::guard::guarded;
use gonio_instrument::DeviceError;
use std::time::Duration;
use v4l::Device;
use v4l::control::{Control, Flags, Type, Value};

const EXPOSURE_AUTO: u32 = 0x009a_0901;
const EXPOSURE_ABSOLUTE: u32 = 0x009a_0902;
const GAIN: u32 = 0x0098_0913;
const ANALOGUE_GAIN: u32 = 0x009e_0903;

/// Unit of the exposure time (UVC 1.5, 4.2.2.1.4; V4L2_CID_EXPOSURE_ABSOLUTE).
pub const EXPOSURE_UNIT: Duration = Duration::from_micros(100);

/// What changes a picture by itself, and the value that stops it. Cameras have some of these; none has all.
const OFF: &[(u32, i64, &str)] = &[
    (0x009a_0903, 0, "exposure, dynamic frame rate"),
    (0x0098_0912, 0, "automatic gain"),
    (0x0098_0920, 0, "automatic brightness"),
    (0x0098_090c, 0, "automatic white balance"),
    (0x0098_0919, 0, "automatic hue"),
    (0x009a_090c, 0, "automatic focus"),
    (0x0098_091c, 0, "backlight compensation"),
    (0x0098_0918, 0, "power line frequency"),
];

/// Manual exposure, and, for cameras that only know that, manual time with automatic iris.
const MANUAL: [i64; 2] = [1, 2];

/// A control of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControlFacts {
    /// Its number.
    pub id: u32,
    /// Its name.
    pub name: String,
    /// Smallest value.
    pub minimum: i64,
    /// Largest value.
    pub maximum: i64,
    /// Step.
    pub step: u64,
    /// Value now; `None` for what has no single number.
    pub value: Option<i64>,
    /// It can be set.
    pub writable: bool,
}

/// What was set when a camera was opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// Name and value read back, in the order set.
    pub fixed: Vec<(String, i64)>,
}

/// The controls of a camera, in the driver's order.
pub fn list(device: &Device) -> Result<Vec<ControlFacts>, String> {
    // a control of a type that the library does not know makes it panic
    let described = guarded(|| device.query_controls())?.map_err(|e| e.to_string())?;
    let of_use =
        described.into_iter().filter(|c| c.typ != Type::CtrlClass && !c.flags.contains(Flags::DISABLED));
    let facts = of_use.map(|c| ControlFacts {
        value: if c.flags.contains(Flags::WRITE_ONLY) { None } else { read(device, c.id) },
        id: c.id,
        name: c.name,
        minimum: c.minimum,
        maximum: c.maximum,
        step: c.step,
        writable: !c.flags.contains(Flags::READ_ONLY),
    });
    Ok(facts.collect())
}

fn read(device: &Device, id: u32) -> Option<i64> {
    match guarded(|| device.control(id)).ok()?.ok()?.value {
        Value::Integer(n) => Some(n),
        Value::Boolean(b) => Some(i64::from(b)),
        _ => None,
    }
}

/// Sets a value and reads back what the camera took.
fn set(device: &Device, id: u32, value: i64) -> std::io::Result<i64> {
    device.set_control(Control { id, value: Value::Integer(value) })?;
    read(device, id).ok_or_else(|| std::io::Error::other("its value cannot be read back"))
}

/// Takes everything that is automatic out of the way and the gain to its smallest value.
///
/// # Errors
/// [`DeviceError`] for a camera that stays automatic or has no exposure time to set.
pub fn take_over(device: &Device, name: &str) -> Result<Settings, DeviceError> {
    let refuse =
        |reason: String| DeviceError::Refused { command: format!("manual settings of {name}"), reason };
    let mut settings = Settings::default();
    if let Some(mode) = read(device, EXPOSURE_AUTO) {
        let taken = if MANUAL[0] == mode {
            Some(mode)
        } else {
            MANUAL.into_iter().find(|m| set(device, EXPOSURE_AUTO, *m).is_ok_and(|taken| taken == *m))
        };
        let Some(taken) = taken else {
            return Err(refuse(format!(
                "its exposure stays automatic (mode {mode}); set it by hand with `v4l2-ctl -c auto_exposure=1`, or use a camera with manual exposure"
            )));
        };
        settings.fixed.push(("exposure mode".to_owned(), taken));
    }
    for (id, value, what) in OFF {
        if read(device, *id).is_none() {
            continue;
        }
        // one that is inactive beside another cannot be set, and does nothing
        match set(device, *id, *value) {
            Ok(taken) => {
                if taken != *value {
                    tracing::warn!("{name}: {what} stays at {taken}");
                }
                settings.fixed.push(((*what).to_owned(), taken));
            }
            Err(error) => tracing::debug!("{name}: {what} cannot be set: {error}"),
        }
    }
    for (id, what) in [(GAIN, "gain"), (ANALOGUE_GAIN, "analogue gain")] {
        if read(device, id).is_none() {
            continue;
        }
        // drivers clamp what lies below their range
        let lowest = list(device)
            .ok()
            .and_then(|all| all.into_iter().find(|c| c.id == id))
            .map_or(i64::from(i32::MIN), |c| c.minimum);
        match set(device, id, lowest) {
            Ok(taken) => settings.fixed.push((what.to_owned(), taken)),
            Err(error) => return Err(refuse(format!("its {what} cannot be set ({error})"))),
        }
    }
    if read(device, EXPOSURE_ABSOLUTE).is_none() {
        return Err(refuse("it has no exposure time that can be set (exposure_time_absolute); use a camera with manual exposure".to_owned()));
    }
    Ok(settings)
}

/// Sets the exposure time and gives the one that the camera took.
pub fn set_exposure(device: &Device, wanted: Duration) -> std::io::Result<Duration> {
    set(device, EXPOSURE_ABSOLUTE, exposure_units(wanted)).map(exposure_of)
}

/// An exposure time in the camera's unit, at least one.
#[must_use]
pub fn exposure_units(time: Duration) -> i64 {
    let half = EXPOSURE_UNIT / 2;
    let units = time.saturating_add(half).as_nanos() / EXPOSURE_UNIT.as_nanos();
    i64::try_from(units).unwrap_or(i64::MAX).clamp(1, i64::from(i32::MAX))
}

/// The time that a value of the control means.
#[must_use]
pub fn exposure_of(units: i64) -> Duration {
    EXPOSURE_UNIT * u32::try_from(units).unwrap_or(0)
}

/// Shortest and longest exposure time, where the camera tells them.
#[must_use]
pub fn exposure_limits(controls: &[ControlFacts]) -> Option<[Duration; 2]> {
    let c = controls.iter().find(|c| c.id == EXPOSURE_ABSOLUTE)?;
    Some([exposure_of(c.minimum), exposure_of(c.maximum)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_rounded_to_the_units_of_the_camera_and_never_to_none() {
        let units = |us| exposure_units(Duration::from_micros(us));
        assert_eq!((units(0), units(20), units(149), units(150), units(1_000_000)), (1, 1, 1, 2, 10_000));
        assert_eq!(exposure_units(Duration::MAX), i64::from(i32::MAX));
        for n in [1, 7, 312, 10_000] {
            assert_eq!(exposure_units(exposure_of(n)), n);
        }
        assert_eq!(exposure_of(-5), Duration::ZERO);
    }

    #[test]
    fn limits_are_those_of_the_exposure_time() {
        let control = |id, minimum, maximum| ControlFacts {
            id,
            name: String::new(),
            minimum,
            maximum,
            step: 1,
            value: None,
            writable: true,
        };
        let controls = [control(GAIN, 0, 9), control(EXPOSURE_ABSOLUTE, 3, 20_000)];
        assert_eq!(exposure_limits(&controls), Some([Duration::from_micros(300), Duration::from_secs(2)]));
        assert_eq!(exposure_limits(&controls[..1]), None);
    }
}
