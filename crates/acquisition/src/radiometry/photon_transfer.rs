//! Photon transfer: gain from the noise of pairs of frames, read noise from pairs in the dark.
//!
//! Half the variance of the difference of two frames, pixels of one colour and like level together, holds no fixed pattern. Of linearised counts it is
//! `f′² (ρ² + 1/12) + S/g` with the slope f′ of the linearisation, read noise ρ in counts, the rounding to counts, signal S and electrons per count g.
//! A straight line in S gives 1/g. The lamp's change between the two frames is taken off as one factor.

use super::linearity::{Linearity, USED};
use super::series::Level;
use crate::pixel_map::PixelMap;
use gonio_instrument::radiometry::Known;

/// Bins of level for each pair.
const BINS: usize = 12;
/// Fewest pixels of a bin.
const LEAST: usize = 60;
/// Variance of rounding to whole counts.
const ROUNDING: f64 = 1.0 / 12.0;

/// A point of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// Linearised counts above black.
    pub signal: f64,
    /// Variance of a frame without rounding, counts².
    pub variance: f64,
    /// Relative standard uncertainty of the variance.
    pub relative: f64,
    /// f′².
    slope2: f64,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonTransfer {
    /// Electrons per count, red, green, blue.
    pub electrons_per_count: [Known; 3],
    /// Their mean; the linearisation's error is common to the three.
    pub mean: Known,
    /// Change of ln(electrons per count) with c2 and c3 of the linearisation.
    pub by_bend: [f64; 2],
    /// Read noise without rounding, electrons.
    pub read_noise_e: Known,
    /// The curve.
    pub points: Vec<Point>,
    /// Squared residuals over their uncertainties, over degrees of freedom.
    pub reduced_chi2: f64,
}

