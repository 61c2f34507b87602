//! Lambert with an Ashikhmin–Shirley lobe: `f = cd/π + cs S(n) F`, with Schlick's `F = r0 + (1 − r0)(1 − h·v)^5` where r0 is given and
//! F = 1 where it is not (then it is the simplified form, Sopp 4.28). S(n) as in [`AshikhminShirleySimplified`].

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{
    AshikhminShirley, AshikhminShirleySimplified, ModelError, check::Check, over_lambert::over_lambert,
};
use crate::{Brdf, Rgb};

/// Plain diffuse term (not scaled by 1 − r0), lobe with an optional Fresnel factor. Reciprocal; conserves energy for
/// `diffuse + specular` ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LambertAshikhminShirley {
    /// cd per channel.
    pub diffuse: Rgb,
    /// cs per channel; with r0 the lobe at normal incidence is cs·r0.
    pub specular: Rgb,
    /// n ≥ 0.
    pub exponent: f64,
    /// Reflectance at normal incidence, 0…1; without it the lobe has no Fresnel factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r0: Option<f64>,
}

impl LambertAshikhminShirley {
    pub(super) fn check(&self) -> Result<(), ModelError> {
        let c = Check("lambert-ashikhmin-shirley");
        c.colour("diffuse", self.diffuse)?;
        c.colour("specular", self.specular)?;
        c.exponent("exponent", self.exponent)?;
        self.r0.map_or(Ok(()), |r0| c.r0("r0", r0))
    }
}

impl Brdf for LambertAshikhminShirley {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let lobe = match self.r0 {
            Some(r0) => AshikhminShirley::lobe(self.exponent, r0, light, view),
            None => AshikhminShirleySimplified::lobe(self.exponent, light, view),
        };
        over_lambert(light, view, self.diffuse, [(self.specular, lobe)])
    }

    fn sharpness(&self) -> f64 {
        self.exponent
    }
}
