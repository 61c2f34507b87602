//! Kirchner's colour map as a reader of the paper writes it: equations 1–7 with their inverse functions, in f32, fix A.
//!
//! This is the baseline whose time the other form of [`ColourMap`](super::ColourMap) and the flake map are measured against, and nothing else: near the
//! mirror direction its arc cosines lose half their digits.

use gonio_optics::{Angle, Geometry};

use crate::Brdf;

/// RGB over (cos θ'ill, cos θ'det) in two halves, bilinear.
#[derive(Clone, Debug, PartialEq)]
pub struct TrigonometricMap {
    index: f32,
    /// Cosine of the largest measured angle.
    low: f32,
    nodes: usize,
    /// (half, x, y), y fastest; the half of the mirror side first.
    values: Vec<[f32; 3]>,
}

impl TrigonometricMap {
    /// From f in-plane as far as `largest`, `nodes` (at least 2) at equal steps of each cosine.
    #[must_use]
    pub fn from_brdf(brdf: &dyn Brdf, index: f64, largest: Angle, nodes: usize) -> Self {
        let nodes = nodes.max(2);
        let low = largest.cos();
        let angle = |k: usize| {
            Angle::from_radians((low + (1.0 - low) * k as f64 / (nodes - 1) as f64).clamp(-1.0, 1.0).acos())
        };
        let mut values = Vec::with_capacity(2 * nodes * nodes);
        for phi in [Angle::STRAIGHT, Angle::ZERO] {
            for x in 0..nodes {
                for y in 0..nodes {
                    let (l, v) = Geometry { theta_i: angle(x), theta_o: angle(y), phi }.directions();
                    values.push(brdf.eval(l, v).map(|f| if f.is_finite() { f as f32 } else { 0.0 }));
                }
            }
        }
        Self { index: index as f32, low: low as f32, nodes, values }
    }

    /// Bytes of the map.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.values.len() * 12
    }

    /// f in 1/sr in single precision: unit directions, z the normal.
    #[must_use]
    pub fn eval_single(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        if light[2] < 0.0 || view[2] < 0.0 {
            return [0.0; 3];
        }
        let dot = light[0] * view[0] + light[1] * view[1];
        let flat = |d: [f32; 3]| d[0] * d[0] + d[1] * d[1];
        let (fl, fv) = (flat(light), flat(view));
        let cos_phi = (dot / (fl * fv).sqrt().max(1e-20)).clamp(-1.0, 1.0);
        // (1), (2): into the coat
        let (t1, t2) = (
            (fl.sqrt() / self.index).clamp(-1.0, 1.0).asin(),
            (fv.sqrt() / self.index).clamp(-1.0, 1.0).asin(),
        );
        // (4), (3)
        let cos_twice = (t1.cos() * t2.cos() + t1.sin() * t2.sin() * cos_phi).clamp(-1.0, 1.0);
        let inc = 0.5 * cos_twice.acos();
        let flake = ((t1.cos() + t2.cos()) / (2.0 * inc.cos()).max(1e-20)).clamp(-1.0, 1.0).acos();
        // (5)–(7): the in-plane geometry of the same flake, and out of the coat; clipped (A)
        let ill = (self.index * (inc + flake).sin()).clamp(-1.0, 1.0).asin();
        let det = (self.index * (inc - flake).sin()).clamp(-1.0, 1.0).asin();
        let n = self.nodes;
        let along = |theta: f32| {
            let x = (theta.cos().clamp(self.low, 1.0) - self.low) / (1.0 - self.low) * (n - 1) as f32;
            let k = (x as usize).min(n - 2);
            (k, x - k as f32)
        };
        let half = if det < 0.0 { n * n } else { 0 };
        let ((i, a), (j, b)) = (along(ill), along(det));
        let first = half + i * n + j;
        let corner = [first, first + 1, first + n, first + n + 1];
        let weight = [(1.0 - a) * (1.0 - b), (1.0 - a) * b, a * (1.0 - b), a * b];
        let mut out = [0.0; 3];
        for (at, w) in corner.into_iter().zip(weight) {
            if let Some(v) = self.values.get(at) {
                for c in 0..3 {
                    out[c] += w * v[c];
                }
            }
        }
        out
    }
}
