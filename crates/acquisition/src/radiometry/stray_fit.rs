//! How much light goes astray: veiling glare from the pixels that see nothing, the tail of a point from the surroundings of a gloss, both from both
//! ([`Evidence`]).
//!
//! Linear in g and ε; the width σ of the tail is searched on a grid, then all three are refined by Gauss and Newton. Tiles are weighted by their noise and by
//! how much pixels differ. The uncertainty does not rest on those weights: it comes from how residuals scatter from block to block of the picture, over all
//! poses together, since the noise of dark frames, the pixels' sensitivities and the haze's own noise are the same in every pose; and from pose to pose, since
//! the pixels that show a gloss err for all its surroundings (a sandwich with clusters of two kinds: Cameron, Gelbach and Miller 2011). What the
//! linearisation is uncertain by is common to everything, and comes on top.

use std::collections::BTreeMap;

use gonio_instrument::radiometry::Known;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::evidence::{Evidence, Row};
use crate::pixel_map::PixelMap;

/// Blocks of the picture, across and down: two of the haze's tiles a side, whose noise neighbours share.
const BLOCKS: [usize; 2] = [10, 8];
/// Step of ln σ for its derivative.
const STEP: f64 = 0.02;
/// Largest step of ln σ in a round.
const LARGEST_STEP: f64 = 0.3;
/// Standard deviation of ln σ before anything is seen: nothing tells the width of a tail that is not there.
const PRIOR: f64 = 1.0;
/// Fewest poses whose scatter is told from that of blocks.
const FEW_POSES: usize = 6;
/// A tile off by more than so many times the usual residual is another thing: a dead pixel that nothing told.
const OUTLIER: f64 = 6.0;
/// A tail that is smaller than so many of its standard uncertainties has no width to be refined.
const TOLD: f64 = 5.0;

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// g.
    pub glare: Known,
    /// ε.
    pub tail_share: Known,
    /// σ of the narrowest Gaussian, mm.
    pub tail_radius_mm: Known,
    /// Whether a gloss was among the evidence.
    pub from_gloss: bool,
    /// Squared residuals over noise and spread of sensitivities, over degrees of freedom.
    pub misfit: f64,
    /// For the picture: of the blind tiles what the model says, what is seen (both over the picture's mean) and how many tiles.
    pub profile: Vec<[f64; 3]>,
}

/// Normal equations of (g, ε) and the sum of squares of what is seen.
#[derive(Clone, Copy, Default)]
struct Normal {
    n: Matrix2<f64>,
    b: Vector2<f64>,
    square: f64,
}

impl Normal {
    fn add(&mut self, rows: &[Row]) {
        for r in rows {
            let v = Vector2::new(r.model[0], r.model[1]);
            self.n += v * v.transpose() * r.weight;
            self.b += v * (r.weight * r.seen);
            self.square += r.weight * r.seen * r.seen;
        }
    }

    /// (g, ε) and the sum of squares left.
    fn solve(&self) -> Option<(Vector2<f64>, f64)> {
        // a session without gloss, or without blind pixels, still gives the other
        let ridge =
            Matrix2::from_diagonal(&Vector2::new(self.n[(0, 0)], self.n[(1, 1)]).map(|v| 1e-12 * v + 1e-300));
        let x = (self.n + ridge).try_inverse()? * self.b;
        Some((x, self.square - self.b.dot(&x)))
    }
}

/// Glare and tail at a width, and the sum of squares left.
fn shares_at(evidence: &[Evidence], start: [f64; 2], sigma: f64, rounds: usize) -> Option<([f64; 2], f64)> {
    let mut shares = start;
    let mut left = f64::INFINITY;
    // the light before it went astray changes with the shares
    for _ in 0..rounds {
        let mut normal = Normal::default();
        evidence.iter().for_each(|e| normal.add(&e.rows(shares, sigma, None)));
        let (x, rest) = normal.solve()?;
        shares = [x[0].clamp(-0.02, 0.3), x[1].clamp(-0.02, 0.3)];
        left = rest;
    }
    Some((shares, left))
}

