//! From electron rates to raw counts: photon and dark shot noise, read noise, hot pixels, saturation, quantisation.
//!
//! ```text
//! electrons ~ Poisson(t · (rate · lamp + dark(p, T)))
//! count     = clamp(black level + round((electrons + read noise) / electrons per count), 0, top code)
//! ```
//!
//! A sensor with [`Imperfections`] reads a signal u, a share of the range, as `u (1 − a u)`, its pixels differ in sensitivity, some are dead.
//!
//! The converter's range ends at the full well, so a full pixel reads the top code. Dark current of a pixel is log-normal about
//! [`DARK_E_PER_S`] at [`DARK_REFERENCE_C`] and doubles every [`DARK_DOUBLING_K`]; a few hot pixels have thousands of times as much.
//!
//! Noise is a function of a key alone: each block of rows draws from its own ChaCha8 stream, so neither the number of threads nor what
//! was exposed before matters.

use gonio_instrument::{Description, Imperfections};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// Median dark current at the reference temperature, electrons per second.
pub const DARK_E_PER_S: f64 = 3.0;
/// Temperature of that, °C.
pub const DARK_REFERENCE_C: f64 = 35.0;
/// Temperature step that doubles the dark current, K.
pub const DARK_DOUBLING_K: f64 = 7.0;
/// Standard deviation of the logarithm of the dark current over pixels.
pub const DARK_SPREAD: f64 = 0.2;
/// Share of hot pixels.
pub const HOT_SHARE: f64 = 1.5e-5;
/// Means up to which Poisson numbers are drawn exactly.
const EXACT_MEAN: f32 = 30.0;
/// Rows that share a stream of random numbers.
const BLOCK_ROWS: usize = 16;

/// The sensor and its fixed pattern.
#[derive(Clone, Debug)]
pub struct Sensor {
    width: u32,
    height: u32,
    seed: u64,
    electrons_per_count: f64,
    read_noise_e: f64,
    black_level: f64,
    top_code: u32,
    /// a of the compression, for signals in counts: a over the range.
    compression_per_count: f64,
    /// Sensitivity of each pixel; empty where all are alike.
    response: Vec<f32>,
    doubling_k: f64,
    /// Dark current at the reference temperature, e/s.
    dark: Vec<f32>,
    hot: Vec<usize>,
}

/// What a frame's noise is a function of, besides the sensor's seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct NoiseKey {
    /// The sample (see [`super::sample::Sample::noise_key`]).
    pub sample: u64,
    /// The pose read back, µdeg.
    pub pose: (i64, i64),
    /// The exposure, ns.
    pub exposure_ns: u64,
    /// Whether the shutter was open.
    pub shutter_open: bool,
    /// How many such frames were taken before.
    pub repeat: u64,
}

/// What acts on the sensor during an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Exposure, s.
    pub exposure_s: f64,
    /// Factor on the rates: lamp output, 0 behind the shutter.
    pub lamp: f64,
    /// Sensor temperature, °C.
    pub temperature_c: f64,
}

impl Sensor {
    /// The sensor of an instrument; `seed` fixes its fixed pattern and, with a key, all noise.
    #[must_use]
    pub fn new(d: &Description, seed: u64) -> Self {
        let c = &d.camera;
        let pixels = c.pixels();
        let mut rng = stream(&[seed, 0x5e75_0f00], 0);
        let mut dark: Vec<f32> = (0..pixels)
            .map(|_| {
                let z: f64 = StandardNormal.sample(&mut rng);
                (DARK_E_PER_S * (DARK_SPREAD * z).exp()) as f32
            })
            .collect();
        let count = ((pixels as f64 * HOT_SHARE).round() as usize).max(2);
        let mut hot = Vec::with_capacity(count);
        for _ in 0..count {
            let at = rng.random_range(0..pixels);
            // 300 to 30,000 e/s, evenly in the logarithm
            if let Some(slot) = dark.get_mut(at) {
                *slot = (300.0 * 100f64.powf(rng.random::<f64>())) as f32;
                hot.push(at);
            }
        }
        hot.sort_unstable();
        hot.dedup();
        Self {
            width: c.size[0],
            height: c.size[1],
            seed,
            electrons_per_count: c.electrons_per_count(),
            read_noise_e: c.read_noise_e,
            black_level: f64::from(c.black_level),
            top_code: c.top_code(),
            compression_per_count: 0.0,
            response: Vec::new(),
            doubling_k: DARK_DOUBLING_K,
            dark,
            hot,
        }
    }

