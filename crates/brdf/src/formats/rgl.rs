//! RGL `.bsdf` files of the EPFL material database, RGB version (Dupuy and Jakob 2018, "An adaptive parameterization for efficient
//! material acquisition and rendering").
//!
//! With the half direction m and `u(ω) = (√(2θ/π), (φ + π)/2π)`, φ of m counted from the light's azimuth for isotropic samples:
//!
//! ```text
//! f cos θo = rgb(V⁻¹(u(m))) · D(u(m)) / (4 σ(u(l)))
//! ```
//!
//! The files were measured to a little over 80°; towards θo = 90° their f cos θo does not vanish, so cos θo is held at cos 85° as the divisor.
//!
//! D is the distribution of microfacet normals, σ the projected area of the microsurface, and V⁻¹ the map of the unit square that makes the
//! distribution of visible normals uniform; V and rgb are given for several incident directions and interpolated between them.
//! [`tensor`] is the container, [`warp`] the map and the look-ups.

mod tensor;
mod warp;

use std::f64::consts::PI;

use gonio_optics::Vec3;

use self::tensor::Tensors;
use self::warp::{Image, Parameters, Warp};
use super::Problem;
use crate::{Brdf, Rgb};

pub(super) use self::tensor::MAGIC;

const NAME: &str = "RGL tensor";
/// cos 85°, the smallest divisor.
const SMALLEST_COS: f64 = 0.087_155_742_747_658_17;

/// A material of the database.
#[derive(Clone, Debug)]
pub struct Rgl {
    /// As its makers describe it.
    description: String,
    isotropic: bool,
    parameters: Parameters,
    ndf: Image,
    sigma: Image,
    vndf: Warp,
    rgb: Image,
}

/// Reads a material.
///
/// # Errors
/// [`Problem`] where fields are missing, their sizes do not agree, or numbers are not finite.
pub fn read(bytes: &[u8]) -> Result<Rgl, Problem> {
    let file = Tensors::parse(bytes)?;
    let parameters = Parameters::new(file.f32s("phi_i", 1)?.values, file.f32s("theta_i", 1)?.values)?;
    let ndf = file.f32s("ndf", 2)?;
    let sigma = file.f32s("sigma", 2)?;
    let vndf = file.f32s("vndf", 4)?;
    if file.has("wavelengths") || !file.has("rgb") {
        return Err(Problem::malformed(
            NAME,
            "field rgb",
            "absent",
            "the RGB version of the material (…_rgb.bsdf)",
        ));
    }
    let rgb = file.f32s("rgb", 5)?;
    let slices = [parameters.phi_len(), parameters.theta_len()];
    if vndf.shape[..2] != slices || rgb.shape[..2] != slices || rgb.shape[2] != 3 {
        let found = format!("vndf {:?}, rgb {:?}", vndf.shape, rgb.shape);
        return Err(Problem::malformed(NAME, "sizes", found, format!("{slices:?} and for rgb 3 first")));
    }
    if sigma.values.iter().any(|&s| s <= 0.0) {
        return Err(Problem::malformed(NAME, "sigma", "a value that is not positive", "projected areas"));
    }
    Ok(Rgl {
        description: file.text("description"),
        isotropic: parameters.phi_len() <= 2,
        vndf: Warp::new(&vndf.values, [vndf.shape[3], vndf.shape[2]])?,
        rgb: Image::new(rgb.values, [rgb.shape[4], rgb.shape[3]])?,
        ndf: Image::new(ndf.values, [ndf.shape[1], ndf.shape[0]])?,
        sigma: Image::new(sigma.values, [sigma.shape[1], sigma.shape[0]])?,
        parameters,
    })
}

impl Rgl {
    /// What its makers say of it.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Whether the azimuth of the light is of no account.
    #[must_use]
    pub const fn is_isotropic(&self) -> bool {
        self.isotropic
    }
}

/// (θ, φ) of a direction; θ is accurate near 0, φ is 0 at the pole.
fn polar(d: Vec3) -> (f64, f64) {
    (d.x.hypot(d.y).atan2(d.z), if d.x == 0.0 && d.y == 0.0 { 0.0 } else { d.y.atan2(d.x) })
}

fn unit(theta: f64, phi: f64) -> [f64; 2] {
    [(theta * 2.0 / PI).max(0.0).sqrt(), (phi + PI) / (2.0 * PI)]
}

impl Brdf for Rgl {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z <= 0.0 || view.z <= 0.0 {
            return [0.0; 3];
        }
        let (theta_i, phi_i) = polar(light);
        let (theta_m, phi_m) = polar((light + view).normalized());
        let mut u = unit(theta_m, if self.isotropic { phi_m - phi_i } else { phi_m });
        u[1] -= u[1].floor();
        let slices = self.parameters.around(phi_i, theta_i);
        let sample = self.vndf.invert(u, &slices);
        let scale = self.ndf.eval(u, &[(0, 1.0)])
            / (4.0 * self.sigma.eval(unit(theta_i, phi_i), &[(0, 1.0)]) * view.z.max(SMALLEST_COS));
        [0, 1, 2].map(|c| {
            let planes = slices.map(|(k, w)| (3 * k + c, w));
            self.rgb.eval(sample, &planes).max(0.0) * scale
        })
    }
}

#[cfg(test)]
pub(super) mod tests;