/// A pose and a block of the picture; 0 for all of either.
type Cluster = (usize, usize);

/// Everything at a place: Hessian and gradient of half the sum of squares in (g, ε, ln σ), scores block by block.
struct Local {
    n: Matrix3<f64>,
    gradient: Vector3<f64>,
    /// By pose and block.
    scores: BTreeMap<Cluster, Vector3<f64>>,
    square: f64,
    count: usize,
}

fn local(evidence: &[Evidence], shares: [f64; 2], sigma: f64) -> Local {
    let mut out = Local {
        n: Matrix3::zeros(),
        gradient: Vector3::zeros(),
        scores: BTreeMap::new(),
        square: 0.0,
        count: 0,
    };
    for (pose, e) in evidence.iter().enumerate() {
        let [w, h] = e.size();
        for r in e.rows(shares, sigma, Some(STEP)) {
            let v = Vector3::from(r.model);
            let residual = r.seen - shares[0] * r.model[0] - shares[1] * r.model[1];
            let (x, y) = (r.tile % w, r.tile / w);
            let block = y * BLOCKS[1] / h * BLOCKS[0] + x * BLOCKS[0] / w;
            let score = v * (r.weight * residual);
            out.n += v * v.transpose() * r.weight;
            out.gradient += score;
            *out.scores.entry((pose, block)).or_insert_with(Vector3::zeros) += score;
            out.square += r.weight * residual * residual;
            out.count += 1;
        }
    }
    out
}

impl Local {
    /// Squared residuals over noise and spread of sensitivities, over degrees of freedom.
    fn misfit(&self) -> f64 {
        self.square / (self.count as f64 - 3.0).max(1.0)
    }

    /// The inverse Hessian; `width` tells whether σ is free, else it is held by its prior alone.
    fn inverse(&self, width: bool) -> Matrix3<f64> {
        let mut n = self.n;
        let scale = self.misfit();
        if !width {
            (0..2).for_each(|k| (n[(k, 2)], n[(2, k)]) = (0.0, 0.0));
        }
        // in the units of the weights
        n[(2, 2)] += scale.max(1.0) / (PRIOR * PRIOR);
        for k in 0..3 {
            n[(k, k)] += 1e-12 * n[(k, k)] + 1e-300;
        }
        n.try_inverse().unwrap_or_else(Matrix3::zeros)
    }

    /// Covariance by the scatter of the blocks' scores.
    fn covariance(&self, width: bool) -> Matrix3<f64> {
        let inverse = self.inverse(width);
        let meat = |cluster: fn(&Cluster) -> Cluster| {
            let mut sums: BTreeMap<Cluster, Vector3<f64>> = BTreeMap::new();
            for (key, score) in &self.scores {
                *sums.entry(cluster(key)).or_insert_with(Vector3::zeros) += score;
            }
            let n = sums.len() as f64;
            let sum = sums.values().fold(Matrix3::zeros(), |m: Matrix3<f64>, s| m + s * s.transpose());
            (sum * (n / (n - 3.0).max(1.0)), sums.len())
        };
        let (by_block, _) = meat(|k| (0, k.1));
        let (by_pose, poses) = meat(|k| (k.0, 0));
        let (by_both, _) = meat(|k| *k);
        let mut meat = by_block;
        // of a few poses the scatter is not told
        if poses >= FEW_POSES {
            // a difference of two estimates: no direction gets better known by it
            let more = (by_pose - by_both).symmetric_eigen();
            for k in (0..3).filter(|k| more.eigenvalues[*k] > 0.0) {
                let v = more.eigenvectors.column(k);
                meat += v * v.transpose() * more.eigenvalues[k];
            }
        }
        let mut prior = Matrix3::zeros();
        prior[(2, 2)] = self.misfit().max(1.0) / (PRIOR * PRIOR);
        inverse * (meat + prior) * inverse
    }
}

