//! How much light goes astray: veiling glare from the pixels that see nothing, the tail of a point from the surroundings of a gloss, both from both.
//!
//! Tiles of the filter pattern well away from every pixel that sees the sample are dark by nature; in a white session they show `g mean + ε K∗x`. About
//! the mirror image of the lamp on black glass all that shows is the tail and, evenly, everything else, which a constant of its own takes up pose by pose.
//! Linear in g and ε; σ of the tail is searched. The uncertainty is the larger of what noise says and what leaving out one pose after the other does.

use gonio_instrument::radiometry::{Haze, Known};
use nalgebra::{Matrix2, Vector2};

use super::stray::{Tiles, tiles};
use crate::merge::Merged;
use crate::pixel_map::{PixelMap, PoseView};

/// Tiles about a gloss that belong to it beyond the lamp's image.
const GLOSS_MARGIN: usize = 2;
/// Tiles out to which the surroundings of a gloss are looked at.
const GLOSS_REACH: usize = 40;
/// Error of the model's own, relative: what tiles and four Gaussians cannot tell.
const OWN_ERROR: f64 = 0.03;

/// Step of the width when it is searched at last.
const STEP: f64 = 1.06;
/// A tile that differs from the model by more than so many standard deviations, and by half of it, is no tile without light of its own.
const STRANGE: f64 = 5.0;

/// What one pose shows of stray light.
#[derive(Clone, Debug)]
pub struct Evidence {
    seen: Tiles,
    /// Variance of each tile.
    variance: Vec<f64>,
    /// Places of the tiles that take part.
    at: Vec<usize>,
    /// Whether everything even is taken up by a constant.
    constant: bool,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// g.
    pub glare: Known,
    /// ε.
    pub tail_share: Known,
    /// σ of the narrowest Gaussian, mm.
    pub tail_radius_mm: f64,
    /// Whether a gloss was among the evidence.
    pub from_gloss: bool,
    /// For the picture: of the blind tiles what the model says, what is seen (both over the picture's mean) and how many tiles.
    pub profile: Vec<[f64; 3]>,
}

fn green(merged: &[Merged], map: &PixelMap) -> (Tiles, Vec<f64>) {
    let [_, seen, _] = tiles(map, |p| f64::from(merged[p].rate));
    let [_, variance, _] = tiles(map, |p| f64::from(merged[p].shot + merged[p].read + merged[p].dark));
    (seen, variance.values)
}

impl Evidence {
    /// The blind pixels of a pose of a diffuse sample; haze is taken off already.
    #[must_use]
    pub fn of_blind(merged: &[Merged], view: &PoseView, map: &PixelMap) -> Self {
        let (seen, variance) = green(merged, map);
        let margin = (map.width() / 200).max(2);
        let far = distance_from(&seen, |p| view.visible[p], map);
        let at = (0..far.len()).filter(|&i| far[i] >= margin && variance[i] > 0.0).collect();
        Self { seen, variance, at, constant: false }
    }

    /// The surroundings of the gloss of black glass; `None` where no gloss stands out.
    #[must_use]
    pub fn of_gloss(merged: &[Merged], map: &PixelMap) -> Option<Self> {
        let (seen, variance) = green(merged, map);
        let w = seen.width;
        let brightest = (0..seen.values.len()).max_by(|&a, &b| seen.values[a].total_cmp(&seen.values[b]))?;
        let (x0, y0) = (brightest % w, brightest / w);
        if seen.values[brightest] < 100.0 * seen.mean().max(1.0) {
            return None;
        }
        let pixel = 2 * y0 * map.width() + 2 * x0;
        let pitch = map.solid_angle(pixel).sqrt().max(1e-6);
        let inner =
            (map.description().lamp.half_angle().radians() / pitch * 0.5).ceil() as usize + GLOSS_MARGIN;
        // a gloss that is cut off by the picture's edge, or whose pixels are saturated throughout, has lost light
        let whole = x0 >= inner && y0 >= inner && x0 + inner < w && y0 + inner < seen.height;
        let lost = (0..merged.len()).any(|p| {
            let (x, y) = (p % map.width() / 2, p / map.width() / 2);
            x.abs_diff(x0) <= inner && y.abs_diff(y0) <= inner && merged[p].rate == f32::INFINITY
        });
        if !whole || lost {
            return None;
        }
        let at = (0..seen.values.len())
            .filter(|&i| {
                let d = (i % w).abs_diff(x0).pow(2) + (i / w).abs_diff(y0).pow(2);
                d > inner * inner && d <= (inner + GLOSS_REACH).pow(2) && variance[i] > 0.0
            })
            .collect();
        Some(Self { seen, variance, at, constant: true })
    }

