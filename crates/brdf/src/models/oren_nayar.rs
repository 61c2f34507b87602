//! Oren and Nayar's rough diffuser, the form they call qualitative (SIGGRAPH 94, pp. 239–246):
//!
//! ```text
//! f = cd/π · (A + B max(0, cos(φi − φo)) sin α tan β),   α = max(θi, θo), β = min(θi, θo)
//! A = 1 − 0.5 σ²/(σ² + 0.33),  B = 0.45 σ²/(σ² + 0.09)   σ in radians
//! ```
//!
//! `cos(φi − φo) sin α tan β` is `(l_x v_x + l_y v_y)/max(n·l, n·v)`: no angle is needed. The third term of their full form and the light
//! that facets send to each other are left out, as the authors do; so f stays linear in the colour.

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check, half::larger_cos, over_lambert::over_lambert};
use crate::{Brdf, Rgb};

/// A diffuser that is brighter towards the light; σ = 0 is Lambert. Reciprocal. A white one gives back up to 1.5 % more than it gets at
/// grazing incidence (A + B/2, at σ = 11°): energy is conserved for `1.016 diffuse` ≤ 1.
///
/// The denominator is floored at 1e-6.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrenNayar {
    /// Albedo of a facet per channel.
    pub diffuse: Rgb,
    /// Standard deviation σ of the facets' slope angles, 0°…90°.
    pub sigma_deg: f64,
}

impl OrenNayar {
    /// π f for cd = 1.
    #[must_use]
    pub fn term(sigma_deg: f64, light: Vec3, view: Vec3) -> f64 {
        let sigma = sigma_deg.to_radians();
        let s2 = sigma * sigma;
        let a = 1.0 - 0.5 * s2 / (s2 + 0.33);
        let b = 0.45 * s2 / (s2 + 0.09);
        a + b * (light.x * view.x + light.y * view.y).max(0.0) / larger_cos(light, view)
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("oren-nayar");
        c.colour("diffuse", self.diffuse)?;
        c.slope_deg("sigma_deg", self.sigma_deg)
    }
}

impl Brdf for OrenNayar {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let term = Self::term(self.sigma_deg, light, view);
        over_lambert(light, view, self.diffuse.map(|d| d * term), [])
    }
}