/// Finds glare and tail; `None` without any evidence. `bend` is the relative uncertainty of bright against faint light that the linearisation leaves.
#[must_use]
pub fn find(evidence: &[Evidence], map: &PixelMap, bend: f64) -> Option<Found> {
    let mut evidence: Vec<Evidence> = evidence.iter().filter(|e| e.at.len() >= 10).cloned().collect();
    if evidence.is_empty() {
        return None;
    }
    let mut shares = [0.0; 2];
    let mut sigma = 2.0f64;
    for round in 0..2 {
        // a grid first, then a finer one about the best
        let grid: Vec<f64> = match round {
            0 => (0..13).map(|k| 0.25 * 1.6f64.powi(k)).filter(|s| *s < 0.12 * map.width() as f64).collect(),
            _ => (-3..=3).map(|k| sigma * 1.15f64.powi(k)).collect(),
        };
        let tried = grid.iter().filter_map(|s| Some((shares_at(&evidence, shares, *s, 2)?, *s)));
        let ((found, _), best) = tried.min_by(|a, b| a.0.1.total_cmp(&b.0.1))?;
        (shares, sigma) = (found, best);
        evidence.iter_mut().for_each(|e| e.without_strangers(shares, sigma));
    }
    shares = shares_at(&evidence, shares, sigma, 3)?.0;
    let mut first = local(&evidence, shares, sigma);
    for _ in 0..2 {
        let usual = first.misfit().max(1.0).sqrt();
        evidence.iter_mut().for_each(|e| e.without_outliers(shares, sigma, OUTLIER * usual));
        shares = shares_at(&evidence, shares, sigma, 1)?.0;
        first = local(&evidence, shares, sigma);
    }
    let width = shares[1].abs() > TOLD * first.covariance(false)[(1, 1)].max(0.0).sqrt();
    let mut last = first;
    for _ in 0..8 {
        let step = last.inverse(width) * last.gradient;
        shares = [(shares[0] + step[0]).clamp(-0.02, 0.3), (shares[1] + step[1]).clamp(-0.02, 0.3)];
        let wider = if width { step[2].clamp(-LARGEST_STEP, LARGEST_STEP) } else { 0.0 };
        sigma *= wider.exp();
        last = local(&evidence, shares, sigma);
        if wider.abs() < 1e-4 && step[0].abs() < 1e-7 && step[1].abs() < 1e-7 {
            break;
        }
    }
    let covariance = last.covariance(width);
    let sigma_of = |k: usize| covariance[(k, k)].max(0.0).sqrt();
    let mm = 2e-3 * map.description().camera.pitch_um;
    Some(Found {
        glare: Known::new(shares[0], sigma_of(0).hypot(shares[0] * bend)),
        tail_share: Known::new(shares[1], sigma_of(1).hypot(shares[1] * bend)),
        tail_radius_mm: Known::new(sigma * mm, sigma * mm * sigma_of(2)),
        from_gloss: evidence.iter().any(Evidence::is_of_gloss),
        misfit: last.misfit(),
        profile: profile(&evidence, shares, sigma),
    })
}

fn profile(evidence: &[Evidence], shares: [f64; 2], sigma: f64) -> Vec<[f64; 3]> {
    let mut bins: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for e in evidence.iter().filter(|e| !e.is_of_gloss()) {
        // the model itself orders the tiles
        for [model, seen] in e.against(shares, sigma) {
            let bin = bins.entry((model.max(0.0) * 2e3) as usize).or_default();
            for (b, v) in bin.iter_mut().zip([1.0, model, seen]) {
                *b += v;
            }
        }
    }
    bins.values().filter(|b| b[0] >= 3.0).map(|b| [b[1] / b[0], b[2] / b[0], b[0]]).collect()
}
