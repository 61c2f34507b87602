//! Light that goes astray between lens and sensor, taken off a merged picture.
//!
//! What is seen is `y = (1 − g − ε) x + g mean(x) + ε K∗x + haze`: veiling glare g spreads evenly, a tail ε about every point falls off as four Gaussians
//! of σ, 2σ, 4σ, 8σ with 8 : 4 : 2 : 1 of its light (about r⁻³ between them), haze is lamp light that never met the sample. x follows by fixed-point
//! iteration, which converges like (g + ε)ⁿ. It is done colour by colour on the tiles of the filter pattern; wide Gaussians are taken on a picture made
//! smaller. What lies beyond the picture or is saturated in every exposure sends no light that is known of.

use gonio_instrument::radiometry::{Haze, StrayLight};

use crate::merge::Merged;
use crate::pixel_map::PixelMap;

/// Shares of the tail's Gaussians.
pub const SHARES: [f64; 4] = [8.0 / 15.0, 4.0 / 15.0, 2.0 / 15.0, 1.0 / 15.0];
/// Gaussians wider than so many tiles are taken on a smaller picture.
const WIDE: f64 = 4.0;
/// Rounds of the iteration: (g + ε)⁴ is 1e-6 for 3 %.
const ROUNDS: usize = 4;

/// A picture on the tiles of the filter pattern, one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Tiles {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub values: Vec<f64>,
}

/// The three colours of a mosaic: the mean of what of each tile has a value, 0 where nothing has.
#[must_use]
pub fn tiles(map: &PixelMap, value: impl Fn(usize) -> f64) -> [Tiles; 3] {
    let w = map.width();
    let (width, height) = (w / 2, map.height() / 2);
    let mut out = [0, 1, 2].map(|_| Tiles { width, height, values: vec![0.0; width * height] });
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut n) = ([0.0; 3], [0.0f64; 3]);
            for p in [
                2 * y * w + 2 * x,
                2 * y * w + 2 * x + 1,
                (2 * y + 1) * w + 2 * x,
                (2 * y + 1) * w + 2 * x + 1,
            ] {
                let v = value(p);
                if v.is_finite() {
                    sum[map.channel(p)] += v;
                    n[map.channel(p)] += 1.0;
                }
            }
            for c in 0..3 {
                out[c].values[y * width + x] = sum[c] / n[c].max(1.0);
            }
        }
    }
    out
}

