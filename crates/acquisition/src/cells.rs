//! Cell means of one pose: the weighted means of f over each bin, with the variance in parts.

use rayon::prelude::*;

use crate::merge::Merged;
use crate::pixel_map::{PixelMap, PoseView};
use crate::reference::WhiteReference;
use crate::weights::Weights;

/// Share of a bin from which on it counts as seen whole.
const WHOLE: f64 = 0.985;

/// A cell at one pose; variances in 1/sr².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// f in 1/sr.
    pub value: [f64; 3],
    /// From the statistics of light.
    pub shot: [f64; 3],
    /// From reading and rounding.
    pub read: [f64; 3],
    /// From the dark signal.
    pub dark: [f64; 3],
    /// From the noise of the white reference's pixels.
    pub reference: [f64; 3],
    /// From what a coat's gloss hid: the base under it is a surface fitted around it.
    pub coat: [f64; 3],
    /// How far the part seen lies from the bin's centroid, radians.
    pub off_centre_rad: f64,
}

/// f of a pixel and its variances; f is NaN where nothing is known, infinite where every exposure is saturated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelValue {
    pub(crate) f: f32,
    pub(crate) shot: f32,
    pub(crate) read: f32,
    pub(crate) dark: f32,
    pub(crate) reference: f32,
}

impl PixelValue {
    /// A pixel that says nothing.
    pub(crate) const UNKNOWN: Self = Self { f: f32::NAN, shot: 0.0, read: 0.0, dark: 0.0, reference: 0.0 };

    /// Of a merged pixel; `per_rate` as [`per_rate`] gives it, `relative` the relative variance that it has from the white reference.
    pub(crate) fn of(m: &Merged, per_rate: f32, relative: f32) -> Self {
        if m.rate == f32::INFINITY {
            return Self { f: f32::INFINITY, ..Self::UNKNOWN };
        }
        if !m.is_valid() || per_rate <= 0.0 {
            return Self::UNKNOWN;
        }
        let (f, square) = (m.rate * per_rate, per_rate * per_rate);
        Self {
            f,
            shot: square * m.shot,
            read: square * m.read,
            dark: square * m.dark,
            reference: f * f * relative,
        }
    }

    /// Variance of its own noise, 1/sr².
    pub(crate) fn noise(&self) -> f64 {
        f64::from(self.shot) + f64::from(self.read) + f64::from(self.dark) + f64::from(self.reference)
    }
}

/// How the pixels of a pose become cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binning {
    /// Azimuths of the grid.
    pub azimuths: usize,
    /// See [`crate::Options::min_coverage`].
    pub min_coverage: f64,
}

/// f in 1/sr for one electron per second, of every pixel at a pose; 0 where the white reference says nothing or the lamp's spot does not fill
/// half of what the pixel looks at. `mean_cos_i` is the mean of cos θ' over the lamp.
#[must_use]
pub(crate) fn per_rate(map: &PixelMap, view: &PoseView, white: &WhiteReference, mean_cos_i: f64) -> Vec<f32> {
    let cos_i = view.theta_i.cos();
    (0..white.scale.len())
        .into_par_iter()
        .with_min_len(4096)
        .map(|p| {
            let k = f64::from(white.scale[p]);
            if k.is_nan() || k <= 0.0 || !view.visible[p] {
                return 0.0;
            }
            let lit = map.lit_share(p, &view.sample_from_lab, cos_i);
            if lit < 0.5 {
                return 0.0;
            }
            // the mean of 1/k lies above 1/mean of k by its relative variance
            ((1.0 - f64::from(white.relative_variance[p])) / (k * mean_cos_i * lit)) as f32
        })
        .collect()
}

/// The cells of a pose, θo by φ as in [`gonio_brdf::Grid::index`] without θi; `None` where too little was seen.
#[must_use]
pub(crate) fn cells(weights: &Weights, sums: &[Sum], bins: &Binning) -> Vec<Option<Cell>> {
    let azimuths = bins.azimuths;
    let count = weights.bins() / 2;
    let mut out: Vec<Option<Cell>> = (0..count)
        .into_par_iter()
        .map(|cell| {
            if cell < azimuths && cell > 0 && weights.coverage(cell) == 0.0 {
                return None;
            }
            let sides = [cell, count + cell];
            one(weights, &sides.map(|bin| [0, 1, 2].map(|c| sums[bin * 3 + c])), sides, bins.min_coverage)
        })
        .collect();
    if has_cap(weights, azimuths) {
        let cap = out[0];
        out[1..azimuths].fill(cap);
    }
    out
}

/// The cells of each side of the plane of incidence by itself: φ ≥ 0 first, then φ < 0, either as [`cells`].
#[must_use]
pub(crate) fn side_cells(weights: &Weights, sums: &[Sum], bins: &Binning) -> Vec<Option<Cell>> {
    let cap = has_cap(weights, bins.azimuths);
    (0..weights.bins())
        .map(|bin| {
            let cell = bin % (weights.bins() / 2);
            let first = if cap && cell < bins.azimuths { bin - cell } else { bin };
            let mine = [0, 1, 2].map(|c| sums[first * 3 + c]);
            one(weights, &[mine, Default::default()], [first; 2], bins.min_coverage)
        })
        .collect()
}