/// Finds gain and read noise; `usable` and `black` as in [`super::linearity::find`]. `None` where a colour has fewer than three points.
#[must_use]
pub fn find(
    levels: &[Level<'_>],
    map: &PixelMap,
    usable: &[bool],
    black: f64,
    linearity: &Linearity,
) -> Option<PhotonTransfer> {
    let camera = &map.description().camera;
    let range = f64::from(camera.top_code() - camera.black_level);
    let mut points = Vec::new();
    for level in levels {
        for pair in level.lit.chunks_exact(2) {
            let frames = [&pair[0].frame.pixels, &pair[1].frame.pixels];
            for channel in 0..3 {
                points.extend(curve(frames, map, usable, black, range, linearity, channel));
            }
        }
    }
    // variance of reading alone, from the shortest dark exposures: the dark current of the long ones is noise of its own
    let mut read = Vec::new();
    for level in levels.iter().take(levels.len().div_ceil(2)) {
        for pair in level.dark.chunks_exact(2) {
            let (mut n, mut sum, mut square) = (0.0, 0.0, 0.0);
            for p in (0..usable.len()).filter(|&p| usable[p]) {
                let d = f64::from(pair[0].frame.pixels[p]) - f64::from(pair[1].frame.pixels[p]);
                n += 1.0;
                sum += d;
                square += d * d;
            }
            if n > 2.0 {
                read.push((0.5 * (square - sum * sum / n) / (n - 1.0) - ROUNDING, (2.0 / n).sqrt()));
            }
        }
    }
    if read.is_empty() {
        return None;
    }
    let mean = read.iter().map(|r| r.0).sum::<f64>() / read.len() as f64;
    let read2 = mean.max(0.0);
    let read2_sigma =
        (read.iter().map(|r| (r.1 * (r.0 + ROUNDING)).powi(2)).sum::<f64>()).sqrt() / read.len() as f64;
    let mut gain = [Known::default(); 3];
    let (mut chi2, mut freedom, mut own2, mut by_bend) = (0.0, 0.0, 0.0, [0.0; 2]);
    for (channel, gain) in gain.iter_mut().enumerate() {
        let own: Vec<&Point> = points.iter().filter(|p| p.channel == channel).collect();
        let fit = slope(&own, read2, read2_sigma)?;
        // y' = 1 + 2 c2 x + 3 c3 x² stands squared in a variance, y = x + c2 x² + c3 x³ in the signal
        let by = [1, 2].map(|k| {
            let power = |p: &Point| (p.signal.max(0.0) / range).powi(k);
            -f64::from(2 * k + 1) * own.iter().zip(&fit.weights).map(|(p, w)| w * power(p)).sum::<f64>()
        });
        let relative = fit.sigma / fit.slope;
        *gain = Known::new(1.0 / fit.slope, relative.hypot(linearity.along(by)) / fit.slope);
        (0..2).for_each(|k| by_bend[k] += by[k] / 3.0);
        own2 += relative * relative;
        chi2 += fit.chi2;
        freedom += own.len() as f64 - 1.0;
    }
    let mean_gain = gain.iter().map(|g| g.value).sum::<f64>() / 3.0;
    let relative = (own2 / 9.0).sqrt().hypot(linearity.along(by_bend));
    let read_counts = read2.sqrt();
    let read_sigma = if read_counts > 0.0 { 0.5 * read2_sigma / read_counts } else { read2_sigma.sqrt() };
    let read_noise = read_counts * mean_gain;
    Some(PhotonTransfer {
        electrons_per_count: gain,
        mean: Known::new(mean_gain, mean_gain * relative),
        by_bend,
        read_noise_e: Known::new(read_noise, (read_sigma * mean_gain).hypot(read_noise * relative)),
        points,
        reduced_chi2: chi2 / f64::max(freedom, 1.0),
    })
}

/// The points of a pair in one colour.
#[allow(clippy::too_many_arguments)] // one call
fn curve(
    frames: [&Vec<u16>; 2],
    map: &PixelMap,
    usable: &[bool],
    black: f64,
    range: f64,
    linearity: &Linearity,
    channel: usize,
) -> Vec<Point> {
    let x = |raw: u16| (f64::from(raw) - black) / range;
    let mut values: Vec<(f64, f64)> = (0..usable.len())
        .filter(|&p| usable[p] && map.channel(p) == channel)
        .map(|p| (x(frames[0][p]), x(frames[1][p])))
        .collect();
    // the mean of two is blind to their difference: sorting by it does not bias the variance
    values.sort_by(|a, b| (a.0 + a.1).total_cmp(&(b.0 + b.1)));
    let size = values.len().div_ceil(BINS).max(LEAST);
    let total = |f: fn(&(f64, f64)) -> f64| values.iter().map(f).sum::<f64>();
    let factor =
        if total(|v| v.1) > 0.02 * values.len() as f64 { total(|v| v.0) / total(|v| v.1) } else { 1.0 };
    values
        .chunks(size)
        .filter(|c| c.len() >= LEAST)
        .filter_map(|chunk| {
            let n = chunk.len() as f64;
            let level = chunk.iter().map(|v| 0.5 * (v.0 + v.1)).sum::<f64>() / n;
            if level > USED - 0.04 {
                return None;
            }
            let y = |x: f64| range * linearity.apply(x);
            let (mut sum, mut square, mut signal) = (0.0, 0.0, 0.0);
            for (a, b) in chunk {
                let d = y(*a) - factor * y(*b);
                sum += d;
                square += d * d;
                signal += 0.5 * (y(*a) + factor * y(*b));
            }
            let slope2 = linearity.slope(level).powi(2);
            let variance = 0.5 * (square - sum * sum / n) / (n - 1.0) - slope2 * ROUNDING;
            Some(Point { channel, signal: signal / n, variance, relative: (2.0 / (n - 1.0)).sqrt(), slope2 })
        })
        .collect()
}

struct Line {
    slope: f64,
    sigma: f64,
    chi2: f64,
    /// What each point counts for in ln(slope); they sum to one.
    weights: Vec<f64>,
}

/// 1/g through the read noise known from the dark, weights from the line itself.
fn slope(points: &[&Point], read2: f64, read2_sigma: f64) -> Option<Line> {
    if points.iter().filter(|p| p.signal > 20.0).count() < 3 {
        return None;
    }
    let model = |p: &Point, slope: f64| p.slope2 * read2 + slope * p.signal.max(0.0);
    let top = points.iter().max_by(|a, b| a.signal.total_cmp(&b.signal))?;
    let mut slope = ((top.variance - read2) / top.signal).max(1e-6);
    let (mut information, mut pull) = (0.0, 0.0);
    for _ in 0..5 {
        let (mut num, mut den) = (0.0, 0.0);
        pull = 0.0;
        for p in points {
            let w = 1.0 / (p.relative * (model(p, slope) + ROUNDING)).powi(2);
            num += w * p.signal * (p.variance - p.slope2 * read2);
            den += w * p.signal * p.signal;
            pull += w * p.signal * p.slope2;
        }
        slope = (num / den).max(1e-9);
        information = den;
        pull /= den;
    }
    let chi2: f64 = points
        .iter()
        .map(|p| ((p.variance - model(p, slope)) / (p.relative * (model(p, slope) + ROUNDING))).powi(2))
        .sum();
    let widened = (chi2 / (points.len() as f64 - 1.0)).max(1.0);
    let weights = points
        .iter()
        .map(|p| (p.signal / (p.relative * (model(p, slope) + ROUNDING))).powi(2) / information)
        .collect();
    Some(Line { slope, sigma: (widened / information).sqrt().hypot(pull * read2_sigma), chi2, weights })
}
