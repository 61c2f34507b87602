//! Where the sample holder stands.

use gonio_optics::Angle;
use serde::{Deserialize, Serialize};

/// Tilt and spin of the holder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Tilt; for the nominal instrument the angle of incidence.
    pub tilt: Angle,
    /// Spin about the sample normal.
    pub spin: Angle,
}

impl Pose {
    /// A pose from degrees.
    #[must_use]
    pub const fn from_degrees(tilt_deg: f64, spin_deg: f64) -> Self {
        Self { tilt: Angle::from_degrees(tilt_deg), spin: Angle::from_degrees(spin_deg) }
    }

    /// A pose from radians: the exact way back from [`Angle::radians`], which degrees are not.
    #[must_use]
    pub const fn from_radians(tilt: f64, spin: f64) -> Self {
        Self { tilt: Angle::from_radians(tilt), spin: Angle::from_radians(spin) }
    }
}

/// In files a pose is written in degrees.
#[derive(Serialize, Deserialize)]
struct Degrees {
    tilt_deg: f64,
    spin_deg: f64,
}

impl Serialize for Pose {
    fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        Degrees { tilt_deg: self.tilt.degrees(), spin_deg: self.spin.degrees() }.serialize(s)
    }
}

impl<'de> Deserialize<'de> for Pose {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let v = Degrees::deserialize(d)?;
        Ok(Self::from_degrees(v.tilt_deg, v.spin_deg))
    }
}

impl std::fmt::Display for Pose {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "tilt {:.3}, spin {:.3}", self.tilt, self.spin)
    }
}
