//! Lambert with any number of Cook–Torrance lobes in the modern normalisation:
//!
//! ```text
//! f = cd/π + Σ_k s_k · F(h·v) D(h) G(l, v) / (4 (n·l)(n·v))
//! D = exp((c² − 1)/(α² c²)) / (π α² c⁴),  c = n·h          Beckmann, ∫ D c dω = 1
//! F = r0 + (1 − r0)(1 − h·v)^5                             Schlick
//! G = min(1, 2 c (n·v)/(h·v), 2 c (n·l)/(h·v))             V-cavities
//! ```
//!
//! Golla's eq. 1 and the tables of Ngan and Günther use the 1982 form without the 4: the same numbers give four times this value, so
//! their s becomes 4 s here (with the 1/π of their form kept inside D).

use std::f64::consts::PI;

use gonio_optics::{COS_FLOOR, Vec3, fresnel::schlick};
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, half::Half, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// One lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CookTorranceLobe {
    /// s per channel.
    pub specular: Rgb,
    /// Root-mean-square slope α, 1e-4…10.
    pub alpha: f64,
    /// Reflectance at normal incidence, 0…1.
    pub r0: f64,
}

/// Lambert and Cook–Torrance lobes. Reciprocal; conserves energy for `diffuse + Σ specular` ≤ 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CookTorrance {
    /// cd per channel.
    pub diffuse: Rgb,
    /// The lobes; car paints need three.
    pub lobes: Vec<CookTorranceLobe>,
}

impl CookTorranceLobe {
    /// `F D G/(4 (n·l)(n·v))` for s = 1. Cosines floored at 1e-6.
    #[must_use]
    pub fn value(&self, light: Vec3, view: Vec3) -> f64 {
        let half = Half::new(light, view);
        let c2 = 1.0 - half.sin2;
        if c2 <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        let d = (-half.sin2 / (a2 * c2)).exp() / (PI * a2 * c2 * c2);
        let (cl, cv) = (light.z.max(COS_FLOOR), view.z.max(COS_FLOOR));
        // G/(cl·cv) in one piece: no factor of it overflows at grazing angles
        let g = (1.0 / (cl * cv)).min(2.0 * c2.sqrt() / (half.hv * cl.max(cv)));
        // exp underflows long before 1/c⁴ matters; 0 · ∞ must not become NaN
        if d > 0.0 { 0.25 * schlick(half.hv, self.r0) * d * g } else { 0.0 }
    }
}

impl CookTorrance {
    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("cook-torrance");
        c.colour("diffuse", self.diffuse)?;
        for lobe in &self.lobes {
            c.colour("lobes.specular", lobe.specular)?;
            c.alpha("lobes.alpha", lobe.alpha)?;
            c.r0("lobes.r0", lobe.r0)?;
        }
        Ok(())
    }
}

impl Brdf for CookTorrance {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobes = self.lobes.iter().map(|l| (l.specular, l.value(light, view)));
        over_lambert(light, view, self.diffuse, lobes)
    }

    // exp(−tan²/α²) and (n·h)^n have the same curvature at the peak for n = 2/α²
    fn sharpness(&self) -> f64 {
        self.lobes.iter().map(|l| 2.0 / (l.alpha * l.alpha)).fold(0.0, f64::max)
    }
}
