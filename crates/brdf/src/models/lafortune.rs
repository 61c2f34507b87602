//! Lafortune's generalised cosine lobes (Lafortune et al., SIGGRAPH 97, pp. 117–126), the isotropic case Cx = Cy:
//!
//! ```text
//! f = cd/π + Σ_k s_k · (n + 2)/(2π) · max(0, Cxy (l_x v_x + l_y v_y) + Cz l_z v_z)^n
//! ```
//!
//! Cxy = −1, Cz = 1 is Phong; |Cxy| > Cz leans the lobe towards the horizon (off-specular), |Cxy| < Cz towards the normal; Cxy > 0 looks
//! back at the light. A common factor k of Cxy and Cz is the factor kⁿ on s, so both are kept within 1 and fits set the larger to 1: of
//! parameters published without the factor (n + 2)/(2π), divide Cxy and Cz by m = max(|Cxy|, Cz) and multiply s by mⁿ · 2π/(n + 2).

use std::f64::consts::TAU;

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// One lobe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LafortuneLobe {
    /// s per channel.
    pub specular: Rgb,
    /// Weight of the tangential part, −1…1; −1 mirrors, 1 returns the light.
    pub cxy: f64,
    /// Weight of the normal part, 0…1.
    pub cz: f64,
    /// n ≥ 0.
    pub exponent: f64,
}

/// Lambert and cosine lobes about scaled mirror directions. Reciprocal; conserves energy for
/// `diffuse + Σ specular · max(|cxy|, cz)^exponent` ≤ 1, so for `diffuse + Σ specular` ≤ 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lafortune {
    /// cd per channel.
    pub diffuse: Rgb,
    /// The lobes.
    pub lobes: Vec<LafortuneLobe>,
}

impl LafortuneLobe {
    /// `(n + 2)/(2π) max(0, Cxy (l_x v_x + l_y v_y) + Cz l_z v_z)^n`, for s = 1.
    #[must_use]
    pub fn value(&self, light: Vec3, view: Vec3) -> f64 {
        let dot = self.cxy * (light.x * view.x + light.y * view.y) + self.cz * light.z * view.z;
        if dot <= 0.0 {
            return 0.0;
        }
        // rounding may leave the dot product of unit vectors above 1, which a large exponent would not forgive
        (self.exponent + 2.0) / TAU * dot.min(1.0).powf(self.exponent)
    }
}

impl Lafortune {
    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("lafortune");
        c.colour("diffuse", self.diffuse)?;
        for lobe in &self.lobes {
            c.colour("lobes.specular", lobe.specular)?;
            c.stretch("lobes.cxy", lobe.cxy, -1.0)?;
            c.stretch("lobes.cz", lobe.cz, 0.0)?;
            c.exponent("lobes.exponent", lobe.exponent)?;
        }
        Ok(())
    }
}

impl Brdf for Lafortune {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobes = self.lobes.iter().map(|l| (l.specular, l.value(light, view)));
        over_lambert(light, view, self.diffuse, lobes)
    }

    // as Phong's: the angle to the mirror direction is twice that of the half vector
    fn sharpness(&self) -> f64 {
        self.lobes.iter().map(|l| 4.0 * l.exponent).fold(0.0, f64::max)
    }
}