    /// Drops tiles that see light of their own after all: edges that are not where they should be.
    fn without_strangers(&mut self, shares: [f64; 2], sigma: f64) {
        let (mean, tails) = (self.seen.mean(), self.seen.tails(sigma));
        let keep = |i: &usize| {
            let model = shares[0] * mean + shares[1] * tails.values[*i];
            (self.seen.values[*i] - model).abs() <= 0.5 * model.abs() + STRANGE * self.variance[*i].sqrt()
        };
        if !self.constant {
            let kept: Vec<usize> = self.at.iter().copied().filter(keep).collect();
            self.at = kept;
        }
    }

    /// Normal equations of (g, ε), and the sum of squares of what is seen.
    fn normal(&self, shares: [f64; 2], sigma: f64) -> Normal {
        // the light before it went astray, by the shares known so far
        let kept = 1.0 - shares[0] - shares[1];
        let mut x = self.seen.clone();
        if shares != [0.0; 2] {
            for _ in 0..2 {
                let (mean, tails) = (x.mean(), x.tails(sigma));
                for ((x, y), t) in x.values.iter_mut().zip(&self.seen.values).zip(&tails.values) {
                    *x = (y - shares[0] * mean - shares[1] * t) / kept;
                }
            }
            // what is dark by nature is dark
            if !self.constant {
                self.at.iter().for_each(|&i| x.values[i] = 0.0);
            }
        }
        let (mean, tails) = (x.mean(), x.tails(sigma));
        let mut rows: Vec<Row> = self
            .at
            .iter()
            .map(|&i| {
                let seen = self.seen.values[i];
                let own = OWN_ERROR * seen;
                Row {
                    model: [mean, tails.values[i]],
                    seen,
                    weight: 1.0 / (self.variance[i] + own * own).max(1e-12),
                }
            })
            .collect();
        if self.constant {
            let total: f64 = rows.iter().map(|r| r.weight).sum();
            let tail = rows.iter().map(|r| r.weight * r.model[1]).sum::<f64>() / total;
            let level = rows.iter().map(|r| r.weight * r.seen).sum::<f64>() / total;
            for r in &mut rows {
                r.model = [0.0, r.model[1] - tail];
                r.seen -= level;
            }
        }
        let mut out = Normal::default();
        for r in rows {
            let v = Vector2::from(r.model);
            out.n += v * v.transpose() * r.weight;
            out.b += v * (r.weight * r.seen);
            out.square += r.weight * r.seen * r.seen;
            out.count += 1.0;
        }
        out
    }
}

/// A tile: what the model gives for g = 1 and ε = 1, what is seen, its weight.
struct Row {
    model: [f64; 2],
    seen: f64,
    weight: f64,
}

#[derive(Clone, Copy, Default)]
struct Normal {
    n: Matrix2<f64>,
    b: Vector2<f64>,
    square: f64,
    count: f64,
}

impl Normal {
    fn plus(self, o: Self) -> Self {
        Self { n: self.n + o.n, b: self.b + o.b, square: self.square + o.square, count: self.count + o.count }
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
        let (x, rest) = sum_of(evidence, shares, sigma).solve()?;
        shares = [x[0].clamp(-0.02, 0.3), x[1].clamp(-0.02, 0.3)];
        left = rest;
    }
    Some((shares, left))
}

fn sum_of(evidence: &[Evidence], shares: [f64; 2], sigma: f64) -> Normal {
    evidence.iter().fold(Normal::default(), |s, e| s.plus(e.normal(shares, sigma)))
}

