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

/// Geometries that [`FlakeMap::eval_many`] takes at a time.
const LANES: usize = 16;

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
        let (corner, _) = place(&p, self.index, self.nodes);
        corner.iter().all(|&n| self.covered.get(n).copied().unwrap_or(false))
    }

    /// f in 1/sr in single precision: unit directions, z the normal.
    #[inline]
    #[must_use]
    pub fn eval_single(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        let [f] = self.eval_block([light], [view]);
        f
    }

    /// f of many geometries, the path for renderers: several at a time in vector registers. Ends with the shortest of the three slices.
    pub fn eval_many(&self, light: &[[f32; 3]], view: &[[f32; 3]], out: &mut [[f32; 3]]) {
        let ((lights, light), (views, view)) = (light.as_chunks::<LANES>(), view.as_chunks::<LANES>());
        let blocks = lights.len().min(views.len());
        let whole = out.len().min(blocks * LANES);
        let (many, rest) = out.split_at_mut(whole / LANES * LANES);
        let (many, _) = many.as_chunks_mut::<LANES>();
        for ((l, v), f) in lights.iter().zip(views).zip(many.iter_mut()) {
            *f = self.eval_block(*l, *v);
        }
        let done = many.len();
        let (light, view) = (
            lights[done..].as_flattened().iter().chain(light),
            views[done..].as_flattened().iter().chain(view),
        );
        for ((l, v), f) in light.zip(view).zip(rest) {
            *f = self.eval_single(*l, *v);
        }
    }

    #[inline]
    fn eval_block<const L: usize>(&self, light: [[f32; 3]; L], view: [[f32; 3]; L]) -> [[f32; 3]; L] {
        match self.harmonics {
            0 => self.eval_terms::<1, L>(light, view),
            1 => self.eval_terms::<2, L>(light, view),
            2 => self.eval_terms::<3, L>(light, view),
            _ => self.eval_terms::<4, L>(light, view),
        }
    }

    /// `N = K + 1` terms at L geometries; each step is a loop without a branch over all L.
    #[inline]
    fn eval_terms<const N: usize, const L: usize>(
        &self,
        light: [[f32; 3]; L],
        view: [[f32; 3]; L],
    ) -> [[f32; 3]; L] {
        let axis = |d: &[[f32; 3]; L], c: usize| std::array::from_fn::<f32, L, _>(|i| d[i][c]);
        let l: [[f32; L]; 3] = std::array::from_fn(|c| axis(&light, c));
        let v: [[f32; L]; 3] = std::array::from_fn(|c| axis(&view, c));
        let (inverse_index, cells) = ((1.0 / self.index) as f32, Cells::new(self.index, self.nodes));
        let scale = basis_scale(self.index);
        let (mut first, mut a, mut b) = ([0i32; L], [0.0; L], [0.0; L]);
        let (mut p, mut basis_at) = ([[0.0; L]; 2], [[1.0; L]; N]);
        for i in 0..L {
            let at = FlakePoint::new([l[0][i], l[1][i], l[2][i]], [v[0][i], v[1][i], v[2][i]], inverse_index);
            (first[i], a[i], b[i]) = cells.at(&at);
            p[0][i] = at.p2_cos2 * scale;
            p[1][i] = (at.p2 * scale) * (at.p2 * scale);
        }
        for k in 1..N {
            for i in 0..L {
                basis_at[k][i] = next(k, p[0][i], p[1][i], &|m: usize| basis_at[m][i]);
            }
        }
        let mut y = [[0.0; 4]; L];
        let row = self.nodes[1] * N;
        for i in 0..L {
            let at = first[i] as usize * N;
            let (near, far) =
                (self.coefficients.get(at..at + 2 * N), self.coefficients.get(at + row..at + row + 2 * N));
            // both are there for every place; a map is checked when it is made
            let (Some(near), Some(far)) = (near, far) else { continue };
            let (a, b) = (a[i], b[i]);
            for k in 0..N {
                for lane in 0..4 {
                    let low = near[k][lane] + b * (near[N + k][lane] - near[k][lane]);
                    let high = far[k][lane] + b * (far[N + k][lane] - far[k][lane]);
                    let c = low + a * (high - low);
                    y[i][lane] += if k == 0 { c } else { c * basis_at[k][i] };
                }
            }
        }
        let [low, high] = self.bounds;
        for y in &mut y {
            for lane in 0..4 {
                y[lane] = self.transform.inverse(y[lane].max(low[lane]).min(high[lane]));
            }
        }
        let mut t = [1.0; L];
        for i in 0..L {
            if self.transmittance {
                t[i] = transmittance(l[2][i], v[2][i], self.index as f32);
            }
            if l[2][i] < 0.0 || v[2][i] < 0.0 {
                t[i] = 0.0;
            }
        }
        std::array::from_fn(|i| [t[i] * y[i][0], t[i] * y[i][1], t[i] * y[i][2]])
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

/// S²: sin θ_inc sin θ_flake is largest where both are equal, 1 − cos of the steepest angle inside the coat.
#[inline]
fn basis_scale(index: f64) -> f32 {
    let steepest = 1.0 - (1.0 - 1.0 / (index * index)).max(0.0).sqrt();
    (1.0 / (steepest * steepest)) as f32
}

/// P_k from those before it, P_1 and the square of its amplitude (Chebyshev).
#[inline]
fn next(k: usize, first: f32, square: f32, before: &impl Fn(usize) -> f32) -> f32 {
    if k == 1 { first } else { 2.0 * first * before(k - 1) - square * before(k - 2) }
}

/// P_0 … P_(N−1).
pub(super) fn basis<const N: usize>(p: &FlakePoint, index: f64) -> [f32; N] {
    let scale = basis_scale(index);
    let mut out = [1.0; N];
    for k in 1..N {
        out[k] = next(k, p.p2_cos2 * scale, (p.p2 * scale) * (p.p2 * scale), &|m: usize| out[m]);
    }
    out
}

/// The nodes as a place is looked up among them.
#[derive(Clone, Copy)]
struct Cells {
    /// Steps per sin θ_inc and per √(sin θ_flake).
    steps: [f32; 2],
    /// The last cell of each axis.
    last: [i32; 2],
    /// Nodes over θ_flake.
    row: i32,
}

impl Cells {
    #[inline]
    fn new(index: f64, nodes: [usize; 2]) -> Self {
        Self {
            steps: [(index * (nodes[0] - 1) as f64) as f32, (index.sqrt() * (nodes[1] - 1) as f64) as f32],
            last: nodes.map(|n| n as i32 - 2),
            row: nodes[1] as i32,
        }
    }

    /// Number of the cell's first node and the fractions towards the next along θ_inc and θ_flake.
    #[inline]
    fn at(&self, p: &FlakePoint) -> (i32, f32, f32) {
        let (x, y) = (p.sin_inc * self.steps[0], p.root_flake * self.steps[1]);
        let (i, j) = ((x as i32).min(self.last[0]), (y as i32).min(self.last[1]));
        (i * self.row + j, (x - i as f32).min(1.0), (y - j as f32).min(1.0))
    }
}

/// The four nodes around a place, and their bilinear weights.
pub(super) fn place(p: &FlakePoint, index: f64, nodes: [usize; 2]) -> ([usize; 4], [f32; 4]) {
    let (n, a, b) = Cells::new(index, nodes).at(p);
    let n = n as usize;
    ([n, n + 1, n + nodes[1], n + nodes[1] + 1], [(1.0 - a) * (1.0 - b), (1.0 - a) * b, a * (1.0 - b), a * b])
}

impl Brdf for FlakeMap {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.eval_single(single(light), single(view)).map(f64::from)
    }
}