/// Whether the row about the normal is one cap shared by all azimuths; its weights are kept in the first.
fn has_cap(weights: &Weights, azimuths: usize) -> bool {
    weights.coverage(0) > 0.0 && (1..azimuths).all(|k| weights.coverage(k) == 0.0)
}

/// The cells among `candidates` that lean on one of the `hidden` pixels, from `pixels` as they are now; with each its share of hidden weight.
#[must_use]
pub(crate) fn cells_over(
    weights: &Weights,
    pixels: &(dyn Fn(usize) -> PixelValue + Sync),
    bins: &Binning,
    hidden: &(dyn Fn(usize) -> bool + Sync),
    candidates: &[usize],
) -> Vec<(usize, Option<Cell>, f64)> {
    let count = weights.bins() / 2;
    let cap = has_cap(weights, bins.azimuths);
    let mut out: Vec<(usize, Option<Cell>, f64)> = candidates
        .par_iter()
        .filter_map(|&cell| {
            if cap && (1..bins.azimuths).contains(&cell) {
                return None;
            }
            let sides = [cell, count + cell];
            let (mut under, mut all) = (0.0, 0.0);
            for bin in sides {
                for channel in 0..3 {
                    let (list, ws) = weights.list(bin, channel);
                    for (&p, &w) in list.iter().zip(ws) {
                        all += f64::from(w.abs());
                        under += if hidden(p as usize) { f64::from(w.abs()) } else { 0.0 };
                    }
                }
            }
            (under > 0.0).then(|| {
                let sums = sides.map(|bin| [0, 1, 2].map(|c| sum(weights, pixels, bin, c)));
                (cell, one(weights, &sums, sides, bins.min_coverage), under / all)
            })
        })
        .collect();
    if let Some(&(0, cell, share)) = out.first().filter(|_| cap) {
        out.extend((1..bins.azimuths).map(|k| (k, cell, share)));
    }
    out
}

/// Sums of a cell's channel on one side. `all` and `valid` are of the magnitudes of the weights: of all, and of those whose pixel is known.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sum {
    pub(crate) w: f64,
    pub(crate) all: f64,
    pub(crate) valid: f64,
    pub(crate) value: f64,
    pub(crate) shot: f64,
    pub(crate) read: f64,
    pub(crate) dark: f64,
    pub(crate) reference: f64,
    pub(crate) saturated: bool,
}

/// The sums pixel by pixel, for the few cells that a gloss touches.
pub(crate) fn sum(
    weights: &Weights,
    pixels: &(dyn Fn(usize) -> PixelValue + Sync),
    bin: usize,
    channel: usize,
) -> Sum {
    let mut s = Sum::default();
    let (list, ws) = weights.list(bin, channel);
    for (&p, &w) in list.iter().zip(ws) {
        let v = pixels(p as usize);
        let w = f64::from(w);
        s.all += w.abs();
        s.saturated |= v.f == f32::INFINITY;
        if !v.f.is_finite() {
            continue;
        }
        s.valid += w.abs();
        s.w += w;
        s.value += w * f64::from(v.f);
        let w2 = w * w;
        s.shot += w2 * f64::from(v.shot);
        s.read += w2 * f64::from(v.read);
        s.dark += w2 * f64::from(v.dark);
        s.reference += w2 * f64::from(v.reference);
    }
    s
}

/// A cell from the sides that see it whole, else from those that see enough of it.
fn one(weights: &Weights, sums: &[[Sum; 3]; 2], sides: [usize; 2], min_coverage: f64) -> Option<Cell> {
    let seen: [f64; 2] = [0, 1].map(|k| {
        let valid = sums[k]
            .iter()
            // what saturates is no gap to be passed over: it is the brightest part of the cell
            .map(|s| if s.all > 0.0 && s.w > 0.0 && !s.saturated { s.valid / s.all } else { 0.0 })
            .fold(1.0, f64::min);
        weights.coverage(sides[k]).min(1.0) * valid
    });
    let bound = if seen.iter().any(|s| *s >= WHOLE) { WHOLE } else { min_coverage };
    let used: Vec<usize> = (0..2).filter(|&k| seen[k] >= bound).collect();
    if used.is_empty() {
        return None;
    }
    let mut cell = Cell::default();
    for c in [0, 1, 2] {
        let total = |f: fn(&Sum) -> f64| used.iter().map(|&k| f(&sums[k][c])).sum::<f64>();
        let w = total(|s| s.w);
        cell.value[c] = total(|s| s.value) / w;
        let w2 = w * w;
        cell.shot[c] = total(|s| s.shot) / w2;
        cell.read[c] = total(|s| s.read) / w2;
        cell.dark[c] = total(|s| s.dark) / w2;
        cell.reference[c] = total(|s| s.reference) / w2;
    }
    let n = used.len() as f64;
    cell.off_centre_rad = used.iter().map(|&k| weights.off_centre_rad(sides[k])).sum::<f64>() / n;
    Some(cell)
}