impl Tiles {
    /// Mean over the picture.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len().max(1) as f64
    }

    /// K∗x for a tail whose narrowest Gaussian has `sigma` tiles.
    #[must_use]
    pub fn tails(&self, sigma: f64) -> Self {
        let mut out = Self { values: vec![0.0; self.values.len()], ..*self };
        for (j, share) in SHARES.into_iter().enumerate() {
            let blurred = self.blurred(sigma * f64::from(1 << j));
            for (o, b) in out.values.iter_mut().zip(&blurred.values) {
                *o += share * b;
            }
        }
        out
    }

    /// Convolved with a Gaussian; light that leaves the picture is lost.
    #[must_use]
    pub fn blurred(&self, sigma: f64) -> Self {
        if sigma.is_nan() || sigma <= 1e-6 {
            return self.clone();
        }
        if sigma > WIDE && self.width.min(self.height) >= 16 {
            // going there and back widen by 3/4 each, and a tile of the smaller picture is itself wider, by 4/12 in place of 1/12 (in tiles²)
            let rest = (sigma * sigma - 1.75).sqrt() * 0.5;
            return self.halved().blurred(rest).doubled(self.width, self.height);
        }
        let half = kernel(sigma);
        self.along(&half).turned().along(&half).turned()
    }

    /// On tiles twice as large, with one more beyond each edge. Each value goes to the nearest four as linear interpolation would take it from there, so that
    /// nothing moves: means of 2 × 2 would move a point by half a tile.
    fn halved(&self) -> Self {
        let [width, height] = [self.width, self.height].map(|n| n.div_ceil(2) + 2);
        let mut values = vec![0.0; width * height];
        for (i, v) in self.values.iter().enumerate() {
            let (x, u) = halfway(i % self.width);
            let (y, v1) = halfway(i / self.width);
            for (at, w) in [
                (y * width + x, (1.0 - u) * (1.0 - v1)),
                (y * width + x + 1, u * (1.0 - v1)),
                ((y + 1) * width + x, (1.0 - u) * v1),
                ((y + 1) * width + x + 1, u * v1),
            ] {
                values[at] += 0.25 * w * v;
            }
        }
        Self { width, height, values }
    }

    /// Back from [`Tiles::halved`].
    fn doubled(&self, width: usize, height: usize) -> Self {
        let values = (0..width * height)
            .map(|i| {
                let (x, u) = halfway(i % width);
                let (y, v) = halfway(i / width);
                let at = |x: usize, y: usize| self.values[y * self.width + x];
                (1.0 - v) * ((1.0 - u) * at(x, y) + u * at(x + 1, y))
                    + v * ((1.0 - u) * at(x, y + 1) + u * at(x + 1, y + 1))
            })
            .collect();
        Self { width, height, values }
    }

    fn along(&self, half: &[f64]) -> Self {
        let w = self.width;
        let mut values = vec![0.0; self.values.len()];
        for (to, from) in values.chunks_mut(w).zip(self.values.chunks(w)) {
            for (x, to) in to.iter_mut().enumerate() {
                let mut sum = half[0] * from[x];
                for (k, g) in half.iter().enumerate().skip(1) {
                    let left = x.checked_sub(k).map_or(0.0, |i| from[i]);
                    let right = from.get(x + k).copied().unwrap_or(0.0);
                    sum += g * (left + right);
                }
                *to = sum;
            }
        }
        Self { values, ..*self }
    }

    fn turned(&self) -> Self {
        let (width, height) = (self.height, self.width);
        let values = (0..width * height).map(|i| self.values[(i % width) * self.width + i / width]).collect();
        Self { width, height, values }
    }
}

/// Where the centre of a tile lies among tiles twice as large of which the first is beyond the edge: the one before, and the share of the next.
fn halfway(k: usize) -> (usize, f64) {
    let f = 0.5 * (k as f64 + 0.5) + 0.5;
    (f as usize, f.fract())
}

/// Half of a Gaussian averaged over tiles, both halves of which sum to one.
fn kernel(sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil().max(1.0) as usize;
    let points = gonio_optics::quadrature::gauss_legendre(4);
    let mut half: Vec<f64> = (0..=reach)
        .map(|k| points.iter().map(|(x, w)| w * (-0.5 * ((k as f64 + x - 0.5) / sigma).powi(2)).exp()).sum())
        .collect();
    let sum = 2.0 * half.iter().sum::<f64>() - half[0];
    half.iter_mut().for_each(|v| *v /= sum);
    half
}

/// Takes stray light off pictures.
#[derive(Clone, Debug)]
pub struct Stray {
    light: StrayLight,
    sigma_tiles: f64,
}

impl Stray {
    /// Of an instrument's calibration; `None` where it knows of none.
    #[must_use]
    pub fn of(map: &PixelMap) -> Option<Self> {
        let light = map.description().radiometry.as_ref()?.stray.clone()?;
        Some(Self::new(map, light))
    }

    /// Of given stray light.
    #[must_use]
    pub fn new(map: &PixelMap, light: StrayLight) -> Self {
        let sigma_tiles = light.tail_radius_mm.value / (2e-3 * map.description().camera.pitch_um);
        Self { light, sigma_tiles }
    }

    /// What it takes off.
    #[must_use]
    pub const fn light(&self) -> &StrayLight {
        &self.light
    }

