//! A smooth clear coat over any base: `f = T(θi) T(θo)/n² · f_base(refracted directions)`, plus the gloss as a separate term.
//!
//! The base and the gloss are kept apart because the gloss has no value without a lamp: its radiance is finite only for a lamp of finite
//! size. A renderer with an area or environment light reflects it in the coat itself (weight [`Coat::reflectance`]) and adds
//! [`Coat::base_through`]; one with a lamp of known angular radius uses [`Coat::with_gloss`]; a measured cell holds
//! [`crate::average::gloss_cell_mean`] beside the mean of the base.

use gonio_optics::{Angle, Vec3, fresnel};
use serde::{Deserialize, Serialize};

use super::{ModelError, check::Check};
use crate::{Brdf, Rgb};

/// A dielectric coat. Inter-reflection inside is not modelled, so π f_base may exceed 1. Reciprocal where the base is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coat {
    /// Refractive index, above 1.
    pub index: f64,
}

impl Coat {
    /// Fresnel reflectance of the coat at the cosine of the angle of incidence.
    #[must_use]
    pub fn reflectance(&self, cos: f64) -> f64 {
        fresnel::dielectric(cos, self.index)
    }

    /// The base seen through the coat, gloss left out.
    #[must_use]
    pub fn base_through(&self, base: &dyn Brdf, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        let t = |cos: f64| 1.0 - self.reflectance(cos);
        let k = t(light.z) * t(view.z) / (self.index * self.index);
        base.eval(fresnel::refract(light, self.index), fresnel::refract(view, self.index)).map(|f| k * f)
    }

    /// Gloss of a lamp of angular radius α, in 1/sr: uniform inside its mirror image, `F(θi)/(Ω_lamp cos θi)`, Ω = π sin² α.
    ///
    /// Zero outside the image, for a lamp without size (its gloss is a delta, which has no value) and at θi = 90°.
    #[must_use]
    pub fn gloss(&self, light: Vec3, view: Vec3, half_angle: Angle) -> f64 {
        let mirror = Vec3::new(-light.x, -light.y, light.z);
        if light.z <= 0.0 || view.z <= 0.0 || view.angle_to(mirror) > half_angle {
            return 0.0;
        }
        self.gloss_level(light.z, half_angle)
    }

    /// Level of the gloss inside the lamp's image, `F(θi)/(Ω_lamp cos θi)` in 1/sr; 0 for a lamp without size.
    #[must_use]
    pub fn gloss_level(&self, cos_i: f64, half_angle: Angle) -> f64 {
        let s = half_angle.sin();
        if s <= 0.0 {
            return 0.0;
        }
        self.reflectance(cos_i) / (std::f64::consts::PI * s * s * cos_i.max(gonio_optics::COS_FLOOR))
    }

    /// Base and gloss together for a lamp of angular radius α centred on `light`; the base is taken at the lamp's centre.
    #[must_use]
    pub fn with_gloss(&self, base: &dyn Brdf, light: Vec3, view: Vec3, half_angle: Angle) -> Rgb {
        let gloss = self.gloss(light, view, half_angle);
        self.base_through(base, light, view).map(|f| f + gloss)
    }

    pub(super) fn check(&self) -> Result<(), ModelError> {
        Check("coat").index("coat.index", self.index)
    }
}