/// Finds glare and tail; `None` without any evidence.
#[must_use]
pub fn find(evidence: &[Evidence], map: &PixelMap) -> Option<Found> {
    let mut evidence: Vec<Evidence> = evidence.iter().filter(|e| e.at.len() >= 10).cloned().collect();
    if evidence.is_empty() {
        return None;
    }
    let mut shares = [0.0; 2];
    let mut sigma = 2.0f64;
    for round in 0..4 {
        // a grid first, then ever finer about the best
        let grid: Vec<f64> = match round {
            0 => (0..13).map(|k| 0.25 * 1.6f64.powi(k)).filter(|s| *s < 0.12 * map.width() as f64).collect(),
            1 => (-3..=3).map(|k| sigma * 1.15f64.powi(k)).collect(),
            _ => (-2..=2).map(|k| sigma * STEP.powi(k)).collect(),
        };
        let tried = grid.iter().filter_map(|s| Some((shares_at(&evidence, shares, *s, 2)?, *s)));
        let ((found, _), best) = tried.min_by(|a, b| a.0.1.total_cmp(&b.0.1))?;
        (shares, sigma) = (found, best);
        if round < 2 {
            evidence.iter_mut().for_each(|e| e.without_strangers(shares, sigma));
        }
    }
    let (shares, left) = shares_at(&evidence, shares, sigma, 4)?;
    let parts: Vec<Normal> = evidence.iter().map(|e| e.normal(shares, sigma)).collect();
    let all = parts.iter().fold(Normal::default(), |s, p| s.plus(*p));
    let scatter = (left / (all.count - 3.0).max(1.0)).max(1.0);
    let covariance = all.n.try_inverse().unwrap_or_else(Matrix2::zeros) * scatter;
    let leaving_out = jackknife(&parts);
    // a share goes with its width, which is no better known than the sum of squares is curved
    let beside =
        [1.0 / STEP, STEP].map(|f| shares_at(&evidence, shares, sigma * f, 4).unwrap_or((shares, left)));
    let curvature = (0.5 * (beside[0].1 + beside[1].1) - left).max(0.0) / scatter;
    let steps = if curvature > 0.0 { curvature.recip().sqrt().min(10.0) } else { 10.0 };
    let by_width = [0, 1].map(|k| 0.5 * (beside[1].0[k] - beside[0].0[k]) * steps);
    let known = |k: usize| {
        let own = covariance[(k, k)].max(leaving_out[k]).max(0.0);
        // the model's own error is the same in all tiles
        let common = OWN_ERROR * shares[k];
        Known::new(shares[k], (own + by_width[k] * by_width[k] + common * common).sqrt())
    };
    Some(Found {
        glare: known(0),
        tail_share: known(1),
        tail_radius_mm: sigma * 2e-3 * map.description().camera.pitch_um,
        from_gloss: evidence.iter().any(|e| e.constant),
        profile: profile(&evidence, shares, sigma),
    })
}

/// Variances of (g, ε) by leaving out one pose after the other.
fn jackknife(parts: &[Normal]) -> Vector2<f64> {
    let without: Vec<Vector2<f64>> = (0..parts.len())
        .filter_map(|k| {
            let rest = parts.iter().enumerate().filter(|(j, _)| *j != k);
            rest.fold(Normal::default(), |s, (_, p)| s.plus(*p)).solve().map(|s| s.0)
        })
        .collect();
    let n = without.len() as f64;
    if without.len() < 2 {
        return Vector2::zeros();
    }
    let mean = without.iter().fold(Vector2::zeros(), |s: Vector2<f64>, v| s + v) / n;
    without.iter().fold(Vector2::zeros(), |s, v| s + (v - mean).component_mul(&(v - mean))) * ((n - 1.0) / n)
}

fn profile(evidence: &[Evidence], shares: [f64; 2], sigma: f64) -> Vec<[f64; 3]> {
    let mut bins: std::collections::BTreeMap<usize, [f64; 3]> = std::collections::BTreeMap::new();
    for e in evidence.iter().filter(|e| !e.constant) {
        let (mean, tails) = (e.seen.mean(), e.seen.tails(sigma));
        // the model itself orders the tiles
        for &i in &e.at {
            let model = (shares[0] * mean + shares[1] * tails.values[i]) / mean;
            let bin = bins.entry((model.max(0.0) * 2e3) as usize).or_default();
            for (b, v) in bin.iter_mut().zip([1.0, model, e.seen.values[i] / mean]) {
                *b += v;
            }
        }
    }
    bins.values().filter(|b| b[0] >= 3.0).map(|b| [b[1] / b[0], b[2] / b[0], b[0]]).collect()
}

