//! The description of an instrument: geometry of mirror, camera, lamp and holder, read from TOML.
//!
//! Lab frame: origin at the sample focus F1, +z points from the camera focus F2 to F1. Lengths in mm, angles in degrees
//! (the names say so). The mirror is the prolate ellipsoid with foci F1 = 0 and F2 = (0, 0, −2c), c² = a² − b².

use gonio_optics::{Angle, Vec3};
use serde::{Deserialize, Serialize};

use crate::{BayerPattern, FileError, Misalignment, Plan, TextureCamera};

/// Format name in the file.
pub const FORMAT: &str = "gonio-instrument";
/// Newest version of the format.
pub const VERSION: u32 = 1;

/// A whole instrument.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Always [`FORMAT`].
    #[serde(default = "format_name")]
    pub format: String,
    /// Version of the format.
    #[serde(default = "format_version")]
    pub version: u32,
    /// Name of the instrument; references are valid for the instrument they were measured on.
    #[serde(default)]
    pub name: String,
    /// The ellipsoidal mirror.
    pub mirror: Mirror,
    /// The camera at F2.
    pub camera: CameraGeometry,
    /// The stationary lamp.
    pub lamp: Lamp,
    /// The sample holder.
    pub holder: Holder,
    /// The plan used where none is given.
    pub plan: Plan,
    /// The texture camera; where it is left out, [`TextureCamera::standard`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture: Option<TextureCamera>,
    /// What a geometric calibration found, to be applied to the nominal geometry above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Misalignment>,
    /// From what the calibration was made, and how surely.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration_record: Option<crate::calibration::CalibrationRecord>,
    /// What a radiometric calibration found of sensor, lamp and light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiometry: Option<crate::radiometry::Radiometry>,
}

/// What tells the kind of a file before anything else is asked of it.
#[derive(Default, Deserialize)]
struct Head {
    format: Option<String>,
    version: Option<u32>,
}

fn format_name() -> String {
    FORMAT.to_owned()
}

fn format_version() -> u32 {
    VERSION
}

/// The prolate ellipsoidal mirror.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mirror {
    /// Semi-major axis, along z, mm.
    pub a: f64,
    /// Semi-minor axis, mm.
    pub b: f64,
    /// Angle from +z at F1 up to which the mirror reaches, degrees.
    pub rim_eta_deg: f64,
    /// Reflectance of the coating, 0…1.
    pub reflectance: f64,
}

impl Mirror {
    /// Half the distance of the foci, mm.
    #[must_use]
    pub fn c_mm(&self) -> f64 {
        ((self.a - self.b) * (self.a + self.b)).max(0.0).sqrt()
    }
}

/// Camera pose, lens and sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraGeometry {
    /// Centre of the entrance pupil in the lab, mm.
    pub pupil: [f64; 3],
    /// Optical axis, from the camera into the scene.
    pub look: [f64; 3],
    /// Direction of decreasing row number.
    pub up: [f64; 3],
    /// Focal length, mm.
    pub f_mm: f64,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Pixel pitch, µm.
    pub pitch_um: f64,
    /// Diameter of the entrance pupil, mm.
    pub pupil_diameter_mm: f64,
    /// Colour filter pattern.
    pub pattern: BayerPattern,
    /// Bits of a raw value.
    pub bits: u32,
    /// Full well in electrons; the converter's top code above black.
    pub full_well_e: f64,
    /// Read noise, electrons r.m.s.
    pub read_noise_e: f64,
    /// Black level, raw counts.
    pub black_level: u32,
    /// Shortest and longest exposure, s.
    pub exposure_s: [f64; 2],
}

impl CameraGeometry {
    /// Largest raw value.
    #[must_use]
    pub fn top_code(&self) -> u32 {
        (1u32 << self.bits) - 1
    }

