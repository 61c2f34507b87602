//! Lamp light that comes past the sample, from the picture of a light trap.

use gonio_instrument::radiometry::Haze;

use crate::merge::Merged;
use crate::pixel_map::PixelMap;
use crate::robust::{SIGMA_OF_MEDIAN, median};

/// Values of a tile farther from their median than so many of its standard deviations stay out: hot pixels that were not known. Where light bends in a tile, none is so
/// far; a middle half would be the mean of another place.
const FAR: f64 = 6.0;

/// The haze of one merged pose.
#[derive(Clone, Debug)]
pub struct Seen {
    tiles: [u32; 2],
    /// Red, green, blue of each tile, row by row.
    rates_e_s: Vec<[f64; 3]>,
    /// Variance of a tile's rate from the noise of this pose, colour by colour.
    own: [f64; 3],
    /// From dark frames and the pixels' sensitivities, the same in every pose.
    shared: [f64; 3],
}

/// The haze of a merged pose of a trap: robust means on a coarse grid. Its own glare and tails stay in it: it is taken off before them. `response` is the relative
/// standard deviation of the pixels' sensitivities.
#[must_use]
pub fn of_trap(merged: &[Merged], map: &PixelMap, response: f64) -> Seen {
    let tiles = [20u32.min(map.width() as u32 / 8), 16u32.min(map.height() as u32 / 8)];
    let rates_e_s = means(merged, map, tiles);
    let (mut own, mut shared) = ([[0.0; 2]; 3], [0.0; 3]);
    for (p, m) in merged.iter().enumerate().filter(|(_, m)| m.is_valid()) {
        let c = map.channel(p);
        own[c] = [own[c][0] + f64::from(m.shot + m.read), own[c][1] + 1.0];
        shared[c] += f64::from(m.dark) + (response * rates_e_s[tile_of(p, map, tiles)][c]).powi(2);
    }
    // of a pixel's mean variance over the pixels of a tile
    let many = f64::from(tiles[0] * tiles[1]);
    let of_mean = |sum: f64, n: f64| many * sum / f64::max(n, 1.0).powi(2);
    let shared = [0, 1, 2].map(|c| of_mean(shared[c], own[c][1]));
    Seen { tiles, rates_e_s, own: own.map(|[sum, n]| of_mean(sum, n)), shared }
}

fn tile_of(p: usize, map: &PixelMap, [across, down]: [u32; 2]) -> usize {
    let (w, h) = (map.width(), map.height());
    (p / w * down as usize / h) * across as usize + p % w * across as usize / w
}

/// Robust means of each tile's valid pixels, red, green, blue. A tile without any takes the median of all.
fn means(merged: &[Merged], map: &PixelMap, tiles: [u32; 2]) -> Vec<[f64; 3]> {
    let mut cells: Vec<[Vec<f64>; 3]> = (0..tiles[0] * tiles[1]).map(|_| Default::default()).collect();
    for (p, m) in merged.iter().enumerate().filter(|(_, m)| m.is_valid()) {
        cells[tile_of(p, map, tiles)][map.channel(p)].push(f64::from(m.rate));
    }
    let mut all: Vec<f64> = cells.iter().flatten().flatten().copied().collect();
    let overall = median(&mut all).unwrap_or(0.0);
    cells.iter_mut().map(|c| c.each_mut().map(|v| robust_mean(v).unwrap_or(overall))).collect()
}

fn robust_mean(values: &mut [f64]) -> Option<f64> {
    let middle = median(values)?;
    let mut distances: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
    let far = FAR * SIGMA_OF_MEDIAN * median(&mut distances)?;
    let near = || values.iter().filter(|v| (*v - middle).abs() <= far);
    Some(near().sum::<f64>() / near().count().max(1) as f64)
}

