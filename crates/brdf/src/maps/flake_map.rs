//! The flake map: f over flake space, K harmonics deep.
//!
//! ```text
//! y(f / E) = Σ_{k = 0…K} c_k(θ_inc, θ_flake) · P_k
//! P_k = (p² / (p² + p₀²))^k cos 2kφ_d,   p = sin θ_inc sin θ_flake,   p₀² = 0.003
//! E = (1 + β (1 − cos θi)^5) (1 + β (1 − cos θo)^5)
//! ```
//!
//! (θ_flake, θ_inc, φ_d) are Rusinkiewicz' half and difference angles of the refracted directions. Exchanging light and view turns φ_d by 180°,
//! mirroring changes its sign, so only cos 2kφ_d can appear: both symmetries are exact here, whatever was measured. Where φ_d has no meaning
//! (at θ_inc = 0 or θ_flake = 0) P_k vanishes like p^2k, as the k-th harmonic of any smooth function does.
//!
//! c_k is bilinear between nodes at equal steps of sin θ_inc and √(sin θ_flake): close together near the lobe, which flat flakes make.
//! P_k follows from P_1 by Chebyshev's recurrence, so an evaluation takes five square roots, two divisions and no inverse function.
//! E holds what depends on each direction alone: β = −1 is Schlick's transmittance of the coat (Sopp 2.5) but for a constant.

use gonio_optics::Vec3;

use super::{
    Region, Transform,
    finding::{Finding, Standing},
    flake_lanes::{self, Cells, Table},
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
    /// β of the edge factor E.
    pub(super) edge: f64,
    pub(super) region: Region,
    /// Smallest and largest y of the data, per channel; the fourth lane is of no account here and below.
    pub(super) bounds: [[f32; 4]; 2],
    /// c_k of node (inc, flake) at `(inc·nodes[1] + flake)·(K + 1) + k`.
    pub(super) coefficients: Vec<[f32; 4]>,
    /// Whether data stood around a node.
    pub(super) covered: Vec<bool>,
    /// Standard uncertainty of y at a node, where the map was estimated with one.
    pub(super) sigma: Option<Vec<f32>>,
    pub(super) findings: Vec<Finding>,
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

    /// What whoever uses the map should know.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// What stands behind the answer at a geometry. Nothing but [`Standing::Measured`] is a measurement.
    #[must_use]
    pub fn standing(&self, light: Vec3, view: Vec3) -> Standing {
        if light.z < 0.0 || view.z < 0.0 {
            Standing::BelowHorizon
        } else if light.z.min(view.z) < self.region.largest.cos() - 1e-9 {
            Standing::BeyondLargest
        } else if !self.region.contains(light, view) {
            Standing::Gloss
        } else if self.covers(light, view) {
            Standing::Measured
        } else {
            Standing::Continued
        }
    }

    /// Whether the map states an uncertainty ([`Self::sigma`]).
    #[must_use]
    pub const fn has_sigma(&self) -> bool {
        self.sigma.is_some()
    }

    /// Standard uncertainty of f at a geometry in 1/sr; `None` for a map that was fitted to full data and states none.
    #[must_use]
    pub fn sigma(&self, light: Vec3, view: Vec3) -> Option<Rgb> {
        let sigma = self.sigma.as_ref()?;
        let p = FlakePoint::new(single(light), single(view), (1.0 / self.index) as f32);
        let (corner, share) = place(&p, self.index, self.nodes);
        let at = |n: usize| sigma.get(n).copied().unwrap_or(f32::INFINITY);
        let y: f32 = corner.iter().zip(share).map(|(&n, s)| s * at(n)).sum();
        Some(self.eval(light, view).map(|f| f64::from(y) / self.transform.slope(f)))
    }

    /// β of the edge factor: what of f depends on each direction alone, `1 + β (1 − cos θ)^5` of light and view.
    #[must_use]
    pub const fn edge(&self) -> f64 {
        self.edge
    }

    /// f in 1/sr in single precision: unit directions, z the normal.
    #[inline]
    #[must_use]
    pub fn eval_single(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        match self.transform {
            Transform::CubeRoot => self.one::<false>(light, view),
            Transform::Log => self.one::<true>(light, view),
        }
    }

    #[inline]
    fn one<const LOG: bool>(&self, light: [f32; 3], view: [f32; 3]) -> [f32; 3] {
        let (table, mut out) = (self.table(), [[0.0; 3]]);
        let (l, v) = (&[light], &[view]);
        match self.harmonics {
            0 => flake_lanes::block::<1, 1, LOG>(&table, l, v, &mut out),
            1 => flake_lanes::block::<2, 1, LOG>(&table, l, v, &mut out),
            2 => flake_lanes::block::<3, 1, LOG>(&table, l, v, &mut out),
            _ => flake_lanes::block::<4, 1, LOG>(&table, l, v, &mut out),
        }
        out[0]
    }

    /// f of many geometries, the path for renderers: several at a time in vector registers, bit for bit what [`Self::eval_single`] gives. Ends with
    /// the shortest of the three slices.
    pub fn eval_many(&self, light: &[[f32; 3]], view: &[[f32; 3]], out: &mut [[f32; 3]]) {
        match self.transform {
            Transform::CubeRoot => self.many::<false>(light, view, out),
            Transform::Log => self.many::<true>(light, view, out),
        }
    }

    fn many<const LOG: bool>(&self, light: &[[f32; 3]], view: &[[f32; 3]], out: &mut [[f32; 3]]) {
        match self.harmonics {
            0 => flake_lanes::many::<1, LOG>(self.table(), light, view, out),
            1 => flake_lanes::many::<2, LOG>(self.table(), light, view, out),
            2 => flake_lanes::many::<3, LOG>(self.table(), light, view, out),
            _ => flake_lanes::many::<4, LOG>(self.table(), light, view, out),
        }
    }

    #[inline]
    fn table(&self) -> Table<'_> {
        Table {
            coefficients: &self.coefficients,
            row: self.nodes[1],
            cells: Cells::new(self.index, self.nodes),
            inverse_index: (1.0 / self.index) as f32,
            bounds: self.bounds,
            edge: self.edge as f32,
        }
    }
}

/// The four nodes around a place, and their bilinear weights.
pub(super) fn place(p: &FlakePoint, index: f64, nodes: [usize; 2]) -> ([usize; 4], [f32; 4]) {
    let [(i, a), (j, b)] = Cells::new(index, nodes).at(p);
    let n = i as usize * nodes[1] + j as usize;
    ([n, n + 1, n + nodes[1], n + nodes[1] + 1], [(1.0 - a) * (1.0 - b), (1.0 - a) * b, a * (1.0 - b), a * b])
}

impl Brdf for FlakeMap {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.eval_single(single(light), single(view)).map(f64::from)
    }
}
