//! Nodes and weights for averages over intervals and discs.

use crate::{Vec3, edge::safe_sqrt};

/// Gauss–Legendre nodes and weights on [0, 1], weights summing to 1; exact for polynomials of degree 2n − 1.
///
/// Newton iteration on the Legendre recurrence; `n` ≥ 1 (0 gives an empty rule).
#[must_use]
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let mut rule = vec![(0.0, 0.0); n];
    for i in 0..n.div_ceil(2) {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut dp = 1.0;
        for _ in 0..100 {
            let (mut p0, mut p1) = (1.0, x);
            for k in 2..=n {
                let k = k as f64;
                (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
            }
            if n == 1 {
                (p0, p1) = (1.0, x);
            }
            dp = n as f64 * (x * p1 - p0) / (x * x - 1.0);
            let dx = p1 / dp;
            x -= dx;
            if dx.abs() < 1e-16 {
                break;
            }
        }
        let w = 1.0 / ((1.0 - x * x) * dp * dp);
        rule[i] = (0.5 * (1.0 - x), w);
        rule[n - 1 - i] = (0.5 * (1.0 + x), w);
    }
    rule
}

/// Directions that sample a cone uniformly in solid angle, equal weights: the mean over the cone of radius `half_angle`.
///
/// `rings` concentric rings around the centre with 6 k points on ring k, plus the centre: 1 + 3 r (r + 1) points, each standing
/// for the same solid angle. Zero rings is the axis alone.
#[must_use]
pub fn cone(axis: Vec3, half_angle: crate::Angle, rings: usize) -> Vec<Vec3> {
    let (u, v) = axis.orthonormal_basis();
    let total = (1 + 3 * rings * (rings + 1)) as f64;
    let cap = 2.0 * (half_angle * 0.5).sin().powi(2);
    let mut out = vec![axis];
    for k in 1..=rings {
        // fraction of the area inside the middle of ring k
        let inner = (1 + 3 * k * (k - 1)) as f64 / total;
        let outer = (1 + 3 * k * (k + 1)) as f64 / total;
        let one_minus_cos = cap * 0.5 * (inner + outer);
        let (c, s) = (1.0 - one_minus_cos, safe_sqrt(one_minus_cos * (2.0 - one_minus_cos)));
        let count = 6 * k;
        for j in 0..count {
            let (sp, cp) =
                (std::f64::consts::TAU * (j as f64 + 0.5 * (k % 2) as f64) / count as f64).sin_cos();
            out.push(u * (s * cp) + v * (s * sp) + axis * c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_integrates_polynomials_exactly() {
        for n in 1..12 {
            let rule = gauss_legendre(n);
            for p in 0..2 * n {
                let got: f64 = rule.iter().map(|&(x, w)| w * x.powi(p as i32)).sum();
                assert!((got - 1.0 / (p as f64 + 1.0)).abs() < 1e-14, "n {n} power {p}: {got}");
            }
        }
    }

    #[test]
    fn the_cone_rule_has_the_mean_cosine_of_a_spherical_cap() {
        let a = crate::Angle::from_degrees(10.0);
        let axis = Vec3::new(0.3, 0.2, 0.9).normalized();
        let points = cone(axis, a, 4);
        let mean: f64 = points.iter().map(|d| d.dot(axis)).sum::<f64>() / points.len() as f64;
        assert!((mean - 0.5 * (1.0 + a.cos())).abs() < 2e-5, "{mean}");
        assert!(points.iter().all(|d| (d.norm() - 1.0).abs() < 1e-14));
    }
}