    /// Takes glare, tails and haze off merged pixels (all of them, not only those that see the sample, should have been merged). Returns a standard
    /// uncertainty for each colour, electrons per second: what the stray light's own uncertainty leaves in a usual pixel.
    pub fn correct(&self, pixels: &mut [Merged], map: &PixelMap) -> [f64; 3] {
        let (g, e) = (self.light.glare.value, self.light.tail_share.value);
        let kept = (1.0 - g - e).max(0.1);
        let haze = |p: usize| self.light.haze.as_ref().map_or(0.0, |h| haze_at(h, map, p));
        let seen = tiles(map, |p| f64::from(pixels[p].rate) - haze(p));
        let mut sigma = [0.0; 3];
        let mut taken = Vec::with_capacity(3);
        for (channel, (seen, sigma)) in seen.iter().zip(&mut sigma).enumerate() {
            let mut x = seen.clone();
            let (mut mean, mut tails) = (x.mean(), x.tails(self.sigma_tiles));
            for _ in 0..ROUNDS {
                for ((x, y), t) in x.values.iter_mut().zip(&seen.values).zip(&tails.values) {
                    *x = (y - g * mean - e * t) / kept;
                }
                mean = x.mean();
                tails = x.tails(self.sigma_tiles);
            }
            let usual = tails.values.iter().sum::<f64>() / tails.values.len().max(1) as f64;
            let h = self.light.haze.as_ref().map_or(0.0, |h| h.sigma_e_s[channel]);
            *sigma =
                (self.light.glare.sigma * mean).hypot(self.light.tail_share.sigma * usual).hypot(h) / kept;
            taken.push((mean, tails));
        }
        let w = map.width();
        for (p, m) in pixels.iter_mut().enumerate().filter(|(_, m)| m.is_valid()) {
            let (mean, tails) = &taken[map.channel(p)];
            let tile = (p / w / 2).min(tails.height - 1) * tails.width + (p % w / 2).min(tails.width - 1);
            let astray = g * mean + e * tails.values[tile] + haze(p);
            m.rate = ((f64::from(m.rate) - astray) / kept) as f32;
            let widen = (1.0 / (kept * kept)) as f32;
            (m.shot, m.read, m.dark) = (m.shot * widen, m.read * widen, m.dark * widen);
        }
        sigma
    }
}

/// Haze at a pixel, electrons per second: the parabolas whose means over a coarse tile and its two neighbours are those tiles', one blended into the next between
/// their centres. Linear between centres it would miss a bend twice, where a tile's mean stands for its middle and on the way to the next.
#[must_use]
pub fn haze_at(haze: &Haze, map: &PixelMap, pixel: usize) -> f64 {
    let [across, down] = haze.tiles.map(|n| n as usize);
    let channel = map.channel(pixel);
    let place = |at: usize, of: usize, n: usize| taps((at as f64 + 0.5) / of as f64 * n as f64, n);
    let columns = place(pixel % map.width(), map.width(), across);
    let rows = place(pixel / map.width(), map.height(), down);
    let row = |y: usize| -> f64 {
        columns.iter().map(|(x, w)| w * f64::from(haze.rates_e_s[y * across + x][channel])).sum()
    };
    rows.iter().map(|(y, w)| w * row(*y)).sum()
}

