//! Ashikhmin–Shirley in Sopp's simplified form (4.28):
//! `f = cd/π + cs (n + 1)/(8π) (n·h)^n / ((h·v) max(n·l, n·v))`.

use std::f64::consts::PI;

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{
    ModelError,
    check::Check,
    half::{Half, larger_cos},
    over_lambert::over_lambert,
};
use crate::{Brdf, Rgb};

/// Lambert plus an isotropic Ashikhmin–Shirley lobe without Fresnel term. Reciprocal; conserves energy for `diffuse + specular` ≤ 1.
///
/// Denominators are floored at 1e-6; at θi = θo = 90°, φ = 180° the half vector is the normal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AshikhminShirleySimplified {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel.
    pub specular: Rgb,
    /// n ≥ 0; 1e6 is nearly a mirror.
    pub exponent: f64,
}

impl AshikhminShirleySimplified {
    /// The lobe alone for cs = 1: `(n + 1)/(8π) (n·h)^n / ((h·v) max(n·l, n·v))`; denominators floored at 1e-6.
    ///
    /// `θi = θo = 90°, φ = 180°` (l = −v) takes h = n.
    #[must_use]
    pub fn lobe(exponent: f64, light: Vec3, view: Vec3) -> f64 {
        let half = Half::new(light, view);
        (exponent + 1.0) * half.power(exponent) / (8.0 * PI * half.hv * larger_cos(light, view))
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("ashikhmin-shirley-simplified");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.exponent("exponent", self.exponent)
    }
}

impl Brdf for AshikhminShirleySimplified {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobe = Self::lobe(self.exponent, light, view);
        over_lambert(light, view, self.diffuse, [(self.specular, lobe)])
    }

    fn sharpness(&self) -> f64 {
        self.exponent
    }
}
