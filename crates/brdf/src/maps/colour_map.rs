//! Kirchner's colour map (his Fig. 2): f of the in-plane geometries, and through their isochromatic lines of all others.
//!
//! x = cos θ'ill, y = cos θ'det, one half for φ' = 180° (the mirror side) and one for φ' = 0°; the halves meet at θ'det = 0. Both cosines run
//! from that of the largest measured angle to 1, and a geometry beyond is taken at that angle. Nodes stand at equal steps of √(1 − cos), which is
//! nearly the angle: f is smooth in it where the halves meet, while over the cosine it has a corner there. A map entry and its reciprocal are one
//! measurement: their mean is stored.

use gonio_optics::{
    Angle, Geometry, Isoline, Vec3,
    isoline::{Method, isoline},
    isoline_single,
};

use super::Sample;
use crate::{Brdf, Rgb};

/// A map with the index and the rule for geometries beyond the critical angle.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourMap {
    index: f64,
    method: Method,
    largest: Angle,
    /// 1 over 1 − cos of the largest angle.
    per_end: f32,
    nodes: usize,
    /// (half, x, y), y fastest; the half of the mirror side first.
    values: Vec<[f32; 3]>,
}

impl ColourMap {
    /// From f in-plane as far as `largest`, `nodes` (at least 2) for each angle. A measured table is taken at its in-plane cells.
    #[must_use]
    pub fn from_brdf(brdf: &dyn Brdf, index: f64, method: Method, largest: Angle, nodes: usize) -> Self {
        let nodes = nodes.max(2);
        let end = 1.0 - largest.cos();
        let angle = |k: usize| {
            let share = k as f64 / (nodes - 1) as f64;
            Angle::from_radians((1.0 - end * share * share).acos())
        };
        let mut values = Vec::with_capacity(2 * nodes * nodes);
        for phi in [Angle::STRAIGHT, Angle::ZERO] {
            for x in 0..nodes {
                for y in 0..nodes {
                    let g = Geometry { theta_i: angle(x), theta_o: angle(y), phi };
                    values.push(in_plane(brdf, g).map(|f| f as f32));
                }
            }
        }
        Self { index, method, largest, per_end: (1.0 / end.max(1e-12)) as f32, nodes, values }
    }

    /// The same map with another rule beyond the critical angle.
    #[must_use]
    pub fn with_method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// The in-plane geometry that stands for two directions, clipped at the largest measured angle.
    #[must_use]
    pub fn equivalent(&self, light: Vec3, view: Vec3) -> Isoline {
        isoline(light, view, self.index, self.method).clipped_at(self.largest)
    }

    /// Bytes of the map.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.values.len() * 12
    }

    /// f of an in-plane geometry (φ below 90° counts as 0°), bilinear between nodes.
    #[must_use]
    pub fn in_plane(&self, g: Geometry) -> Rgb {
        let at = |theta: Angle| (1.0 - theta.cos()) as f32;
        self.between_nodes(at(g.theta_i), at(g.theta_o), g.phi >= Angle::RIGHT).map(f64::from)
    }

    /// f in 1/sr in single precision without a trigonometric function: unit directions, z the normal.
    #[inline]
    #[must_use]
    pub fn eval_single(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        if light[2] < 0.0 || view[2] < 0.0 {
            return [0.0; 3];
        }
        let i = isoline_single(light, view, self.index as f32, self.method);
        self.between_nodes(1.0 - i.cos_ill, 1.0 - i.cos_det, i.mirror_side)
    }

    /// Bilinear at 1 − cos of both angles.
    #[inline]
    fn between_nodes(&self, ill: f32, det: f32, mirror_side: bool) -> [f32; 3] {
        let n = self.nodes;
        let along = |x: f32| {
            let x = (x * self.per_end).clamp(0.0, 1.0).sqrt() * (n - 1) as f32;
            let k = (x as usize).min(n - 2);
            (k, x - k as f32)
        };
        let half = if mirror_side { 0 } else { n * n };
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

/// f and its reciprocal, their mean.
fn in_plane(brdf: &dyn Brdf, g: Geometry) -> Rgb {
    let at = |g: Geometry| {
        let (l, v) = g.directions();
        brdf.eval(l, v)
    };
    let (f, r) = (at(g), at(g.swapped()));
    [0, 1, 2].map(|c| {
        let mean = 0.5 * (f[c] + r[c]);
        if mean.is_finite() { mean } else { 0.0 }
    })
}

/// f of a function at the in-plane equivalent itself, without a map between: what the map's own resolution is measured against.
#[must_use]
pub fn at_equivalent(brdf: &dyn Brdf, sample: &Sample, index: f64, method: Method, largest: Angle) -> Rgb {
    in_plane(brdf, isoline(sample.light, sample.view, index, method).clipped_at(largest).geometry())
}

impl Brdf for ColourMap {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        self.in_plane(self.equivalent(light, view).geometry())
    }
}
