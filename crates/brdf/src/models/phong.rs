//! Normalised Phong (Sopp 3.2): `f = cd/π + cs (n + 2)/(2π) (r·v)^n`, r the mirror direction of the light.

use std::f64::consts::TAU;

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, half::cosine_power, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// Lambert plus a cosine lobe about the mirror direction. Reciprocal; conserves energy for `diffuse + specular` ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phong {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel.
    pub specular: Rgb,
    /// n ≥ 0.
    pub exponent: f64,
}

impl Phong {
    /// The lobe alone for cs = 1; zero more than 90° from the mirror direction.
    #[must_use]
    pub fn lobe(exponent: f64, light: Vec3, view: Vec3) -> f64 {
        let mirror = Vec3::new(-light.x, -light.y, light.z);
        // r·v = 1 − |r − v|²/2, so sin² = (1 − r·v)(1 + r·v) keeps its digits near the peak
        let below = 0.5 * (mirror - view).norm_squared();
        let power = if below >= 1.0 { 0.0 } else { cosine_power(below * (2.0 - below), exponent) };
        (exponent + 2.0) / TAU * power
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("phong");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.exponent("exponent", self.exponent)
    }
}

impl Brdf for Phong {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobe = Self::lobe(self.exponent, light, view);
        over_lambert(light, view, self.diffuse, [(self.specular, lobe)])
    }

    // the angle to the mirror direction is twice that of the half vector
    fn sharpness(&self) -> f64 {
        4.0 * self.exponent
    }
}
