//! What must hold before anything moves.

use gonio_instrument::{CameraInfo, Description, Plan, Sensors};

/// Why a scan is not begun; nothing has moved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreflightError {
    /// The camera is not the description's.
    #[error(
        "the camera gives {found_width} x {found_height} pixels of {found_bits} bits, the instrument \"{instrument}\" expects {width} x {height} of {bits}; choose the camera's format or give the right --instrument"
    )]
    Camera {
        /// Name of the instrument.
        instrument: String,
        /// Columns found.
        found_width: u32,
        /// Rows found.
        found_height: u32,
        /// Bits found.
        found_bits: u32,
        /// Columns expected.
        width: u32,
        /// Rows expected.
        height: u32,
        /// Bits expected.
        bits: u32,
    },
    /// The plan does not fit the holder.
    #[error("the plan cannot be scanned: {reason}")]
    Plan {
        /// Field, what it says, and the limits.
        reason: String,
    },
    /// The lid is open.
    #[error("the interlock is open; close the lid and start again")]
    Interlock,
    /// The sample does not lie at F1.
    #[error(
        "the sample surface stands {found_mm:+.3} mm from F1, at most {tolerance_mm} mm is allowed; adjust its height and start again"
    )]
    SampleHeight {
        /// Height read.
        found_mm: f64,
        /// Largest departure.
        tolerance_mm: f64,
    },
}

/// Camera against description, plan against holder. A camera that does not tell its bits is taken at the description's word.
///
/// # Errors
/// [`PreflightError`].
pub fn check(instrument: &Description, plan: &Plan, camera: &CameraInfo) -> Result<(), PreflightError> {
    let [width, height] = instrument.camera.size;
    let bits = instrument.camera.bits;
    if (camera.width, camera.height) != (width, height) || (camera.bits != 0 && camera.bits != bits) {
        return Err(PreflightError::Camera {
            instrument: instrument.name.clone(),
            found_width: camera.width,
            found_height: camera.height,
            found_bits: camera.bits,
            width,
            height,
            bits,
        });
    }
    plan.check(instrument).map_err(|e| PreflightError::Plan { reason: e.to_string() })
}

/// Interlock closed, sample at F1.
///
/// # Errors
/// [`PreflightError`].
pub fn check_sensors(sensors: &Sensors, height_tolerance_mm: f64) -> Result<(), PreflightError> {
    if !sensors.interlock_closed {
        return Err(PreflightError::Interlock);
    }
    let found_mm = sensors.sample_height_mm;
    if found_mm.is_nan() || found_mm.abs() > height_tolerance_mm {
        return Err(PreflightError::SampleHeight { found_mm, tolerance_mm: height_tolerance_mm });
    }
    Ok(())
}
