//! The three-dimensional table that maps save: f over (θi, θo, φ) at equal steps, trilinear, f32.

use std::f32::consts::{FRAC_1_PI, FRAC_2_PI};

use gonio_optics::Vec3;

use super::flake_point::single;
use crate::{Brdf, Grid, Rgb};

/// A table with its nodes at equal steps over 0…90°, 0…90° and 0…180°.
#[derive(Clone, Debug, PartialEq)]
pub struct LookupTable {
    shape: [usize; 3],
    /// φ runs fastest; the fourth lane is of no account.
    values: Vec<[f32; 4]>,
}

impl LookupTable {
    /// Node values of f; fewer than two nodes along an axis count as two.
    #[must_use]
    pub fn from_brdf(brdf: &dyn Brdf, shape: [usize; 3]) -> Self {
        let shape = shape.map(|n| n.max(2));
        let axis = |n: usize, to: f64| (0..n).map(|k| to * k as f64 / (n - 1) as f64).collect();
        let grid = Grid {
            theta_i_deg: axis(shape[0], 90.0),
            theta_o_deg: axis(shape[1], 90.0),
            phi_deg: axis(shape[2], 180.0),
        };
        let at = |i: usize| {
            let [ti, to, phi] = grid.coordinates(i);
            let (l, v) = grid.geometry(ti, to, phi).directions();
            let f = brdf.eval(l, v).map(|f| if f.is_finite() { f as f32 } else { 0.0 });
            [f[0], f[1], f[2], 0.0]
        };
        Self { shape, values: (0..grid.len()).map(at).collect() }
    }

    /// Bytes of three channels of f32.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.values.len() * 12
    }

    /// f in 1/sr in single precision: unit directions, z the normal.
    #[inline]
    #[must_use]
    pub fn eval_single(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        if light[2] < 0.0 || view[2] < 0.0 {
            return [0.0; 3];
        }
        let dot = light[0] * view[0] + light[1] * view[1];
        let flat = |d: [f32; 3]| d[0] * d[0] + d[1] * d[1];
        let cos = dot / (flat(light) * flat(view)).sqrt().max(1e-20);
        let arc = |c: f32| c.clamp(-1.0, 1.0).acos();
        let axes = [arc(light[2]) * FRAC_2_PI, arc(view[2]) * FRAC_2_PI, arc(cos) * FRAC_1_PI];
        let mut first = 0;
        let mut fraction = [0.0; 3];
        for a in 0..3 {
            let x = axes[a] * (self.shape[a] - 1) as f32;
            let k = (x as usize).min(self.shape[a] - 2);
            fraction[a] = x - k as f32;
            first = first * self.shape[a] + k;
        }
        let steps = [self.shape[1] * self.shape[2], self.shape[2], 1];
        let mut out = [0.0; 3];
        for corner in 0..8 {
            let (mut w, mut i) = (1.0, first);
            for a in 0..3 {
                if corner >> a & 1 == 1 {
                    w *= fraction[a];
                    i += steps[a];
                } else {
                    w *= 1.0 - fraction[a];
                }
            }
            if let Some(v) = self.values.get(i) {
                for c in 0..3 {
                    out[c] += w * v[c];
                }
            }
        }
        out
    }
}

impl Brdf for LookupTable {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.eval_single(single(light), single(view)).map(f64::from)
    }
}
