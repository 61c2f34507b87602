//! Lamp light that comes past the sample, from the picture of a light trap.

use gonio_instrument::radiometry::Haze;

use crate::merge::Merged;
use crate::pixel_map::PixelMap;

/// Variance of the mean of the middle half of many normal deviates over that of the mean of all.
const MIDDLE_HALF: f64 = 1.19;

/// The haze of a merged pose of a trap: robust means on a coarse grid. Its own glare and tails stay in it: it is taken off before them.
#[must_use]
pub fn of_trap(merged: &[Merged], map: &PixelMap) -> Haze {
    let across = 20u32.min(map.width() as u32 / 8);
    let down = 16u32.min(map.height() as u32 / 8);
    let mut cells: Vec<[Vec<f64>; 3]> = (0..across * down).map(|_| Default::default()).collect();
    let (w, h) = (map.width(), map.height());
    let mut noise = [[0.0; 2]; 3];
    for (p, m) in merged.iter().enumerate().filter(|(_, m)| m.is_valid()) {
        let (x, y) = (p % w * across as usize / w, p / w * down as usize / h);
        let c = map.channel(p);
        cells[y * across as usize + x][c].push(f64::from(m.rate));
        noise[c] = [noise[c][0] + f64::from(m.shot + m.read + m.dark), noise[c][1] + 1.0];
    }
    let mut all: Vec<f64> = cells.iter().flatten().flatten().copied().collect();
    all.sort_unstable_by(f64::total_cmp);
    let median = all.get(all.len() / 2).copied().unwrap_or(0.0);
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
    // the middle half of normal deviates has 1.19 times the variance of all of them
    let sigma_e_s =
        noise.map(|[sum, n]| (MIDDLE_HALF * sum * f64::from(across * down)).sqrt() / f64::max(n, 1.0));
    Haze { tiles: [across, down], rates_e_s, sigma_e_s }
}

/// Mean of hazes on one grid; `None` without any.
#[must_use]
pub fn mean(hazes: &[Haze]) -> Option<Haze> {
    let mut out = hazes.first()?.clone();
    let n = hazes.len() as f32;
    for (k, tile) in out.rates_e_s.iter_mut().enumerate() {
        *tile = [0, 1, 2].map(|c| hazes.iter().map(|h| h.rates_e_s[k][c]).sum::<f32>() / n);
    }
    out.sigma_e_s =
        [0, 1, 2].map(|c| hazes.iter().map(|h| h.sigma_e_s[c].powi(2)).sum::<f64>().sqrt() / f64::from(n));
    Some(out)
}
