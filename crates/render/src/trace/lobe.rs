//! Directions drawn where a reflectance is likely to be large: half of them over the cosine, half about the mirror direction for lobes.
//!
//! Reflectances come as functions alone, so that a mixture that fits any of them takes the place of a sampler for each:
//! `p(l) = ½ cos θ/π + ½ D(h)/(4 h·v)`, D(h) = (n + 1)/(2π) (n·h)^n, with the exponent n that [`gonio_brdf::Brdf::sharpness`] states, tempered so that tails
//! are met too. Without a lobe the cosine alone.

use std::f64::consts::{PI, TAU};

use gonio_optics::Vec3;

/// The mixture for one reflectance.
#[derive(Clone, Copy, Debug)]
pub struct Mixture {
    exponent: f64,
}

impl Mixture {
    /// For a lobe of this exponent; below 2 the cosine does.
    #[must_use]
    pub fn new(sharpness: f64) -> Self {
        let exponent = if sharpness.is_finite() { (0.5 * sharpness).min(20_000.0) } else { 0.0 };
        Self { exponent }
    }

    const fn has_lobe(self) -> bool {
        self.exponent >= 1.0
    }

    /// A local direction (z the normal) for the local view; it may point below the horizon, where it counts nothing.
    #[must_use]
    pub fn draw(self, view: Vec3, (u, v): (f64, f64)) -> Vec3 {
        let (lobe, u) = if self.has_lobe() {
            if u < 0.5 { (false, 2.0 * u) } else { (true, 2.0 * u - 1.0) }
        } else {
            (false, u)
        };
        let (s, c) = (TAU * v).sin_cos();
        if lobe {
            let z = (1.0 - u).powf(1.0 / (self.exponent + 1.0));
            let r = (1.0 - z * z).max(0.0).sqrt();
            let h = Vec3::new(r * c, r * s, z);
            h * (2.0 * h.dot(view)) - view
        } else {
            let r = u.sqrt();
            Vec3::new(r * c, r * s, (1.0 - u).max(0.0).sqrt())
        }
    }

    /// Its density per sr.
    #[must_use]
    pub fn density(self, light: Vec3, view: Vec3) -> f64 {
        let cosine = light.z.max(0.0) / PI;
        if !self.has_lobe() {
            return cosine;
        }
        let h = (light + view).normalized();
        let d = (self.exponent + 1.0) / TAU * h.z.max(0.0).powf(self.exponent);
        0.5 * cosine + 0.5 * d / (4.0 * h.dot(view).abs().max(1e-9))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_density_is_that_of_the_draws() {
        let view = Vec3::new(0.5, 0.1, 0.8).normalized();
        for sharpness in [0.0, 60.0] {
            let m = Mixture::new(sharpness);
            let n = 40_000;
            // the mean of (something)/density over draws is its integral over the sphere
            let (mut area, mut test) = (0.0, 0.0);
            for k in 0..n {
                let l = m.draw(
                    view,
                    ((f64::from(k) + 0.5) / f64::from(n), (f64::from(k) * 0.618_033_988_75).fract()),
                );
                assert!((l.norm() - 1.0).abs() < 1e-9);
                let p = m.density(l, view);
                if l.z > 0.0 {
                    area += l.z / p;
                    test += l.z * l.z * l.z / p;
                }
            }
            assert!((area / f64::from(n) / PI - 1.0).abs() < 0.01, "{sharpness}: {}", area / f64::from(n));
            assert!(
                (test / f64::from(n) / (0.5 * PI) - 1.0).abs() < 0.01,
                "{sharpness}: {}",
                test / f64::from(n)
            );
        }
    }
}
