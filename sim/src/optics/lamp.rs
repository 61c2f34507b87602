//! The lamp: a uniform disc of angular radius α around the beam's direction, and rules to average over it.
//!
//! With radiance L the irradiance normal to the beam is `E0 = L ∫ cos ε dω = L π sin² α = L Ω`, so that
//!
//! ```text
//! (1/Ω) ∫_lamp f cos θ' dω' = mean over the projected unit disc of  f(l') cos θ' / cos ε
//! ```
//!
//! with `l' = axis √(1 − ρ²) + (u, v) in-plane`, ρ = sin ε ≤ sin α. For a Lambert surface the mean is exactly f cos θi.

use gonio_instrument::{Description, Misalignment};
use gonio_optics::Vec3;

use super::turn;

/// The lamp as the sample sees it.
#[derive(Clone, Debug)]
pub struct Lamp {
    /// Unit direction from the sample to the lamp's centre, lab.
    pub direction: Vec3,
    /// Angular radius α, radians.
    pub half_angle_rad: f64,
    /// Ω = π sin² α, sr.
    pub omega_sr: f64,
    /// Radius of the lit spot normal to the beam, mm.
    pub spot_radius_mm: f64,
}

impl Lamp {
    /// The lamp of an instrument with its errors.
    #[must_use]
    pub fn new(d: &Description, m: &Misalignment) -> Self {
        let half_angle_rad = d.lamp.half_angle_deg.to_radians();
        let s = half_angle_rad.sin();
        Self {
            direction: turn::tipped(d.lamp.direction(), m.lamp_direction_deg),
            half_angle_rad,
            omega_sr: std::f64::consts::PI * s * s,
            spot_radius_mm: d.lamp.spot_radius_mm,
        }
    }

    /// The lamp seen in a frame in which its centre lies along the unit vector `axis`.
    #[must_use]
    pub fn seen_along(&self, axis: Vec3) -> Disc {
        let (u, v) = axis.orthonormal_basis();
        let s = self.half_angle_rad.sin();
        Disc { axis, u: u * s, v: v * s, sin2: s * s }
    }
}

/// The lamp's disc in some frame.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    axis: Vec3,
    u: Vec3,
    v: Vec3,
    sin2: f64,
}

impl Disc {
    /// The direction to a point of the unit disc and `1 / cos ε` there.
    #[must_use]
    pub fn direction(&self, p: [f64; 2]) -> (Vec3, f64) {
        let cos = (1.0 - self.sin2 * (p[0] * p[0] + p[1] * p[1])).max(0.0).sqrt();
        (self.axis * cos + self.u * p[0] + self.v * p[1], 1.0 / cos)
    }
}

/// Seven points with weights that average polynomials up to degree 5 over the unit disc exactly (Radon; Stroud S2: 5-1).
#[must_use]
pub fn radon7() -> [([f64; 2], f64); 7] {
    let mut rule = [([0.0, 0.0], 0.25); 7];
    let r = (2.0f64 / 3.0).sqrt();
    for (k, slot) in rule.iter_mut().skip(1).enumerate() {
        let (s, c) = (std::f64::consts::TAU * k as f64 / 6.0).sin_cos();
        *slot = ([r * c, r * s], 0.125);
    }
    rule
}

/// Points of equal weight, each standing for the same area of the unit disc: the centre and `rings` rings of 6 k points.
#[must_use]
pub fn rings(rings: usize) -> Vec<[f64; 2]> {
    let total = (1 + 3 * rings * (rings + 1)) as f64;
    let mut points = vec![[0.0, 0.0]];
    for k in 1..=rings {
        // mean of ρ² over the ring's area
        let rho = ((1 + 3 * k * k) as f64 / total).sqrt();
        for j in 0..6 * k {
            let turn = (j as f64 + 0.5 * (k % 2) as f64) / (6 * k) as f64;
            let (s, c) = (std::f64::consts::TAU * turn).sin_cos();
            points.push([rho * c, rho * s]);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(points: &[([f64; 2], f64)], px: i32, py: i32) -> f64 {
        points.iter().map(|&([x, y], w)| w * x.powi(px) * y.powi(py)).sum()
    }

    #[test]
    fn the_seven_point_rule_averages_degree_five_exactly() {
        let rule = radon7();
        // means over the unit disc: <1> = 1, <x²> = 1/4, <x⁴> = 1/8, <x² y²> = 1/24
        for (px, py, mean) in [
            (0, 0, 1.0),
            (2, 0, 0.25),
            (0, 2, 0.25),
            (4, 0, 0.125),
            (2, 2, 1.0 / 24.0),
            (0, 4, 0.125),
            (3, 2, 0.0),
            (1, 0, 0.0),
        ] {
            assert!((moment(&rule, px, py) - mean).abs() < 1e-15, "x^{px} y^{py}");
        }
    }

    #[test]
    fn the_ring_rule_has_the_second_moments_of_the_disc() {
        for n in [1, 2, 4, 8] {
            let points = rings(n);
            assert_eq!(points.len(), 1 + 3 * n * (n + 1));
            let mean: f64 = points.iter().map(|p| p[0] * p[0]).sum::<f64>() / points.len() as f64;
            // ring means of ρ² are exact but for the centre cell, which stands at ρ = 0
            let centre = 0.5 / (points.len() as f64).powi(2) * 0.5;
            assert!((mean + centre - 0.25).abs() < 1e-12, "{n} rings: {mean}");
        }
    }

    #[test]
    fn the_mean_of_direction_over_cos_is_the_axis() {
        let d = gonio_instrument::builtin::description("reference").expect("known").expect("readable");
        let lamp = Lamp::new(&d, &Misalignment::default());
        let axis = Vec3::new(0.3, -0.2, 0.9).normalized();
        let disc = lamp.seen_along(axis);
        let mut mean = Vec3::ZERO;
        for (p, w) in radon7() {
            let (l, inverse_cos) = disc.direction(p);
            assert!((l.norm() - 1.0).abs() < 1e-15);
            mean = mean + l * (w * inverse_cos);
        }
        assert!((mean - axis).norm() < 1e-15);
    }
}