    /// Conversion gain: electrons per raw count; the full well reaches the top code.
    #[must_use]
    pub fn electrons_per_count(&self) -> f64 {
        self.full_well_e / f64::from(self.top_code() - self.black_level)
    }

    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }
}

/// The lamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lamp {
    /// Unit vector from the sample towards the lamp, lab frame.
    pub direction: [f64; 3],
    /// Angular radius α seen from the sample, degrees; Ω = π sin² α.
    pub half_angle_deg: f64,
    /// Radius of the opening in the mirror, mm, around the point where the beam crosses it.
    pub opening_radius_mm: f64,
    /// Radius of the beam at the sample, normal to the beam, mm.
    pub spot_radius_mm: f64,
}

impl Lamp {
    /// Unit vector from the sample towards the lamp, lab frame.
    #[must_use]
    pub fn direction(&self) -> Vec3 {
        Vec3::from(self.direction).normalized()
    }

    /// Angular radius α.
    #[must_use]
    pub fn half_angle(&self) -> Angle {
        Angle::from_degrees(self.half_angle_deg)
    }
}

/// The sample holder with its two motors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Holder {
    /// Axis of the tilt motor through F1, lab frame; a right-handed turn by +t makes θi = t.
    pub tilt_axis: [f64; 3],
    /// Sample normal at tilt 0, lab frame; also the spin axis at tilt 0.
    pub normal_at_zero: [f64; 3],
    /// Lowest and highest tilt, degrees.
    pub tilt_limits_deg: [f64; 2],
    /// Radius of the sample disc, mm.
    pub disc_radius_mm: f64,
    /// Thickness of the sample disc, mm; it lies behind the sample plane.
    pub disc_thickness_mm: f64,
    /// The cylinder behind the disc, along −normal.
    pub body: Body,
    /// The shaft that carries the holder.
    pub shaft: Shaft,
    /// The crank between body and shaft.
    pub crank: Crank,
    /// Distance of the sample centre from the spin axis, mm, so that spins see different flakes.
    pub spin_offset_mm: f64,
}

impl Holder {
    /// Unit tilt axis, lab frame.
    #[must_use]
    pub fn tilt_axis(&self) -> Vec3 {
        Vec3::from(self.tilt_axis).normalized()
    }

    /// Unit normal at tilt 0, lab frame.
    #[must_use]
    pub fn normal_at_zero(&self) -> Vec3 {
        Vec3::from(self.normal_at_zero).normalized()
    }
}

/// Cylinder behind the disc.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Radius, mm.
    pub radius_mm: f64,
    /// Length along −normal from the back of the disc, mm.
    pub length_mm: f64,
}

/// Shaft from the crank out through the mirror.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shaft {
    /// Unit direction from F1 outwards, lab frame; it does not turn with the tilt.
    pub direction: [f64; 3],
    /// Radius, mm.
    pub radius_mm: f64,
    /// Distance from F1 at which it begins, mm.
    pub from_mm: f64,
    /// Radius of its opening in the mirror, mm.
    pub opening_radius_mm: f64,
}

/// Crank: a round bar parallel to the shaft axis offset behind the sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crank {
    /// Distance behind the sample plane, mm.
    pub behind_mm: f64,
    /// Radius, mm.
    pub radius_mm: f64,
}

