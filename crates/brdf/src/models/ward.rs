//! Ward's isotropic Gaussian (Computer Graphics 26(2), 1992, eq. 4):
//!
//! ```text
//! f = cd/π + cs · exp(−tan² θh/α²) / (4π α² √((n·l)(n·v)))
//! ```

use std::f64::consts::PI;

use gonio_optics::{COS_FLOOR, Vec3};
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, half::Half, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// Lambert plus a Gaussian lobe of the half vector. Reciprocal; conserves energy for `diffuse + specular` ≤ 1 up to θi = 89.5°, beyond
/// which the root in the denominator lets the albedo grow without bound. Before that it loses: a narrow lobe returns cs cos θi.
///
/// Cosines are floored at 1e-6.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ward {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel.
    pub specular: Rgb,
    /// Root-mean-square slope α, 1e-4…10. The normalisation holds up to about 0.2; wider lobes return less.
    pub alpha: f64,
}

/// `exp(−tan² θh/α²)/(4π α²)`, which Ward's form and Dür's share.
pub(super) fn gaussian(alpha: f64, light: Vec3, view: Vec3) -> f64 {
    let half = Half::new(light, view);
    let c2 = 1.0 - half.sin2;
    if c2 <= 0.0 {
        return 0.0;
    }
    let a2 = alpha * alpha;
    (-half.sin2 / (a2 * c2)).exp() / (4.0 * PI * a2)
}

impl Ward {
    /// The lobe alone for cs = 1.
    #[must_use]
    pub fn lobe(alpha: f64, light: Vec3, view: Vec3) -> f64 {
        let cosines = light.z.max(COS_FLOOR) * view.z.max(COS_FLOOR);
        gaussian(alpha, light, view) / cosines.sqrt()
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("ward");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.alpha("alpha", self.alpha)
    }
}

impl Brdf for Ward {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobe = Self::lobe(self.alpha, light, view);
        over_lambert(light, view, self.diffuse, [(self.specular, lobe)])
    }

    // exp(−tan²/α²) and (n·h)^n have the same curvature at the peak for n = 2/α²
    fn sharpness(&self) -> f64 {
        2.0 / (self.alpha * self.alpha)
    }
}
