//! Normalised Blinn–Phong (Sopp 3.3): `f = cd/π + cs (n + 8)/(8π) (n·h)^n`.

use std::f64::consts::PI;

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, half::Half, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// Lambert plus a cosine lobe of the half vector. Reciprocal. The factor (n + 8)/(8π) is an approximation that
/// reflects up to 7.6 % too much near n = 8 (nothing at 0 and at large n): energy is conserved for `diffuse + 1.08 specular` ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlinnPhong {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel.
    pub specular: Rgb,
    /// n ≥ 0.
    pub exponent: f64,
}

impl BlinnPhong {
    /// The lobe alone for cs = 1.
    #[must_use]
    pub fn lobe(exponent: f64, light: Vec3, view: Vec3) -> f64 {
        (exponent + 8.0) / (8.0 * PI) * Half::new(light, view).power(exponent)
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("blinn-phong");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.exponent("exponent", self.exponent)
    }
}

impl Brdf for BlinnPhong {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobe = Self::lobe(self.exponent, light, view);
        over_lambert(light, view, self.diffuse, [(self.specular, lobe)])
    }

    fn sharpness(&self) -> f64 {
        self.exponent
    }
}
