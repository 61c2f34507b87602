//! Fresnel reflectance and refraction at a smooth dielectric interface.
//!
//! Unpolarised light; indices are real. Sopp (2.4) is the exact form, (2.5)–(2.7) Schlick's approximation.

use crate::{Vec3, edge::safe_sqrt};

/// Exact unpolarised reflectance of an interface from air into `index`, at the cosine of the angle of incidence (Sopp 2.4).
///
/// 1 at grazing incidence. `index` ≥ 1; below 1 total reflection gives 1.
#[must_use]
pub fn dielectric(cos_i: f64, index: f64) -> f64 {
    let c = cos_i.clamp(0.0, 1.0);
    // g² = n² − sin² θi, written so that n → 1 and θ → 90° keep their digits
    let g2 = (index - 1.0) * (index + 1.0) + c * c;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    // (g − c)(g + c) = n² − 1, so g − c needs no subtraction of near numbers
    let n2m1 = (index - 1.0) * (index + 1.0);
    let gpc = g + c;
    let rs = n2m1 / (gpc * gpc);
    // r_p / r_s = (c(g + c) − 1)/(c(g − c) + 1)
    let gmc = n2m1 / gpc;
    let ratio = (c * gpc - 1.0) / (c * gmc + 1.0);
    0.5 * rs * rs * (1.0 + ratio * ratio)
}

/// Schlick's approximation `r0 + (1 − r0)(1 − cos θ)^5` (Sopp 2.5).
#[must_use]
pub fn schlick(cos: f64, r0: f64) -> f64 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    r0 + (1.0 - r0) * m2 * m2 * m
}

/// Reflectance at normal incidence, `((n − 1)/(n + 1))²`.
#[must_use]
pub fn r0_from_index(index: f64) -> f64 {
    let r = (index - 1.0) / (index + 1.0);
    r * r
}

/// A unit direction pointing away from the surface in air, carried into a coat of `index` (Snell; Kirchner 1, 2).
///
/// Points away from the base on the inside, too: both are "towards the light" or "towards the viewer".
#[must_use]
pub fn refract(d: Vec3, index: f64) -> Vec3 {
    Vec3::new(d.x / index, d.y / index, refracted_cos(d.z, index))
}

/// The cosine inside a coat of `index` for a cosine outside, `√(n² − 1 + cos²)/n`: sums of what is positive, so that an index near 1 and a
/// grazing direction keep their digits, which `1 − sin²/n²` would lose.
#[must_use]
pub fn refracted_cos(cos: f64, index: f64) -> f64 {
    safe_sqrt((index - 1.0) * (index + 1.0) + cos * cos) / index
}
