//! Lambert: `f = cd/π` (Sopp 3.1).

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check};
use crate::{Brdf, Rgb};

/// The perfect diffuser times an albedo. Reciprocal; conserves energy for `diffuse` ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lambert {
    /// Albedo per channel, 0…1 (a base under a coat may exceed 1).
    pub diffuse: Rgb,
}

impl Lambert {
    pub(super) fn check(&self) -> Result<(), ModelError> {
        Check("lambert").colour("diffuse", self.diffuse)
    }
}

impl Brdf for Lambert {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        self.diffuse.map(|d| d * std::f64::consts::FRAC_1_PI)
    }
}
