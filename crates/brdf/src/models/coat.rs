//! A smooth clear coat over any base: `f = T(θi) T(θo)/n² · f_base(refracted directions)`, plus the gloss as a separate term.

use gonio_optics::{Angle, Vec3, fresnel};
use serde::{Deserialize, Serialize};

use crate::{Brdf, Rgb};

/// A dielectric coat. Inter-reflection inside is not modelled, so π f_base may exceed 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coat {
    /// Refractive index, above 1.
    pub index: f64,
}

impl Coat {
    /// The base seen through the coat, gloss left out.
    #[must_use]
    pub fn base_through(&self, base: &dyn Brdf, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        let t = |cos: f64| 1.0 - fresnel::dielectric(cos, self.index);
        let k = t(light.z) * t(view.z) / (self.index * self.index);
        base.eval(fresnel::refract(light, self.index), fresnel::refract(view, self.index)).map(|f| k * f)
    }

    /// Gloss of a lamp of angular radius α, in 1/sr: uniform inside its mirror image, `F(θi)/(Ω_lamp cos θi)`, Ω = π sin² α.
    #[must_use]
    pub fn gloss(&self, light: Vec3, view: Vec3, half_angle: Angle) -> f64 {
        let mirror = Vec3::new(-light.x, -light.y, light.z);
        if light.z <= 0.0 || view.z <= 0.0 || view.angle_to(mirror) > half_angle {
            return 0.0;
        }
        let s = half_angle.sin();
        fresnel::dielectric(light.z, self.index)
            / (std::f64::consts::PI * s * s * light.z.max(gonio_optics::COS_FLOOR))
    }
}