/// Of which of `n` tiles in a line the value at a place is made, and with what weights; tile k reaches from k to k + 1. Beyond the ends it goes on straight.
fn taps(place: f64, n: usize) -> [(usize, f64); 4] {
    if n < 2 {
        return [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
    }
    let from = (place - 0.5).floor().clamp(0.0, (n - 2) as f64);
    let u = place - 0.5 - from;
    // the parabola of a tile, at t tiles from its middle: of the tile before, its own, of the one behind
    let parabola = |t: f64| {
        let bend = 0.5 * (t * t - 1.0 / 12.0);
        [bend - 0.5 * t, 1.0 - 2.0 * bend, bend + 0.5 * t]
    };
    let (a, b, blend) = (parabola(u), parabola(u - 1.0), u.clamp(0.0, 1.0));
    let mut w = [0.0; 4];
    for k in 0..3 {
        w[k] += (1.0 - blend) * a[k];
        w[k + 1] += blend * b[k];
    }
    let k = from as usize;
    let mut out = [(k.saturating_sub(1), w[0]), (k, w[1]), (k + 1, w[2]), ((k + 2).min(n - 1), w[3])];
    if k == 0 {
        // 2 m₀ − m₁ stands before the first, and likewise behind the last
        (out[0].1, out[1].1, out[2].1) = (0.0, w[1] + 2.0 * w[0], w[2] - w[0]);
    }
    if k + 2 >= n {
        let behind = out[3].1;
        (out[3].1, out[2].1, out[1].1) = (0.0, out[2].1 + 2.0 * behind, out[1].1 - behind);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_between_coarse_tiles_is_followed() {
        // the mean of a glow over each of 20 tiles, and the glow at 200 places
        let f = |x: f64| 0.5 + 0.2 * x + (-(x - 0.7).powi(2) / 0.045).exp();
        let mean = |k: usize| {
            (0..64).map(|i| f((k as f64 + (f64::from(i) + 0.5) / 64.0) / 20.0)).sum::<f64>() / 64.0
        };
        let means: Vec<f64> = (0..20).map(mean).collect();
        for i in 0..200 {
            let x = (f64::from(i) + 0.5) / 200.0;
            let found: f64 = taps(20.0 * x, 20).iter().map(|(k, w)| w * means[*k]).sum();
            // straight lines between means miss by 0.018; at the ends nobody knows the bend
            let bound = if (1.5..18.5).contains(&(20.0 * x)) { 1.5e-3 } else { 0.02 };
            assert!((found - f(x)).abs() < bound, "{x}: {found} {}", f(x));
        }
        // what is straight stays so to the very ends, also in few tiles
        for n in [1, 2, 3, 20] {
            for place in [0.0, 0.3, 0.5, 0.6 * n as f64, n as f64] {
                let all = taps(place, n);
                let (sum, at) =
                    all.iter().fold((0.0, 0.0), |s, (k, w)| (s.0 + w, s.1 + w * (*k as f64 + 0.5)));
                assert!((sum - 1.0).abs() < 1e-12, "{n} {place}: {sum}");
                assert!(n == 1 || (at - place).abs() < 1e-12, "{n} {place}: {at}");
            }
        }
    }

    #[test]
    fn a_wide_gaussian_on_a_smaller_picture_is_that_of_the_whole_one() {
        let (width, height) = (96, 80);
        assert_eq!([0, 1, 2].map(halfway), [(0, 0.75), (1, 0.25), (1, 0.75)]);
        let mut point = Tiles { width, height, values: vec![0.0; width * height] };
        point.values[37 * width + 45] = 1.0;
        for sigma in [0.7, 3.0, 6.0, 11.0] {
            let b = point.blurred(sigma);
            let (mut sum, mut second) = (0.0, 0.0);
            for (i, v) in b.values.iter().enumerate() {
                sum += v;
                second += v * ((i % width) as f64 - 45.0).powi(2);
            }
            assert!((sum - 1.0).abs() < 2e-3, "{sigma}: {sum}");
            // a tile is itself as wide as 1/12
            let wanted = sigma * sigma + 1.0 / 12.0;
            assert!((second / sum / wanted - 1.0).abs() < 2e-3, "{sigma}: {} {wanted}", second / sum);
            // tile by tile, wherever the point stands among larger tiles
            let peak = b.values[37 * width + 45];
            for (x, y) in [(46, 37), (41, 37), (45, 31), (52, 44), (36, 40), (58, 20)] {
                let square = (x as f64 - 45.0).powi(2) + (y as f64 - 37.0).powi(2);
                let expected = (-0.5 * square / wanted).exp();
                let got = b.values[y * width + x] / peak;
                assert!(
                    (got - expected).abs() < 0.01 * expected.max(0.1),
                    "{sigma} {x} {y}: {got} {expected}"
                );
            }
        }
    }
}
