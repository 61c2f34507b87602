//! Ashikhmin–Shirley in Sopp's simplified form (4.28):
//! `f = cd/π + cs (n + 1)/(8π) (n·h)^n / ((h·v) max(n·l, n·v))`.

use gonio_optics::{COS_FLOOR, Vec3};
use serde::{Deserialize, Serialize};

use crate::{Brdf, Rgb};

/// Lambert plus an isotropic Ashikhmin–Shirley lobe without Fresnel term. Reciprocal; energy is conserved while
/// `diffuse + specular` ≤ 1, roughly.
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
        let s = light + view;
        let norm2 = s.norm_squared();
        let (sin2_h, hv) = if norm2 > 1e-24 {
            // sin² of the half vector's polar angle keeps its digits where cos is near 1
            ((s.x * s.x + s.y * s.y) / norm2, 0.5 * norm2.sqrt())
        } else {
            (0.0, COS_FLOOR)
        };
        // (n·h)^n = (1 − sin²)^{n/2}
        let power = (0.5 * exponent * (-sin2_h.min(1.0)).ln_1p()).exp();
        (exponent + 1.0) * power
            / (8.0 * std::f64::consts::PI * hv.max(COS_FLOOR) * light.z.max(view.z).max(COS_FLOOR))
    }
}

impl Brdf for AshikhminShirleySimplified {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        let lobe = Self::lobe(self.exponent, light, view);
        [0, 1, 2].map(|c| self.diffuse[c] * std::f64::consts::FRAC_1_PI + self.specular[c] * lobe)
    }
}
