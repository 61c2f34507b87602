//! Ashikhmin–Shirley in the full isotropic form, (4.17) + (4.18) of Sopp with his corrected diffuse term:
//!
//! ```text
//! f = 28/(23π) (1 − r0) (1 − (1 − n·l/2)^5)(1 − (1 − n·v/2)^5) cd  +  S(n) · (r0 + (1 − r0)(1 − h·v)^5) · cs
//! S = (n + 1)/(8π) (n·h)^n / ((h·v) max(n·l, n·v))
//! ```

use std::f64::consts::PI;

use gonio_optics::{Vec3, fresnel::schlick};
use serde::{Deserialize, Serialize};

use super::{AshikhminShirleySimplified, ModelError, check::Check, half::Half};
use crate::{Brdf, Rgb};

/// The full form. Reciprocal; conserves energy for `diffuse`, `specular` ≤ 1 where h·v is near the cosine of incidence
/// (the lobe's Fresnel share and the diffuse (1 − r0) add up to at most 1 there).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AshikhminShirley {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel.
    pub specular: Rgb,
    /// n ≥ 0.
    pub exponent: f64,
    /// Reflectance at normal incidence, R_s in the thesis, 0…1.
    pub r0: f64,
}

impl AshikhminShirley {
    /// The diffuse term for cd = 1.
    #[must_use]
    pub fn diffuse_term(r0: f64, light: Vec3, view: Vec3) -> f64 {
        let side = |c: f64| 1.0 - (1.0 - 0.5 * c.max(0.0)).powi(5);
        28.0 / (23.0 * PI) * (1.0 - r0) * side(light.z) * side(view.z)
    }

    /// The lobe for cs = 1, Schlick's factor included.
    #[must_use]
    pub fn lobe(exponent: f64, r0: f64, light: Vec3, view: Vec3) -> f64 {
        schlick(Half::new(light, view).hv, r0) * AshikhminShirleySimplified::lobe(exponent, light, view)
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("ashikhmin-shirley");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.exponent("exponent", self.exponent)?;
        c.r0("r0", self.r0)
    }
}

impl Brdf for AshikhminShirley {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        let diffuse = Self::diffuse_term(self.r0, light, view);
        let lobe = Self::lobe(self.exponent, self.r0, light, view);
        [0, 1, 2].map(|c| self.diffuse[c] * diffuse + self.specular[c] * lobe)
    }

    fn sharpness(&self) -> f64 {
        self.exponent
    }
}
