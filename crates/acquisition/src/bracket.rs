//! Automatic bracketing: which exposures a pose needs, from what the frames so far show.
//!
//! [`Judge`] keeps for each pixel of interest its best exposed level so far and whether every frame saturated it; each frame becomes a
//! [`FrameSummary`]. [`Bracket`] reads only those: first shorter until nothing saturates, then longer until nothing that
//! can be helped is dim. Neither knows a device.
//!
//! The longest exposure takes most of a pose's time, so it is aimed at: as soon as the darkest pixels stand out of the noise it is known how long they
//! need, and the exposures are laid so that the last one is just that (or the longest the camera can), each [`STEP`] times the one before except the first step,
//! which takes what is left over.
//! The longest exposure so follows the light from tilt to tilt without jumps, which is also why the time left can be told.

use std::time::Duration;

use gonio_instrument::Frame;
use gonio_instrument::description::CameraGeometry;

/// A level at and above which a pixel is well exposed, as a share of the range above black.
pub const TARGET: f64 = 0.2;
/// A level that the darkest pixels are aimed at: above [`TARGET`] with room for noise and a lamp that drifts.
const AIM: f64 = 0.3;
/// Levels up to [`AIM`] that are told apart.
const LEVELS: usize = 384;
/// Level from which the darkest pixels tell how long they need: an error of a few codes is a few per cent there.
const TELLING: f64 = 0.01;
/// Share of the pixels that may stay dim: dust and hot pixels are no reason for another exposure. None may stay saturated
/// while there is a shorter one: the gloss of a coat is a dozen pixels of a million, and hot pixels do not saturate in short exposures.
pub const NEGLIGIBLE: f64 = 2e-4;
/// Step to shorter exposures while pixels saturate.
const DOWN: f64 = 8.0;
/// Largest step to longer ones: what saturates at one exposure is well exposed at the one before.
const UP: f64 = 0.9 / TARGET;
/// Usual step to longer ones once the end is known: room for [`UP`] to take up what the first estimate of the end was off.
const STEP: f64 = UP / 1.1;