    /// The sensor with departures from the description. Its fixed pattern of dark current and its noise stay those of the seed.
    #[must_use]
    pub fn with_imperfections(mut self, i: &Imperfections) -> Self {
        let range = f64::from(self.top_code) - self.black_level;
        self.electrons_per_count *= 1.0 + i.gain_error;
        self.read_noise_e *= 1.0 + i.read_noise_error;
        self.black_level += i.black_level_error;
        self.compression_per_count = i.compression / range;
        if i.dark_doubling_k > 0.0 {
            self.doubling_k = i.dark_doubling_k;
        }
        for d in &mut self.dark {
            *d *= 1.0 + i.dark_current_error as f32;
        }
        let mut rng = stream(&[self.seed, 0x5e75_0f01], 0);
        if i.pixel_response > 0.0 || i.dead_pixels > 0 {
            let z = |rng: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(rng) };
            self.response =
                self.dark.iter().map(|_| (1.0 + i.pixel_response * z(&mut rng)).max(0.1) as f32).collect();
        }
        for _ in 0..i.dead_pixels {
            let at = rng.random_range(0..self.response.len());
            self.response[at] = 0.02;
        }
        self
    }

    /// Electrons per raw count of a small signal.
    #[must_use]
    pub fn electrons_per_count(&self) -> f64 {
        self.electrons_per_count
    }

    /// Read noise, electrons.
    #[must_use]
    pub fn read_noise_e(&self) -> f64 {
        self.read_noise_e
    }

    /// Sensitivity of each pixel; empty where all are alike.
    #[must_use]
    pub fn response(&self) -> &[f32] {
        &self.response
    }

    /// Factor on the dark current at a temperature, for this sensor.
    #[must_use]
    pub fn dark_factor_at(&self, temperature_c: f64) -> f64 {
        ((temperature_c - DARK_REFERENCE_C) / self.doubling_k).exp2()
    }

    /// Indices of the hot pixels.
    #[must_use]
    pub fn hot_pixels(&self) -> &[usize] {
        &self.hot
    }

    /// Dark current of each pixel at a temperature: its factor on [`Sensor::dark_reference`].
    #[must_use]
    pub fn dark_factor(temperature_c: f64) -> f64 {
        ((temperature_c - DARK_REFERENCE_C) / DARK_DOUBLING_K).exp2()
    }

    /// Dark current of each pixel at the reference temperature, e/s.
    #[must_use]
    pub fn dark_reference(&self) -> &[f32] {
        &self.dark
    }

    /// Raw counts without noise, neither rounded nor clipped: black level plus signal and dark current. Pixels without a rate see no light.
    #[must_use]
    pub fn noise_free(&self, rates: &[f32], conditions: Conditions) -> Vec<f64> {
        let gain = 1.0 / self.electrons_per_count;
        let t_light = conditions.exposure_s * conditions.lamp;
        let t_dark = conditions.exposure_s * self.dark_factor_at(conditions.temperature_c);
        self.dark
            .iter()
            .enumerate()
            .map(|(i, &dark)| {
                let light = f64::from(rates.get(i).copied().unwrap_or(0.0));
                let response = f64::from(self.response.get(i).copied().unwrap_or(1.0));
                let counts = (light * response * t_light + f64::from(dark) * t_dark) * gain;
                self.black_level + counts * (1.0 - self.compression_per_count * counts)
            })
            .collect()
    }

    /// Raw counts, row by row. Pixels without a rate (a short `rates`) see no light.
    #[must_use]
    pub fn expose(&self, rates: &[f32], conditions: Conditions, key: NoiseKey) -> Vec<u16> {
        let width = self.width as usize;
        let mut out = vec![0u16; width * self.height as usize];
        let gain = 1.0 / self.electrons_per_count as f32;
        // whole counts apart from the rest: rounding is about the level of the black
        let (black, part) = (self.black_level.floor() as f32, self.black_level.fract() as f32);
        let top = self.top_code as f32;
        let bend = self.compression_per_count as f32;
        let read = self.read_noise_e as f32;
        let t_light = (conditions.exposure_s * conditions.lamp) as f32;
        let t_dark = (conditions.exposure_s * self.dark_factor_at(conditions.temperature_c)) as f32;
        let words = [
            self.seed,
            key.sample,
            key.pose.0 as u64,
            key.pose.1 as u64,
            key.exposure_ns,
            u64::from(key.shutter_open),
            key.repeat,
        ];
        out.par_chunks_mut(width * BLOCK_ROWS).enumerate().for_each(|(block, counts)| {
            let mut rng = stream(&words, 1 + block as u64);
            let from = block * BLOCK_ROWS * width;
            for (i, count) in counts.iter_mut().enumerate() {
                let light = rates.get(from + i).copied().unwrap_or(0.0);
                let dark = self.dark.get(from + i).copied().unwrap_or(0.0);
                let response = self.response.get(from + i).copied().unwrap_or(1.0);
                let electrons = poisson(light * response * t_light + dark * t_dark, &mut rng);
                let z: f32 = StandardNormal.sample(&mut rng);
                let counts = (electrons + read * z) * gain;
                // past the peak of the bend nothing is read lower again
                let bent = counts * (1.0 - (bend * counts).min(0.5));
                let value = (black + (part + bent).round()).clamp(0.0, top);
                *count = value as u16;
            }
        });
        out
    }
}

/// A stream of random numbers that is a function of the words and the block alone.
pub(crate) fn stream(words: &[u64], block: u64) -> ChaCha8Rng {
    // splitmix64 of a running state: four words of key from any number of words
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut mix = |w: u64| {
        state = (state ^ w).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        state = z ^ (z >> 31);
        state
    };
    for &w in words {
        mix(w);
    }
    let mut seed = [0u8; 32];
    for chunk in seed.chunks_mut(8) {
        chunk.copy_from_slice(&mix(0).to_le_bytes());
    }
    let mut rng = ChaCha8Rng::from_seed(seed);
    rng.set_stream(block);
    rng
}

/// A Poisson number: by inversion for small means, by the normal distribution with the skewness put right (Cornish–Fisher) for large ones.
fn poisson(mean: f32, rng: &mut impl Rng) -> f32 {
    if mean <= 0.0 {
        return 0.0;
    }
    if mean > EXACT_MEAN {
        let z: f32 = StandardNormal.sample(rng);
        return (mean + mean.sqrt() * z + (z * z - 1.0) * (1.0 / 6.0)).round().max(0.0);
    }
    let mean = f64::from(mean);
    let mut u: f64 = rng.random();
    let mut p = (-mean).exp();
    let mut n = 0.0f64;
    while u > p && n < 200.0 {
        u -= p;
        n += 1.0;
        p *= mean / n;
    }
    n as f32
}
