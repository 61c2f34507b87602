//! Lambert with Ashikhmin and Shirley's anisotropic lobe (Journal of Graphics Tools 5(2), 2000, eq. 4; Sopp 4.13):
//!
//! ```text
//! f = cd/π + cs · √((nu + 1)(nv + 1))/(8π) · (n·h)^(nu cos² φh + nv sin² φh) / ((h·v) max(n·l, n·v)) · (r0 + (1 − r0)(1 − h·v)^5)
//! ```
//!
//! φh is the azimuth of the half vector on the sample, measured from its x axis; so the value depends on the azimuths of light and view
//! themselves and not on their difference alone.

use std::f64::consts::PI;

use gonio_optics::{Vec3, fresnel::schlick};
use serde::{Deserialize, Serialize};

use super::{
    ModelError,
    check::Check,
    half::{Half, larger_cos},
    over_lambert::over_lambert,
};
use crate::{Brdf, Rgb};

/// Brushed surfaces: a lobe of two widths. Reciprocal; conserves energy for `diffuse + specular` ≤ 1. `exponent_u` = `exponent_v` is the isotropic lobe.
///
/// Denominators are floored at 1e-6; at θi = θo = 90°, φ = 180° the half vector is the normal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AshikhminShirleyAnisotropic {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel.
    pub specular: Rgb,
    /// Exponent along the sample's x axis, ≥ 0.
    pub exponent_u: f64,
    /// Exponent along its y axis, ≥ 0.
    pub exponent_v: f64,
    /// Reflectance at normal incidence, 0…1.
    pub r0: f64,
}

impl AshikhminShirleyAnisotropic {
    /// The lobe alone for cs = 1.
    #[must_use]
    pub fn lobe(&self, light: Vec3, view: Vec3) -> f64 {
        let half = Half::new(light, view);
        let (x, y) = (light.x + view.x, light.y + view.y);
        let across = x * x + y * y;
        let share = if across > 0.0 { x * x / across } else { 0.5 };
        let exponent = self.exponent_u * share + self.exponent_v * (1.0 - share);
        let norm = ((self.exponent_u + 1.0) * (self.exponent_v + 1.0)).sqrt();
        schlick(half.hv, self.r0) * norm * half.power(exponent)
            / (8.0 * PI * half.hv * larger_cos(light, view))
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("ashikhmin-shirley-anisotropic");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.exponent("exponent_u", self.exponent_u)?;
        c.exponent("exponent_v", self.exponent_v)?;
        c.r0("r0", self.r0)
    }
}

impl Brdf for AshikhminShirleyAnisotropic {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobe = self.lobe(light, view);
        over_lambert(light, view, self.diffuse, [(self.specular, lobe)])
    }

    fn sharpness(&self) -> f64 {
        self.exponent_u.max(self.exponent_v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::AshikhminShirley;
    use gonio_optics::Angle;

    const MODEL: AshikhminShirleyAnisotropic = AshikhminShirleyAnisotropic {
        diffuse: [0.0; 3],
        specular: [1.0; 3],
        exponent_u: 200.0,
        exponent_v: 20.0,
        r0: 0.1,
    };

    fn direction(theta: f64, phi: f64) -> Vec3 {
        Vec3::from_polar(Angle::from_degrees(theta), Angle::from_degrees(phi))
    }

    #[test]
    fn equal_exponents_are_the_isotropic_lobe_at_every_azimuth() {
        let m = AshikhminShirleyAnisotropic { exponent_v: 200.0, ..MODEL };
        for turn in [0.0, 30.0, 77.0] {
            let (l, v) = (direction(40.0, turn), direction(35.0, turn + 170.0));
            let want = AshikhminShirley::lobe(200.0, 0.1, l, v);
            assert!((m.lobe(l, v) / want - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn the_lobe_is_narrow_along_the_axis_of_the_larger_exponent_and_turns_with_the_sample() {
        let at = |phi: f64| MODEL.lobe(direction(0.0, 0.0), direction(20.0, phi));
        assert!(at(0.0) < 0.2 * at(90.0));
        // light and view exchanged, at azimuths of their own
        let (l, v) = (direction(50.0, 20.0), direction(30.0, 210.0));
        assert!((MODEL.lobe(l, v) / MODEL.lobe(v, l) - 1.0).abs() < 1e-14);
        // turned by 180° the sample looks the same, by 90° it does not
        let turned = |by: f64| MODEL.lobe(direction(50.0, 20.0 + by), direction(30.0, 210.0 + by));
        assert!(
            (turned(180.0) / turned(0.0) - 1.0).abs() < 1e-12
                && (turned(90.0) / turned(0.0) - 1.0).abs() > 0.05
        );
    }
}
