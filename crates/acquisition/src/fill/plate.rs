//! Holes within a measured row: the smoothest surface over (θo, φ) that meets what is known around them.
//!
//! It is a thin plate in log f: of all ways to fill the holes the one whose values depart least, in the sum of squares over the holes and the cells
//! beside them, from the mean of their neighbours (weighted by inverse squared distance). Slopes go on across the rim of a hole, where a membrane
//! (each cell the mean of its neighbours) would bend at once. At φ = 0 and 180° the neighbour beyond is the mirror image. The logarithm keeps values
//! positive; they are held within twice the range of the rim.
//!
//! What a sample that looks the same from all sides does depends on the angles between light, view and normal, and the azimuth moves those by no more than
//! `sin θi sin θo dφ`: at normal incidence not at all. So far out a step in azimuth counts as sin θi long instead of sin θo, but not shorter than a lobe about
//! the mirror direction would have it.

use gonio_brdf::{Flag, Grid, Measured};

use super::NEAR_DEG;

/// Steps of the conjugate gradients; holes are a few cells wide.
const STEPS: usize = 600;
/// Relative size of the residual at which they end.
const ENOUGH: f64 = 1e-8;
/// Share of a membrane in the plate: noise of the rim would otherwise be carried on as a slope. 0.01 to 0.2 differ by a few hundredths of a ΔE.
const TENSION: f64 = 0.02;
/// Smallest value whose logarithm counts, of the mean of the known cells.
const FLOOR: f64 = 1e-4;

/// The cells of a row within the limit, and how they stand to each other.
struct Plate {
    /// Per cell its neighbours and their shares, which add up to 1.
    neighbours: Vec<Vec<(usize, f64)>>,
    /// Whether the cell is a hole.
    hole: Vec<bool>,
    /// Cells whose departure from their neighbours counts.
    counted: Vec<usize>,
}

impl Plate {
    fn new(grid: &Grid, ti: usize, within: usize, hole: Vec<bool>) -> Self {
        let neighbours: Vec<Vec<(usize, f64)>> =
            (0..hole.len()).map(|k| neighbours(grid, [ti, within], k)).collect();
        let counted =
            (0..hole.len()).filter(|&k| hole[k] || neighbours[k].iter().any(|(n, _)| hole[*n])).collect();
        Self { neighbours, hole, counted }
    }

    /// Departure of a cell from the mean of its neighbours.
    fn departure(&self, f: &[f64], k: usize) -> f64 {
        self.neighbours[k].iter().map(|(n, w)| w * f[*n]).sum::<f64>() - f[k]
    }

    /// Half the gradient of the sum of squared departures, on the holes.
    fn gradient(&self, f: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; f.len()];
        for &k in &self.counted {
            let d = self.departure(f, k);
            out[k] -= d;
            for (n, w) in &self.neighbours[k] {
                out[*n] += w * d;
            }
        }
        for k in 0..f.len() {
            for (n, w) in &self.neighbours[k] {
                let pull = 0.5 * TENSION * w * (f[k] - f[*n]);
                out[k] += pull;
                out[*n] -= pull;
            }
        }
        for (o, h) in out.iter_mut().zip(&self.hole) {
            if !h {
                *o = 0.0;
            }
        }
        out
    }

    /// Puts the smoothest values into the holes.
    fn settle(&self, f: &mut [f64]) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let mut residual: Vec<f64> = self.gradient(f).iter().map(|g| -g).collect();
        let mut direction = residual.clone();
        let mut now = dot(&residual, &residual);
        let enough = ENOUGH * ENOUGH * now;
        for _ in 0..STEPS {
            if now <= enough || now == 0.0 {
                break;
            }
            let turned = self.gradient(&direction);
            let curvature = dot(&direction, &turned);
            if curvature <= 0.0 {
                break;
            }
            let step = now / curvature;
            for k in 0..f.len() {
                f[k] += step * direction[k];
                residual[k] -= step * turned[k];
            }
            let next = dot(&residual, &residual);
            for (d, r) in direction.iter_mut().zip(&residual) {
                *d = r + next / now * *d;
            }
            now = next;
        }
    }

    /// How many cells each hole is away from what is known.
    fn reach(&self) -> Vec<f64> {
        let mut reach: Vec<f64> = self.hole.iter().map(|h| if *h { f64::INFINITY } else { 0.0 }).collect();
        loop {
            let mut changed = false;
            for k in 0..reach.len() {
                let near = self.neighbours[k].iter().map(|(n, _)| reach[*n]).fold(f64::INFINITY, f64::min);
                if self.hole[k] && near + 1.0 < reach[k] {
                    reach[k] = near + 1.0;
                    changed = true;
                }
            }
            if !changed {
                return reach;
            }
        }
    }
}