/// Mean of hazes on one grid; `None` without any.
#[must_use]
pub fn mean(hazes: &[Seen]) -> Option<Haze> {
    let tiles = hazes.first()?.tiles;
    let n = hazes.len() as f64;
    let rates_e_s = (0..hazes.first()?.rates_e_s.len())
        .map(|k| [0, 1, 2].map(|c| (hazes.iter().map(|h| h.rates_e_s[k][c]).sum::<f64>() / n) as f32))
        .collect();
    let sigma_e_s =
        [0, 1, 2].map(|c| hazes.iter().map(|h| h.own[c] / (n * n) + h.shared[c] / n).sum::<f64>().sqrt());
    Some(Haze { tiles, rates_e_s, sigma_e_s })
}

#[cfg(test)]
mod tests {
    use gonio_instrument::builtin;

    use super::*;

    const RESPONSE: f64 = 0.01;
    const SHOT: f64 = 4.0;

    /// A glow, as a share across and down.
    fn glow(map: &PixelMap, p: usize) -> f64 {
        let (x, y) =
            ((p % map.width()) as f64 / map.width() as f64, (p / map.width()) as f64 / map.height() as f64);
        500.0 * (0.5 + 0.2 * x + (-((x - 0.7).powi(2) + (y - 0.6).powi(2)) / 0.045).exp())
    }

    fn normal(word: u64) -> f64 {
        let even = |k: u64| {
            let mut z = (word * 12 + k).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(even).sum::<f64>() - 6.0
    }

    /// The picture of a trap: `noise` of light, and pixels that differ.
    fn picture(map: &PixelMap, noise: f64, response: f64, seed: u64) -> Vec<Merged> {
        let n = map.width() * map.height();
        (0..n)
            .map(|p| {
                let light = glow(map, p) * (1.0 + response * normal(p as u64));
                let rate = light + noise * SHOT.sqrt() * normal((seed << 32) | p as u64);
                Merged { rate: rate as f32, shot: SHOT as f32, read: 0.0, dark: 0.0, exposure: 1.0 }
            })
            .collect()
    }

    /// Off by how much, over the uncertainty: root mean square over tiles and colours. And the largest share by which a tile is off.
    fn off(haze: &Haze, map: &PixelMap) -> [f64; 2] {
        let mut truth = vec![[[0.0; 2]; 3]; haze.rates_e_s.len()];
        for p in 0..map.width() * map.height() {
            let sum = &mut truth[tile_of(p, map, haze.tiles)][map.channel(p)];
            *sum = [sum[0] + glow(map, p), sum[1] + 1.0];
        }
        let (mut squares, mut largest) = (0.0, 0.0f64);
        for (found, truth) in haze.rates_e_s.iter().zip(&truth) {
            for c in 0..3 {
                let truth = truth[c][0] / truth[c][1];
                let off = f64::from(found[c]) - truth;
                squares += (off / haze.sigma_e_s[c]).powi(2);
                largest = largest.max((off / truth).abs());
            }
        }
        [(squares / (3 * truth.len()) as f64).sqrt(), largest]
    }

    #[test]
    fn a_tile_in_which_light_bends_has_its_mean() {
        let map = PixelMap::new(&builtin::description("tiny").expect("known").expect("readable"));
        let mut seen = picture(&map, 0.0, 0.0, 0);
        let haze = mean(&[of_trap(&seen, &map, RESPONSE)]).expect("one");
        let [_, largest] = off(&haze, &map);
        assert!(largest < 1e-6, "{largest:e}");
        // a hot pixel stays out, and takes no more than its place with it
        seen[1000].rate += 1e4;
        let [_, largest] = off(&mean(&[of_trap(&seen, &map, RESPONSE)]).expect("one"), &map);
        assert!(largest < 5e-3, "{largest:e}");
    }

    #[test]
    fn tiles_are_as_uncertain_as_noise_and_pixels_make_them() {
        let map = PixelMap::new(&builtin::description("tiny").expect("known").expect("readable"));
        for poses in [1, 6] {
            let seen: Vec<Seen> =
                (1..=poses).map(|k| of_trap(&picture(&map, 1.0, RESPONSE, k), &map, RESPONSE)).collect();
            let [z, _] = off(&mean(&seen).expect("some"), &map);
            assert!((0.9..1.15).contains(&z), "{poses} poses: {z}");
        }
    }
}
