//! Lambert with any number of GGX (Trowbridge–Reitz) lobes:
//!
//! ```text
//! f = cd/π + Σ_k s_k · F(h·v) D(h) G(l, v) / (4 (n·l)(n·v))
//! D = α² / (π (c² (α² − 1) + 1)²),  c = n·h        Walter et al., EGSR 2007, eq. 33; ∫ D c dω = 1
//! F = r0 + (1 − r0)(1 − h·v)^5                     Schlick
//! G = 1/(1 + Λ(l) + Λ(v)),  Λ = (√(1 + α² tan² θ) − 1)/2
//! ```
//!
//! G is Smith's with the heights of light and view correlated (Heitz, JCGT 3(2), 2014, eq. 72 and 99), not the product of two terms of
//! Walter's paper. The factor G/(4 (n·l)(n·v)) is taken in one piece, `1/(2 (v √(α² + (1 − α²) l²) + l √(α² + (1 − α²) v²)))`.

use std::f64::consts::PI;

use gonio_optics::{COS_FLOOR, Vec3, fresnel::schlick};
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, half::Half, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// One lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GgxLobe {
    /// s per channel.
    pub specular: Rgb,
    /// Width α, 1e-4…10: the slope at which D c⁴ has fallen to a quarter. Renderers' "roughness" is often √α.
    pub alpha: f64,
    /// Reflectance at normal incidence, 0…1.
    pub r0: f64,
}

/// Lambert and GGX lobes, longer in the tail than Cook–Torrance's. Reciprocal; conserves energy for `diffuse + Σ specular` ≤ 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ggx {
    /// cd per channel.
    pub diffuse: Rgb,
    /// The lobes.
    pub lobes: Vec<GgxLobe>,
}

impl GgxLobe {
    /// `F D G/(4 (n·l)(n·v))` for s = 1. Cosines floored at 1e-6.
    #[must_use]
    pub fn value(&self, light: Vec3, view: Vec3) -> f64 {
        let half = Half::new(light, view);
        let a2 = self.alpha * self.alpha;
        // c²(α² − 1) + 1 = α² c² + s²: no subtraction near the peak of a narrow lobe
        let width = a2 * (1.0 - half.sin2) + half.sin2;
        let d = a2 / (PI * width * width);
        let (cl, cv) = (light.z.max(COS_FLOOR), view.z.max(COS_FLOOR));
        let root = |c: f64| (a2 * (1.0 - c * c).max(0.0) + c * c).sqrt();
        0.5 * schlick(half.hv, self.r0) * d / (cv * root(cl) + cl * root(cv))
    }
}

impl Ggx {
    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("ggx");
        c.colour("diffuse", self.diffuse)?;
        for lobe in &self.lobes {
            c.colour("lobes.specular", lobe.specular)?;
            c.alpha("lobes.alpha", lobe.alpha)?;
            c.r0("lobes.r0", lobe.r0)?;
        }
        Ok(())
    }
}

impl Brdf for Ggx {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobes = self.lobes.iter().map(|l| (l.specular, l.value(light, view)));
        over_lambert(light, view, self.diffuse, lobes)
    }

    // (α² + tan²)^−2 and (n·h)^n have the same curvature at the peak for n = 4/α²
    fn sharpness(&self) -> f64 {
        self.lobes.iter().map(|l| 4.0 / (l.alpha * l.alpha)).fold(0.0, f64::max)
    }
}
