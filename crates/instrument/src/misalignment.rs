//! A real instrument's departures from its description: the truth of a virtual one, or what a calibration found.

use serde::{Deserialize, Serialize};

use crate::FileError;

/// Errors added to a [`crate::Description`]. Zero everywhere is the nominal instrument.
///
/// `*_turn_deg` are rotation vectors in degrees (lab axes for mirror, camera axes for the camera; two-component turns are about the two
/// axes normal to the thing turned, as [`gonio_optics::Vec3::orthonormal_basis`] gives them). `k1`, `k2` scale image points by
/// 1 + k1 r² + k2 r⁴, r in units of the focal length.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Misalignment {
    /// Shift of the mirror, lab frame, mm.
    pub mirror_shift_mm: [f64; 3],
    /// Turn of the mirror about F1, lab frame, degrees.
    pub mirror_turn_deg: [f64; 3],
    /// Error of the semi-minor axis, mm.
    pub mirror_b_error_mm: f64,
    /// Shift of the entrance pupil, lab frame, mm.
    pub camera_shift_mm: [f64; 3],
    /// Turn of the camera about its pupil, camera axes (right, down, look), degrees.
    pub camera_turn_deg: [f64; 3],
    /// Relative error of the focal length.
    pub focal_length_error: f64,
    /// Shift of the principal point, pixels (right, down).
    pub principal_point_px: [f64; 2],
    /// Radial distortion, second order.
    pub k1: f64,
    /// Radial distortion, fourth order.
    pub k2: f64,
    /// Turn of the lamp direction, degrees.
    pub lamp_direction_deg: [f64; 2],
    /// Turn of the tilt axis, degrees.
    pub tilt_axis_turn_deg: [f64; 2],
    /// Turn of the spin axis at tilt 0, degrees.
    pub spin_axis_turn_deg: [f64; 2],
    /// Added to the tilt read back, degrees.
    pub tilt_zero_deg: f64,
    /// Standard deviation of a tilt position about what is read back, degrees.
    pub tilt_repeatability_deg: f64,
    /// Relative drift of the lamp over a plan.
    pub lamp_drift: f64,
    /// Height of the sample's surface above F1, mm: a panel thicker than the one that the holder was set for. No calibration finds it; it is measured before
    /// each scan.
    #[serde(skip_serializing_if = "is_zero")]
    pub sample_height_mm: f64,
    /// Departures of sensor and light; no geometric calibration finds them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radiometry: Option<crate::Imperfections>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

impl Misalignment {
    /// Reads a misalignment file.
    ///
    /// # Errors
    /// [`FileError::Syntax`] with line and excerpt; [`FileError::Value`] for a number that is not finite.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let m: Self = toml::from_str(text)
            .map_err(|e| FileError::Syntax { what: "misalignment file", reason: e.to_string() })?;
        let scalars = [
            m.mirror_b_error_mm,
            m.focal_length_error,
            m.k1,
            m.k2,
            m.tilt_zero_deg,
            m.lamp_drift,
            m.sample_height_mm,
        ];
        if scalars.iter().chain(&m.mirror_shift_mm).chain(&m.camera_shift_mm).any(|v| !v.is_finite()) {
            return Err(FileError::value("misalignment", "a value that is not finite", "finite numbers"));
        }
        if let Some(r) = &m.radiometry {
            r.check()?;
        }
        Ok(m)
    }
}