/// Distance of each pixel from the nearest marked one, in tiles of the filter pattern.
#[must_use]
pub fn pixels_from(map: &PixelMap, marked: impl Fn(usize) -> bool) -> Vec<usize> {
    let empty = Tiles { width: map.width() / 2, height: map.height() / 2, values: Vec::new() };
    let far = distance_from(&empty, marked, map);
    (0..map.width() * map.height())
        .map(|p| {
            let (x, y) = (p % map.width() / 2, p / map.width() / 2);
            far[y.min(empty.height - 1) * empty.width + x.min(empty.width - 1)]
        })
        .collect()
}

/// Mean of hazes on one grid; `None` without any.
#[must_use]
pub fn mean_haze(hazes: &[Haze]) -> Option<Haze> {
    let mut out = hazes.first()?.clone();
    let n = hazes.len() as f32;
    for (k, tile) in out.rates_e_s.iter_mut().enumerate() {
        *tile = [0, 1, 2].map(|c| hazes.iter().map(|h| h.rates_e_s[k][c]).sum::<f32>() / n);
    }
    out.sigma_e_s = hazes.iter().map(|h| h.sigma_e_s.powi(2)).sum::<f64>().sqrt() / f64::from(n);
    Some(out)
}

/// Distance of each tile from the nearest one with a marked pixel, in tiles (steps along rows, columns and diagonals).
fn distance_from(tiles: &Tiles, marked: impl Fn(usize) -> bool, map: &PixelMap) -> Vec<usize> {
    let (w, h) = (tiles.width, tiles.height);
    let far = w + h;
    let mut out = vec![far; w * h];
    for p in (0..map.width() * map.height()).filter(|&p| marked(p)) {
        let (x, y) = ((p % map.width() / 2).min(w - 1), (p / map.width() / 2).min(h - 1));
        out[y * w + x] = 0;
    }
    let mut relax = |i: usize, offsets: [(isize, isize); 4]| {
        for (dx, dy) in offsets {
            let (x, y) = ((i % w) as isize + dx, (i / w) as isize + dy);
            if (0..w as isize).contains(&x) && (0..h as isize).contains(&y) {
                out[i] = out[i].min(out[y as usize * w + x as usize] + 1);
            }
        }
    };
    (0..w * h).for_each(|i| relax(i, [(-1, 0), (-1, -1), (0, -1), (1, -1)]));
    (0..w * h).rev().for_each(|i| relax(i, [(1, 0), (1, 1), (0, 1), (-1, 1)]));
    out
}

/// The haze of a merged pose of a trap: robust means on a coarse grid. Its own glare and tails stay in it: it is taken off before them.
#[must_use]
pub fn haze(merged: &[Merged], map: &PixelMap) -> Haze {
    let across = 20u32.min(map.width() as u32 / 8);
    let down = 16u32.min(map.height() as u32 / 8);
    let mut cells: Vec<[Vec<f64>; 3]> = (0..across * down).map(|_| Default::default()).collect();
    let (w, h) = (map.width(), map.height());
    let mut noise = (0.0, 0.0);
    for (p, m) in merged.iter().enumerate().filter(|(_, m)| m.is_valid()) {
        let (x, y) = (p % w * across as usize / w, p / w * down as usize / h);
        cells[y * across as usize + x][map.channel(p)].push(f64::from(m.rate));
        noise.0 += f64::from(m.shot + m.read + m.dark);
        noise.1 += 1.0;
    }
    let mut all: Vec<f64> = cells.iter().flatten().flatten().copied().collect();
    all.sort_unstable_by(f64::total_cmp);
    let median = all.get(all.len() / 2).copied().unwrap_or(0.0);
    let per_cell = (f64::from(across * down) * 4.0 / (w * h) as f64).max(0.0);
    let rates_e_s = cells
        .iter_mut()
        .map(|c| {
            [0, 1, 2].map(|k| {
                let v = &mut c[k];
                v.sort_unstable_by(f64::total_cmp);
                // the middle half: hot pixels that were not known stay out
                let part = &v[v.len() / 4..v.len() - v.len() / 4];
                if part.is_empty() {
                    median as f32
                } else {
                    (part.iter().sum::<f64>() / part.len() as f64) as f32
                }
            })
        })
        .collect();
    let variance: f64 = noise.0 / f64::max(noise.1, 1.0);
    Haze { tiles: [across, down], rates_e_s, sigma_e_s: (1.3 * variance * per_cell).sqrt() }
}