impl Description {
    /// Reads and checks a description.
    ///
    /// # Errors
    /// [`FileError`] with line and excerpt for syntax, or the field and what would be accepted.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        // another kind of file, or a newer one, has fields that this program does not know: say so, not which
        let head: Head = toml::from_str(text).unwrap_or_default();
        if head.format.as_deref().is_some_and(|f| f != FORMAT) {
            return Err(FileError::Format { expected: FORMAT, found: head.format.unwrap_or_default() });
        }
        if let Some(found) = head.version.filter(|v| *v > VERSION) {
            return Err(FileError::Version { what: "instrument description", found, known: VERSION });
        }
        let d: Self = toml::from_str(text)
            .map_err(|e| FileError::Syntax { what: "instrument description", reason: e.to_string() })?;
        d.check()?;
        Ok(d)
    }

    /// The description as TOML; [`Description::from_toml`] gives it back.
    ///
    /// # Errors
    /// [`FileError::Syntax`] if a value cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String, FileError> {
        toml::to_string(self)
            .map_err(|e| FileError::Syntax { what: "instrument description", reason: e.to_string() })
    }

    fn check(&self) -> Result<(), FileError> {
        let positive = |field: &str, v: f64| {
            if v > 0.0 && v.is_finite() {
                Ok(())
            } else {
                Err(FileError::value(field, v, "a positive number"))
            }
        };
        let unit = |field: &str, v: [f64; 3]| {
            let n = Vec3::from(v).norm();
            if (n - 1.0).abs() < 1e-3 { Ok(()) } else { Err(FileError::value(field, v, "a unit vector")) }
        };
        positive("mirror.a", self.mirror.a)?;
        positive("mirror.b", self.mirror.b)?;
        if self.mirror.b >= self.mirror.a {
            return Err(FileError::value(
                "mirror.b",
                self.mirror.b,
                "less than mirror.a (a prolate ellipsoid)",
            ));
        }
        if !(0.0..=180.0).contains(&self.mirror.rim_eta_deg) {
            return Err(FileError::value("mirror.rim_eta_deg", self.mirror.rim_eta_deg, "0 to 180"));
        }
        if !(self.mirror.reflectance > 0.0 && self.mirror.reflectance <= 1.0) {
            return Err(FileError::value(
                "mirror.reflectance",
                self.mirror.reflectance,
                "above 0, at most 1",
            ));
        }
        let c = &self.camera;
        unit("camera.look", c.look)?;
        unit("camera.up", c.up)?;
        positive("camera.f_mm", c.f_mm)?;
        positive("camera.pitch_um", c.pitch_um)?;
        positive("camera.full_well_e", c.full_well_e)?;
        if c.size.iter().any(|&n| n == 0 || n > 16384) {
            return Err(FileError::value("camera.size", c.size, "1 to 16384 pixels a side"));
        }
        if !(8..=16).contains(&c.bits) {
            return Err(FileError::value("camera.bits", c.bits, "8 to 16"));
        }
        if c.black_level >= c.top_code() {
            return Err(FileError::value("camera.black_level", c.black_level, "less than the top code"));
        }
        if !(c.exposure_s[0] > 0.0 && c.exposure_s[1] >= c.exposure_s[0] && c.exposure_s[1].is_finite()) {
            return Err(FileError::value(
                "camera.exposure_s",
                c.exposure_s,
                "[shortest, longest] in seconds",
            ));
        }
        unit("lamp.direction", self.lamp.direction)?;
        if !(self.lamp.half_angle_deg > 0.0 && self.lamp.half_angle_deg < 30.0) {
            return Err(FileError::value(
                "lamp.half_angle_deg",
                self.lamp.half_angle_deg,
                "above 0, below 30",
            ));
        }
        positive("lamp.spot_radius_mm", self.lamp.spot_radius_mm)?;
        let h = &self.holder;
        unit("holder.tilt_axis", h.tilt_axis)?;
        unit("holder.normal_at_zero", h.normal_at_zero)?;
        unit("holder.shaft.direction", h.shaft.direction)?;
        if !(h.tilt_limits_deg[0] < h.tilt_limits_deg[1]
            && h.tilt_limits_deg[0] >= -90.0
            && h.tilt_limits_deg[1] <= 90.0)
        {
            return Err(FileError::value(
                "holder.tilt_limits_deg",
                h.tilt_limits_deg,
                "[low, high] within ±90",
            ));
        }
        if let Some(t) = &self.texture {
            t.check()?;
        }
        if let Some(r) = &self.radiometry {
            r.check(self.camera.pixels())?;
        }
        self.plan.check(self)
    }
}