/// Neighbours of a cell of a row (its number, and how many θo it has) with their shares.
fn neighbours(grid: &Grid, [ti, within]: [usize; 2], k: usize) -> Vec<(usize, f64)> {
    let np = grid.shape()[2];
    let (o, p) = (k / np, k % np);
    let sin = |deg: f64| deg.to_radians().sin();
    let sine = sin(grid.theta_o_deg[o]).min(sin(grid.theta_i_deg[ti].max(NEAR_DEG))).max(0.02);
    let along = |a: usize, b: usize| 1.0 / (grid.theta_o_deg[a] - grid.theta_o_deg[b]).powi(2);
    let across = |a: usize, b: usize| 1.0 / ((grid.phi_deg[a] - grid.phi_deg[b]) * sine).powi(2);
    let mut out = Vec::with_capacity(4);
    if o > 0 {
        out.push((k - np, along(o, o - 1)));
        if np > 1 {
            out.push(if p > 0 { (k - 1, across(p, p - 1)) } else { (k + 1, across(0, 1)) });
            out.push(if p + 1 < np { (k + 1, across(p, p + 1)) } else { (k - 1, across(p, p - 1)) });
        }
    } else if within > 1 {
        // the cap: all azimuths are one cell, its neighbour opposite lies at φ + 180°
        out.push((np + (np - 1 - p), along(1, 0)));
    }
    if o + 1 < within {
        out.push((k + np, along(o, o + 1)));
    }
    let all: f64 = out.iter().map(|n| n.1).sum();
    out.iter_mut().for_each(|n| n.1 /= all);
    out
}

pub(super) fn fill(m: &mut Measured, limit_deg: f64) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let within = (0..no).take_while(|&o| grid.theta_o_deg[o] <= limit_deg + 1e-9).count();
    for ti in 0..ni {
        let start = grid.index(ti, 0, 0);
        let hole: Vec<bool> = (0..within * np).map(|k| m.flag[start + k] == Flag::Invalid).collect();
        let count = hole.iter().filter(|h| !**h).count();
        if count == hole.len() || count * 4 < hole.len() {
            continue;
        }
        let plate = Plate::new(&grid, ti, within, hole);
        let reach = plate.reach();
        for c in 0..3 {
            let known = || (0..plate.hole.len()).filter(|k| !plate.hole[*k]);
            let value = |k: usize| f64::from(m.values[start + k][c]);
            let mean = known().map(value).sum::<f64>() / count as f64;
            let floor = (FLOOR * mean).max(f64::from(f32::MIN_POSITIVE));
            let mut log: Vec<f64> = (0..plate.hole.len())
                .map(|k| if plate.hole[k] { mean.max(floor).ln() } else { value(k).max(floor).ln() })
                .collect();
            let rim = || known().filter(|k| plate.neighbours[*k].iter().any(|(n, _)| plate.hole[*n]));
            let (low, high) =
                rim().fold((f64::INFINITY, f64::NEG_INFINITY), |a, k| (a.0.min(log[k]), a.1.max(log[k])));
            plate.settle(&mut log);
            let half = 0.5 * (high - low);
            // σ of the nearest rim, and how much the surface varies about the hole, more the farther in
            let sigma: Vec<f64> = (0..plate.hole.len()).map(|k| f64::from(m.sigma[start + k][c])).collect();
            let beside = rim().map(|k| sigma[k]).fold(0.0, f64::max);
            for k in (0..plate.hole.len()).filter(|k| plate.hole[*k]) {
                let f = log[k].clamp(low - half, high + half).exp();
                let slope =
                    plate.neighbours[k].iter().map(|(n, _)| (log[*n] - log[k]).abs()).fold(0.0, f64::max);
                let own = f * (0.3 * slope.min(1.0) * reach[k].min(1e3)).hypot(0.01);
                m.values[start + k][c] = f as f32;
                m.sigma[start + k][c] = beside.hypot(own) as f32;
            }
        }
        for k in (0..plate.hole.len()).filter(|k| plate.hole[*k]) {
            m.flag[start + k] = Flag::Filled;
        }
    }
}