/// What a frame shows of the pixels that are not yet well exposed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameSummary {
    /// Exposure really taken, s.
    pub exposure_s: f64,
    /// Share of the pixels of interest that every frame so far saturates.
    pub saturated_share: f64,
    /// Share whose best level so far is below [`TARGET`] and that no frame saturates.
    pub dim_share: f64,
    /// Level that all pixels but a negligible share have reached at best, at most what they are aimed at (0.3).
    pub dark_level: f64,
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
        let [target, aim] = [TARGET, AIM].map(|level| (self.black + level * self.range) as u16);
        let (mut saturated, mut dim) = (0usize, 0usize);
        let mut histogram = [0usize; LEVELS];
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
            } else if best < aim && !self.clipped[k] {
                dim += usize::from(best < target);
                let level = (f64::from(best) - self.black).max(0.0) / (AIM * self.range);
                histogram[((level * LEVELS as f64) as usize).min(LEVELS - 1)] += 1;
            }
        }
        let mut below = 0;
        let mut dark_level = AIM;
        for (k, n) in histogram.iter().enumerate() {
            below += n;
            if below as f64 > NEGLIGIBLE * self.pixels.len() as f64 {
                dark_level = k as f64 / LEVELS as f64 * AIM;
                break;
            }
        }
        let n = self.pixels.len().max(1) as f64;
        FrameSummary {
            exposure_s,
            saturated_share: saturated as f64 / n,
            dim_share: dim as f64 / n,
            dark_level,
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
    /// Exposures laid down beforehand; empty where the frames decide.
    series: Vec<Duration>,
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
            series: Vec::new(),
        }
    }

    /// These exposures, whatever the frames show.
    #[must_use]
    pub fn series(exposures: &[Duration]) -> Self {
        let first = exposures.first().copied().unwrap_or(Duration::from_millis(1));
        let guess_s = first.as_secs_f64();
        Self { limits_s: [guess_s; 2], most: 1, taken: Vec::new(), guess_s, series: exposures.to_vec() }
    }

    /// The next exposure, or `None` when the pose is well exposed or nothing more can be done.
    #[must_use]
    pub fn proposal(&self) -> Option<Duration> {
        if !self.series.is_empty() {
            return self.series.get(self.taken.len()).copied();
        }
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
            return Some(duration(next_longer(longest, last.dark_level, self.limits_s[1])));
        }
        None
    }

    /// Takes the summary of the frame just taken.
    pub fn add(&mut self, summary: FrameSummary) {
        self.taken.push(summary);
    }

    /// How long the darkest pixels need, s: the longest exposure, or more where the camera could not expose so long; `None` before a frame.
    #[must_use]
    pub fn needed_s(&self) -> Option<f64> {
        let last = self.taken.last()?;
        let longest = self.taken.iter().map(|s| s.exposure_s).fold(0.0, f64::max);
        let short = longest > 0.99 * self.limits_s[1] && last.dark_level >= TELLING;
        Some(if short { longest * AIM / last.dark_level } else { longest })
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

/// The next exposure after `longest`, s, which shows the darkest pixels at `dark_level`: all steps but the first are [`STEP`], so that the last exposure is
/// what these pixels need, or the camera's limit. While nothing is seen of them the steps are as large as can be.
fn next_longer(longest: f64, dark_level: f64, limit: f64) -> f64 {
    // whole microseconds leave their rounding
    let reach = 1.001 * UP * longest;
    if dark_level < TELLING && limit > reach {
        return (UP * longest).min(limit / UP);
    }
    let needed = if dark_level < TELLING { limit } else { longest * AIM / dark_level };
    let mut next = needed.min(limit);
    while next > reach {
        next /= STEP;
    }
    next
}

/// Whole microseconds: what cameras take and files keep.
fn duration(s: f64) -> Duration {
    Duration::from_micros((s * 1e6).round().max(1.0) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exposures for a scene whose darkest pixels reach the level `rate` times the exposure, told with an error.
    fn exposures(rate: f64, limit: f64, error: f64) -> Vec<f64> {
        let mut bracket = Bracket::new([2e-5, limit], 20, Duration::from_millis(1));
        let mut out = Vec::new();
        while let Some(next) = bracket.proposal() {
            let exposure_s = next.as_secs_f64();
            assert!(out.last().is_none_or(|last| exposure_s <= 1.002 * UP * last), "{out:?} {exposure_s}");
            out.push(exposure_s);
            let level = rate * exposure_s;
            let dark_level = if level < 0.05 { level * error } else { level }.min(AIM);
            let dim_share = if level < TARGET { 0.1 } else { 0.0 };
            bracket.add(FrameSummary { exposure_s, saturated_share: 0.0, dim_share, dark_level });
        }
        out
    }

    #[test]
    fn the_last_exposure_is_what_the_darkest_pixels_need_and_none_is_wasted() {
        for rate in [0.11, 0.3, 0.7, 1.3, 2.9, 7.0, 33.0] {
            for error in [0.97, 1.0, 1.03] {
                let all = exposures(rate, 10.0, error);
                let last = all[all.len() - 1] * rate;
                // where the end came in one step from a level told wrongly, the error stays
                assert!((last / AIM - 1.0).abs() < 0.035, "{rate} {error}: {all:?}");
                let fewest = (AIM / rate / 1e-3).ln() / UP.ln();
                assert!((all.len() as f64) < fewest + 3.0, "{rate} {error}: {all:?}");
            }
        }
    }

    #[test]
    fn what_needs_more_than_the_camera_can_ends_at_its_limit_once() {
        for rate in [0.01, 0.05, 0.1] {
            let all = exposures(rate, 2.0, 1.0);
            assert_eq!(all[all.len() - 1], 2.0, "{all:?}");
            assert!(all[all.len() - 2] < 2.0 / 3.0, "{all:?}");
        }
    }
}
