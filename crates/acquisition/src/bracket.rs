//! Automatic bracketing: which exposures a pose needs, from what the frames so far show.
//!
//! [`Judge`] keeps for each pixel of interest its best exposed level so far and whether every frame saturated it; each frame becomes a
//! [`FrameSummary`]. [`Bracket`] reads only those: first shorter until nothing saturates, then longer until nothing that
//! can be helped is dim. Neither knows a device.

use std::time::Duration;

use gonio_instrument::Frame;
use gonio_instrument::description::CameraGeometry;

/// A level at and above which a pixel is well exposed, as a share of the range above black.
pub const TARGET: f64 = 0.2;
/// A level that a longer exposure aims at: below saturation with room for noise.
const AIM: f64 = 0.75;
/// Share of the pixels that may stay dim: dust and hot pixels are no reason for another exposure. None may stay saturated
/// while there is a shorter one: the gloss of a coat is a dozen pixels of a million, and hot pixels do not saturate in short exposures.
const NEGLIGIBLE: f64 = 2e-4;
/// Step to shorter exposures while pixels saturate.
const DOWN: f64 = 8.0;
/// Largest step to longer ones: what saturates at one exposure is well exposed at the one before.
const UP: f64 = 0.9 / TARGET;

/// What a frame shows of the pixels that are not yet well exposed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameSummary {
    /// Exposure really taken, s.
    pub exposure_s: f64,
    /// Share of the pixels of interest that every frame so far saturates.
    pub saturated_share: f64,
    /// Share whose best level so far is below [`TARGET`] and that no frame saturates.
    pub dim_share: f64,
    /// Level that all but the brightest hundredth of the dim ones stay below, at the longest exposure so far.
    pub dim_level: f64,
}

/// Memory of a pose's frames, pixel by pixel.
#[derive(Clone, Debug)]
pub struct Judge {
    pixels: Vec<u32>,
    best: Vec<u16>,
    clipped: Vec<bool>,
    black: f64,
    range: f64,
    saturated: u16,
    longest_s: f64,
}

impl Judge {
    /// Nothing seen yet of the pixels marked in `interest`.
    #[must_use]
    pub fn new(camera: &CameraGeometry, interest: &[bool]) -> Self {
        let pixels: Vec<u32> = (0..interest.len()).filter(|&i| interest[i]).map(|i| i as u32).collect();
        let (black, top) = (f64::from(camera.black_level), f64::from(camera.top_code()));
        Self {
            best: vec![0; pixels.len()],
            clipped: vec![false; pixels.len()],
            pixels,
            black,
            range: top - black,
            saturated: (black + 0.9 * (top - black)) as u16,
            longest_s: 0.0,
        }
    }

    /// Takes a frame into account.
    pub fn judge(&mut self, frame: &Frame) -> FrameSummary {
        let exposure_s = frame.exposure.as_secs_f64();
        self.longest_s = self.longest_s.max(exposure_s);
        let target = (self.black + TARGET * self.range) as u16;
        let (mut saturated, mut dim) = (0usize, 0usize);
        let mut histogram = [0usize; 256];
        for (k, &p) in self.pixels.iter().enumerate() {
            let Some(&raw) = frame.pixels.get(p as usize) else { continue };
            if raw >= self.saturated {
                self.clipped[k] = true;
            } else if raw > self.best[k] {
                self.best[k] = raw;
            }
            let best = self.best[k];
            if best == 0 {
                saturated += usize::from(self.clipped[k]);
            } else if best < target && !self.clipped[k] {
                dim += 1;
                let level = (f64::from(best) - self.black).max(0.0) / (TARGET * self.range);
                histogram[((level * 256.0) as usize).min(255)] += 1;
            }
        }
        let mut above = 0;
        let mut dim_level = 0.0;
        for (k, n) in histogram.iter().enumerate().rev() {
            above += n;
            if above > dim / 100 {
                dim_level = (k + 1) as f64 / 256.0 * TARGET;
                break;
            }
        }
        let n = self.pixels.len().max(1) as f64;
        FrameSummary {
            exposure_s,
            saturated_share: saturated as f64 / n,
            dim_share: dim as f64 / n,
            dim_level,
        }
    }
}

/// Chooses the exposures of one pose.
#[derive(Clone, Debug)]
pub struct Bracket {
    limits_s: [f64; 2],
    most: u32,
    taken: Vec<FrameSummary>,
    guess_s: f64,
}

impl Bracket {
    /// A bracket that begins at `guess`, within the camera's limits, of at most `most` exposures.
    #[must_use]
    pub fn new(limits_s: [f64; 2], most: u32, guess: Duration) -> Self {
        Self {
            limits_s,
            most: most.max(1),
            taken: Vec::new(),
            guess_s: guess.as_secs_f64().clamp(limits_s[0], limits_s[1]),
        }
    }

    /// The next exposure, or `None` when the pose is well exposed or nothing more can be done.
    #[must_use]
    pub fn proposal(&self) -> Option<Duration> {
        let Some(last) = self.taken.last() else { return Some(duration(self.guess_s)) };
        if self.taken.len() >= self.most as usize {
            return None;
        }
        let shortest = self.taken.iter().map(|s| s.exposure_s).fold(f64::INFINITY, f64::min);
        let longest = self.taken.iter().map(|s| s.exposure_s).fold(0.0, f64::max);
        // the camera may round: within a percent of its limit it is there
        if last.saturated_share > 0.0 && shortest > self.limits_s[0] * 1.01 {
            // the last exposure of all is kept for what is dim, if there is any
            return Some(duration((shortest / DOWN).max(self.limits_s[0])));
        }
        if last.dim_share > NEGLIGIBLE && longest < self.limits_s[1] * 0.99 {
            let step = if last.dim_level > 0.0 { (AIM / last.dim_level).clamp(2.0, UP) } else { UP };
            return Some(duration((longest * step).min(self.limits_s[1])));
        }
        None
    }

    /// Takes the summary of the frame just taken.
    pub fn add(&mut self, summary: FrameSummary) {
        self.taken.push(summary);
    }

    /// Exposures taken.
    #[must_use]
    pub fn taken(&self) -> u32 {
        self.taken.len() as u32
    }

    /// The exposure from which the next pose may begin: the shortest that was of use here.
    #[must_use]
    pub fn hint(&self) -> Duration {
        duration(self.taken.iter().map(|s| s.exposure_s).fold(f64::INFINITY, f64::min).min(self.limits_s[1]))
    }
}

/// Whole microseconds: what cameras take and files keep.
fn duration(s: f64) -> Duration {
    Duration::from_micros((s * 1e6).round().max(1.0) as u64)
}
