//! Microfacet terms as renderers write them: distributions, Smith's shadowing in the variants in use, and the albedo of a lobe.

use std::f64::consts::PI;

use gonio_optics::Vec3;

use super::layers::Distribution;

/// The half vector's cosine n·h, and h·v, of two unit directions above the surface.
pub(super) fn half(light: Vec3, view: Vec3) -> (f64, f64) {
    let h = (light + view).normalized();
    (h.z, h.dot(view))
}

/// Density of normals at cosine `c`.
pub(super) fn density(distribution: Distribution, alpha: f64, c: f64) -> f64 {
    let (a2, c2) = (alpha * alpha, c * c);
    match distribution {
        Distribution::Beckmann => ((1.0 - 1.0 / c2) / a2).exp() / (PI * a2 * c2 * c2),
        Distribution::Ggx => {
            let w = c2 * (a2 - 1.0) + 1.0;
            a2 / (PI * w * w)
        }
    }
}

/// Smith's G1 at cosine `c`; Beckmann's by the rational function of Walter et al. 2007 that Mitsuba uses.
pub(super) fn one_way(distribution: Distribution, alpha: f64, c: f64) -> f64 {
    let tan2 = (1.0 - c * c).max(0.0) / (c * c).max(1e-300);
    let slope2 = alpha * alpha * tan2;
    match distribution {
        Distribution::Beckmann => {
            let a = slope2.max(1e-300).sqrt().recip();
            if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
        }
        Distribution::Ggx => 2.0 / (1.0 + (1.0 + slope2).sqrt()),
    }
}

/// Smith's G of GGX with correlated heights over 4 (n·l)(n·v), as MaterialX has it.
pub(super) fn correlated_visibility(alpha: f64, cl: f64, cv: f64) -> f64 {
    let a2 = alpha * alpha;
    let root = |c: f64| (a2 + (1.0 - a2) * c * c).sqrt();
    0.5 / (cl * root(cv) + cv * root(cl))
}

/// Directional albedo of a GGX lobe with correlated heights and Schlick's factor between `r0` and 1, tabled over n·v.
pub(super) struct Albedo(Vec<f64>);

impl Albedo {
    const NODES: usize = 33;

    pub(super) fn new(alpha: f64, r0: f64) -> Self {
        Self((0..Self::NODES).map(|k| albedo(alpha, r0, (k as f64 / 32.0).max(1e-3))).collect())
    }

    pub(super) fn at(&self, cos: f64) -> f64 {
        let x = cos.clamp(0.0, 1.0) * 32.0;
        let k = (x as usize).min(Self::NODES - 2);
        let t = x - k as f64;
        self.0[k] * (1.0 - t) + self.0[k + 1] * t
    }
}

/// ∫ F D G/(4 (n·l)(n·v)) (n·l) dl, half vectors drawn on a lattice by D (n·h).
fn albedo(alpha: f64, r0: f64, cv: f64) -> f64 {
    const RINGS: usize = 48;
    let view = Vec3::new((1.0 - cv * cv).max(0.0).sqrt(), 0.0, cv);
    let mut sum = 0.0;
    for i in 0..RINGS {
        let u = (i as f64 + 0.5) / RINGS as f64;
        let tan2 = alpha * alpha * u / (1.0 - u);
        let c = (1.0 + tan2).sqrt().recip();
        let s = (1.0 - c * c).max(0.0).sqrt();
        for j in 0..RINGS {
            let phi = (j as f64 + 0.5) / RINGS as f64 * PI;
            let h = Vec3::new(s * phi.cos(), s * phi.sin(), c);
            let hv = h.dot(view);
            let cl = 2.0 * hv * h.z - view.z;
            if hv > 0.0 && cl > 0.0 {
                // weight of a half vector: f cos over its density, 4 (h·v) F V (n·l)/(n·h)
                let f = gonio_optics::fresnel::schlick(hv, r0);
                sum += f * correlated_visibility(alpha, cl, cv) * 4.0 * hv * cl / c;
            }
        }
    }
    sum / (RINGS * RINGS) as f64
}
