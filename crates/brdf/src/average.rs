//! The mean of a BRDF over a cell and the lamp: what a measured cell holds, so what a model must be averaged to before it is compared.

use gonio_optics::{Angle, Geometry, Vec3, quadrature};

use crate::{Brdf, Grid, Meaning, Rgb};

/// Mean of `brdf` over the bin of (to, phi) in solid angle and over the lamp's disc about θi, by a product rule of
/// `n` × `n` Gauss–Legendre nodes in (cos θo, φ) and `rings` rings on the lamp (0: the lamp's centre alone).
///
/// A node table (`Meaning::Node`) is evaluated at its node.
#[must_use]
pub fn cell_mean(
    brdf: &dyn Brdf,
    grid: &Grid,
    meaning: Meaning,
    cell: [usize; 3],
    n: usize,
    rings: usize,
) -> Rgb {
    let [ti, to, phi] = cell;
    let centre: Geometry = grid.geometry(ti, to, phi);
    let Meaning::CellMean { lamp_half_angle } = meaning else {
        let (l, v) = centre.directions();
        return brdf.eval(l, v);
    };
    let lights = quadrature::cone(Vec3::from_polar(centre.theta_i, Angle::ZERO), lamp_half_angle, rings);
    let rule = quadrature::gauss_legendre(n);
    let (a, b) = grid.theta_o_bounds(to);
    // θo = 0 is one cap shared by all φ
    let (p, q) = if to == 0 { (Angle::ZERO, Angle::STRAIGHT) } else { grid.phi_bounds(phi) };
    let (ca, cb) = (a.cos(), b.cos());
    let mut sum = [0.0; 3];
    for &(x, wx) in &rule {
        let z = ca + (cb - ca) * x;
        let s = (1.0 - z * z).max(0.0).sqrt();
        for &(y, wy) in &rule {
            let (sp, cp) = (p + (q - p) * y).sin_cos();
            let view = Vec3::new(s * cp, s * sp, z);
            for &light in &lights {
                let f = brdf.eval(light, view);
                for c in 0..3 {
                    sum[c] += wx * wy * f[c];
                }
            }
        }
    }
    sum.map(|s| s / lights.len() as f64)
}
