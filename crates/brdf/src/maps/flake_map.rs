//! The flake map: f over flake space, K harmonics deep.
//!
//! ```text
//! y(f / T) = Σ_{k = 0…K} c_k(θ_inc, θ_flake) · P_k,   P_k = (S sin θ_inc sin θ_flake)^2k cos 2kφ_d,   T = 1 or T(θi)·T(θo)
//! ```
//!
//! (θ_flake, θ_inc, φ_d) are Rusinkiewicz' half and difference angles of the refracted directions. Exchanging light and view turns φ_d by 180°,
//! mirroring changes its sign, so only cos 2kφ_d can appear: both symmetries are exact here, whatever was measured. Where φ_d has no meaning
//! (at θ_inc = 0 or θ_flake = 0) P_k vanishes as the k-th harmonic of any smooth function does. S makes P_k reach about 1.
//!
//! c_k is bilinear between nodes at equal steps of sin θ_inc and √(sin θ_flake): close together near the lobe, which flat flakes make.
//! P_k follows from P_1 by Chebyshev's recurrence, so an evaluation takes five square roots and no inverse function.

use gonio_optics::Vec3;

use super::{
    Region, Transform,
    flake_point::{FlakePoint, single},
};
use crate::{Brdf, Rgb};

/// The largest K.
pub const MAX_HARMONICS: usize = 3;

/// A fitted map; [`FlakeMap::fit`] makes it, [`FlakeMap::from_json`] reads it.
#[derive(Clone, Debug, PartialEq)]
pub struct FlakeMap {
    pub(super) name: String,
    pub(super) index: f64,
    pub(super) harmonics: usize,
    pub(super) nodes: [usize; 2],
    pub(super) transform: Transform,
    pub(super) transmittance: bool,
    pub(super) region: Region,
    /// Smallest and largest y of the data, per channel; the fourth lane is of no account here and below.
    pub(super) bounds: [[f32; 4]; 2],
    /// c_k of node (inc, flake) at `(inc·nodes[1] + flake)·(K + 1) + k`.
    pub(super) coefficients: Vec<[f32; 4]>,
    /// Whether data stood around a node.
    pub(super) covered: Vec<bool>,
}

impl FlakeMap {
    /// What was mapped.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// K.
    #[must_use]
    pub const fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// Refractive index of the coat.
    #[must_use]
    pub const fn index(&self) -> f64 {
        self.index
    }

    /// The geometries that were fitted; towards the mirror direction and beyond the largest angle the map continues smoothly.
    #[must_use]
    pub const fn region(&self) -> Region {
        self.region
    }

    /// Bytes of the table that an evaluation reads, three channels of f32.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.coefficients.len() * 12
    }

    /// Whether data stood around the place of this geometry in flake space; elsewhere the answer is a smooth continuation.
    #[must_use]
    pub fn covers(&self, light: Vec3, view: Vec3) -> bool {
        let p = FlakePoint::new(single(light), single(view), (1.0 / self.index) as f32);
        let (corner, _) = place(&p, self.index as f32, self.nodes);
        corner.iter().all(|&n| self.covered.get(n).copied().unwrap_or(false))
    }

    /// f in 1/sr in single precision, the path for renderers: unit directions, z the normal.
    #[inline]
    #[must_use]
    pub fn eval_single(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        if light[2] < 0.0 || view[2] < 0.0 {
            return [0.0; 3];
        }
        match self.harmonics {
            0 => self.eval_harmonics::<0, 1>(light, view),
            1 => self.eval_harmonics::<1, 2>(light, view),
            2 => self.eval_harmonics::<2, 3>(light, view),
            _ => self.eval_harmonics::<3, 4>(light, view),
        }
    }

    /// `N = K + 1` terms.
    #[inline]
    fn eval_harmonics<const K: usize, const N: usize>(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        let p = FlakePoint::new(light, view, (1.0 / self.index) as f32);
        let (corner, weight) = place(&p, self.index as f32, self.nodes);
        let basis = basis::<N>(&p, self.index);
        let mut y = [0.0; 4];
        for (node, w) in corner.into_iter().zip(weight) {
            if let Some(c) = self.coefficients.get(node * N..node * N + N) {
                for k in 0..N {
                    let factor = if K == 0 { w } else { w * basis[k] };
                    for lane in 0..4 {
                        y[lane] += factor * c[k][lane];
                    }
                }
            }
        }
        let t = if self.transmittance { transmittance(light[2], view[2], self.index as f32) } else { 1.0 };
        let [low, high] = self.bounds;
        [0, 1, 2].map(|c| t * self.transform.inverse(y[c].max(low[c]).min(high[c])))
    }
}

/// T(θi)·T(θo) with Schlick's reflectance (Sopp 2.5), held above 0.01 so that it divides.
#[inline]
pub(super) fn transmittance(cos_i: f32, cos_o: f32, index: f32) -> f32 {
    let r = (index - 1.0) / (index + 1.0);
    let t = |cos: f32| {
        let m = (1.0 - cos).max(0.0);
        (1.0 - r * r) * (1.0 - m * m * m * m * m)
    };
    (t(cos_i) * t(cos_o)).max(0.01)
}

/// P_0 … P_(N−1).
#[inline]
pub(super) fn basis<const N: usize>(p: &FlakePoint, index: f64) -> [f32; N] {
    // sin θ_inc sin θ_flake is largest where both are equal, 1 − cos of the steepest angle inside the coat
    let steepest = 1.0 - (1.0 - 1.0 / (index * index)).max(0.0).sqrt();
    let scale = (1.0 / (steepest * steepest)) as f32;
    let (first, square) = (p.p2_cos2 * scale, (p.p2 * scale) * (p.p2 * scale));
    let mut out = [1.0; N];
    for k in 1..N {
        out[k] = if k == 1 { first } else { 2.0 * first * out[k - 1] - square * out[k - 2] };
    }
    out
}

/// The four nodes around a place, and their bilinear weights.
#[inline]
pub(super) fn place(p: &FlakePoint, index: f32, nodes: [usize; 2]) -> ([usize; 4], [f32; 4]) {
    let along = |u: f32, n: usize| {
        let x = (u * (n - 1) as f32).max(0.0);
        let k = (x as usize).min(n - 2);
        (k, (x - k as f32).min(1.0))
    };
    let (i, a) = along(p.sin_inc * index, nodes[0]);
    let (j, b) = along(p.root_flake * index.sqrt(), nodes[1]);
    let n = i * nodes[1] + j;
    ([n, n + 1, n + nodes[1], n + nodes[1] + 1], [(1.0 - a) * (1.0 - b), (1.0 - a) * b, a * (1.0 - b), a * b])
}

impl Brdf for FlakeMap {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.eval_single(single(light), single(view)).map(f64::from)
    }
}
