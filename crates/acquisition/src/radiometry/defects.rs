//! Pixels that answer to light other than those around them, and how much the sound ones differ.
//!
//! A pixel is held against the mean of its eight neighbours of the same colour in evenly lit frames, étendue taken off.

use gonio_instrument::radiometry::Known;

use crate::pixel_map::PixelMap;
use crate::robust::{SIGMA_OF_MEDIAN, median};

/// Response below and above which a pixel is dead, relative to its surroundings.
const DEAD: [f64; 2] = [0.5, 2.0];
/// Departures beyond this take no part in the usual spread.
const USUAL: f64 = 0.2;

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Dead pixels.
    pub dead: Vec<u32>,
    /// Standard deviation of the sound pixels' sensitivities, relative, noise taken off.
    pub spread: Known,
}

/// Judges the mean `signal` (linear in the light) of well exposed frames, NaN where a pixel is not to be judged. `noise` is the relative variance of a
/// pixel's signal.
#[must_use]
pub fn find(signal: &[f32], map: &PixelMap, noise: impl Fn(usize) -> f64) -> Response {
    let (w, h) = (map.width(), map.height());
    let even = |p: usize| {
        let e = map.optics().etendue((p % w) as f64 + 0.5, (p / w) as f64 + 0.5);
        f64::from(signal[p]) / e.max(1e-9)
    };
    let flat: Vec<f64> = (0..w * h).map(even).collect();
    let mut dead = Vec::new();
    let (mut departures, mut shaken) = (Vec::new(), 0.0);
    for p in (0..w * h).filter(|&p| flat[p].is_finite()) {
        let (x, y) = (p % w, p / w);
        let mut around: Vec<f64> = Vec::with_capacity(8);
        for v in [y.wrapping_sub(2), y, y + 2] {
            for u in [x.wrapping_sub(2), x, x + 2] {
                if u < w && v < h && (u, v) != (x, y) && flat[v * w + u].is_finite() {
                    around.push(flat[v * w + u]);
                }
            }
        }
        if around.len() < 3 {
            continue;
        }
        around.sort_unstable_by(f64::total_cmp);
        // the median: a dead neighbour must not count
        let level = 0.5 * (around[around.len() / 2] + around[(around.len() - 1) / 2]);
        if level <= 0.0 {
            continue;
        }
        let off = flat[p] / level - 1.0;
        if !(DEAD[0] - 1.0..=DEAD[1] - 1.0).contains(&off) {
            dead.push(p as u32);
        } else if off.abs() < USUAL
            && around.len() == 8
            && around.iter().all(|v| (v / level - 1.0).abs() < USUAL)
        {
            let mean = around.iter().sum::<f64>() / 8.0;
            departures.push((flat[p] / mean - 1.0).abs());
            shaken += noise(p);
        }
    }
    // by the median, which edges of shadows do not widen; the mean of eight neighbours has an eighth of one's variance
    let (n, own) = (departures.len().max(1) as f64, 9.0 / 8.0);
    let total = (SIGMA_OF_MEDIAN * median(&mut departures).unwrap_or(0.0)).powi(2) / own;
    let spread = (total - shaken / n).max(0.0).sqrt();
    // a median of n squares is known to about 2.3/√n, of neighbours that overlap a little less
    let square_sigma = total * 3.0 / n.sqrt();
    let sigma = square_sigma / (2.0 * spread.max(square_sigma.sqrt()));
    Response { dead, spread: Known::new(spread, sigma) }
}
