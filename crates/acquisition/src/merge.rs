//! One rate per pixel out of all exposures of a pose, with its variance in parts.
//!
//! Per frame j with exposure t_j and lamp monitor m_j: signal `s_j = electrons − dark(t_j)`, `x_j = t_j m_j`. The rate is
//! `Σ w_j s_j / Σ w_j x_j` with `w_j = x_j / (λ x_j + d t_j + σ²)`, the inverse *expected* variance of s_j/x_j per unit of x_j.
//! Where shot noise rules that is the Poisson maximum likelihood `Σ s / Σ x`, which has no bias; weights from each frame's
//! own noisy counts would favour those that came out low. λ is a first estimate with w_j = x_j/(x_j + …) from the sums.
//!
//! Whether a pixel is saturated in a frame is decided from its eight neighbours of the same colour, not from its own
//! value: dropping the frames in which its own noise was high would pull the rest down.

use gonio_instrument::{Exposure, PoseRecord};
use rayon::prelude::*;

use crate::dark::DarkModel;
use crate::error::AcquisitionError;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

/// A merged pixel; `rate` is NaN where nothing is known, infinite where every exposure is saturated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merged {
    /// Electrons per second at the nominal lamp.
    pub rate: f32,
    /// Variance of the rate from the statistics of light.
    pub shot: f32,
    /// From reading and rounding.
    pub read: f32,
    /// From the dark signal's own uncertainty.
    pub dark: f32,
    /// Effective exposure, seconds at the nominal lamp: what a Poisson-ML average over poses weights with.
    pub exposure: f32,
}

impl Merged {
    /// No value.
    pub const INVALID: Self = Self { rate: f32::NAN, shot: 0.0, read: 0.0, dark: 0.0, exposure: 0.0 };

    /// Brighter than the shortest exposure can show.
    pub const SATURATED: Self = Self { rate: f32::INFINITY, ..Self::INVALID };

    /// Whether there is a value.
    #[must_use]
    pub const fn is_valid(&self) -> bool {
        self.rate.is_finite()
    }
}

/// A merged pose.
#[derive(Clone, Debug)]
pub struct MergedPose {
    /// Row by row.
    pub pixels: Vec<Merged>,
    /// Exposures used (shutter open).
    pub exposures: u32,
    /// Share of the pixels asked for that no exposure shows unsaturated.
    pub saturated_share: f64,
    /// Relative standard uncertainty of the lamp's mean, from the spread of its monitor over the pose.
    pub lamp_relative: f64,
}

/// Checks a frame's size against the camera.
pub(crate) fn check_frames(record: &PoseRecord, map: &PixelMap) -> Result<(), AcquisitionError> {
    let (width, height) = (map.width() as u32, map.height() as u32);
    for e in &record.exposures {
        let f = &e.frame;
        if (f.width, f.height) != (width, height) {
            return Err(AcquisitionError::FrameSize {
                pose: record.index,
                instrument: map.description().name.clone(),
                found_width: f.width,
                found_height: f.height,
                width,
                height,
            });
        }
        let expected = map.width() * map.height();
        if f.pixels.len() != expected {
            return Err(AcquisitionError::FrameLength {
                pose: record.index,
                found: f.pixels.len(),
                expected,
            });
        }
    }
    Ok(())
}

/// Merges the exposures of a pose for the pixels in `wanted`; isolated hot pixels are taken from their neighbours of the
/// same colour. A saturated pixel is not: where a gloss is a few pixels wide its neighbours know nothing of it.
///
/// # Errors
/// [`AcquisitionError`] for frames of the wrong size and for a pose without light.
pub fn merge(
    record: &PoseRecord,
    map: &PixelMap,
    sensor: &Sensor,
    dark: &DarkModel,
    wanted: &[bool],
) -> Result<MergedPose, AcquisitionError> {
    check_frames(record, map)?;
    // with each the factor on the dark current at its temperature
    let mut frames: Vec<(&Exposure, f64)> = record
        .exposures
        .iter()
        .filter(|e| e.shutter_open && e.lamp_monitor > 0.0 && e.frame.exposure.as_nanos() > 0)
        .map(|e| (e, dark.at_temperature(e.frame.sensor_temperature_c)))
        .collect();
    if frames.is_empty() {
        return Err(AcquisitionError::NoLight { pose: record.index });
    }
    // the order of taking must not matter for rounding either
    frames.sort_by_key(|(e, _)| (e.frame.exposure, e.frame.sequence));
    let w = map.width();
    let mut pixels = vec![Merged::INVALID; w * map.height()];
    pixels.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
        for (x, out) in row.iter_mut().enumerate() {
            let p = y * w + x;
            if wanted[p] && !dark.is_hot(p) {
                *out = pixel(&frames, p, map, sensor, dark);
            }
        }
    });
    let lit = wanted.iter().filter(|v| **v).count().max(1);
    let lost = (0..pixels.len()).filter(|&p| wanted[p] && !dark.is_hot(p) && !pixels[p].is_valid()).count();
    let hot: Vec<usize> = (0..pixels.len()).filter(|&p| wanted[p] && dark.is_hot(p)).collect();
    mend(&mut pixels, hot, w, map.height());
    Ok(MergedPose {
        pixels,
        exposures: frames.len() as u32,
        saturated_share: lost as f64 / lit as f64,
        lamp_relative: monitor_spread(&frames),
    })
}

fn pixel(frames: &[(&Exposure, f64)], p: usize, map: &PixelMap, sensor: &Sensor, dark: &DarkModel) -> Merged {
    let (mean, current) = dark.at(p);
    let read = sensor.read_variance_e2;
    let usable = |e: &Exposure| {
        let raw = e.frame.pixels[p];
        raw < sensor.clipped
            && (f32::from(raw) < 0.8 * sensor.saturated
                || neighbourhood(&e.frame.pixels, p, map.width(), map.height()) < sensor.saturated)
    };
    // signal and effective exposure of frame j
    let each = || {
        frames.iter().filter(|(e, _)| usable(e)).map(|(e, factor)| {
            let t = e.frame.exposure.as_secs_f64();
            let dark_signal = mean + current * (t * factor - dark.mean_t_s);
            let s = sensor.electrons(e.frame.pixels[p]) - dark_signal;
            (s, t, t * e.lamp_monitor)
        })
    };
    let (mut signal, mut exposure) = (0.0, 0.0);
    for (s, _, x) in each() {
        signal += s;
        exposure += x;
    }
    if exposure <= 0.0 {
        return Merged::SATURATED;
    }
    let guess = (signal / exposure).max(0.0);
    let dark_e = |t: f64| (current * t).max(0.0);
    let (mut num, mut den) = (0.0, 0.0);
    for (s, t, x) in each() {
        let w = x / (guess * x + dark_e(t) + read);
        num += w * s;
        den += w * x;
    }
    let rate = num / den;
    let lambda = rate.max(0.0);
    let (mut shot, mut reading, mut sum_w, mut sum_wt) = (0.0, 0.0, 0.0, 0.0);
    for (_, t, x) in each() {
        let w = x / (guess * x + dark_e(t) + read) / den;
        shot += w * w * (lambda * x + dark_e(t));
        reading += w * w * read;
        sum_w += w;
        sum_wt += w * (t - dark.mean_t_s);
    }
    Merged {
        rate: rate as f32,
        shot: shot as f32,
        read: reading as f32,
        dark: (sum_w * sum_w * dark.mean_variance + sum_wt * sum_wt * dark.current_variance) as f32,
        exposure: exposure as f32,
    }
}

/// Mean raw value of the eight neighbours of the same colour lattice (those there are).
fn neighbourhood(raw: &[u16], p: usize, w: usize, h: usize) -> f32 {
    let (x, y) = (p % w, p / w);
    let (mut sum, mut n) = (0u32, 0u32);
    for v in [y.wrapping_sub(2), y, y + 2] {
        for u in [x.wrapping_sub(2), x, x + 2] {
            if u < w && v < h && (u, v) != (x, y) {
                sum += u32::from(raw[v * w + u]);
                n += 1;
            }
        }
    }
    sum as f32 / n.max(1) as f32
}

/// Gives isolated hot pixels the value of their neighbours: along the row or the column, whichever runs smoother,
/// by the cubic through four, else the mean of two.
fn mend(pixels: &mut [Merged], holes: Vec<usize>, w: usize, h: usize) {
    let mut mended = Vec::new();
    for p in holes {
        let (x, y) = (p % w, p / w);
        let line = |step: usize, at: usize, n: usize| -> Option<(f64, Merged)> {
            if at < 2 || at + 2 >= n {
                return None;
            }
            let (a, b) = (pixels[p - 2 * step], pixels[p + 2 * step]);
            if !a.is_valid() || !b.is_valid() {
                return None;
            }
            let mut m = a;
            let half = |f: fn(&Merged) -> f32| 0.5 * (f(&a) + f(&b));
            m.rate = half(|m| m.rate);
            (m.shot, m.read, m.dark) = (half(|m| m.shot), half(|m| m.read), half(|m| m.dark));
            m.exposure = half(|m| m.exposure);
            if at >= 4 && at + 4 < n {
                let (c, d) = (pixels[p - 4 * step], pixels[p + 4 * step]);
                if c.is_valid() && d.is_valid() {
                    m.rate += (2.0 * m.rate - c.rate - d.rate) / 6.0;
                }
            }
            Some((f64::from((a.rate - b.rate).abs()), m))
        };
        let best = match (line(1, x, w), line(w, y, h)) {
            (Some(a), Some(b)) => Some(if b.0 < a.0 { b.1 } else { a.1 }),
            (a, b) => a.or(b).map(|v| v.1),
        };
        if let Some(m) = best {
            mended.push((p, m));
        }
    }
    for (p, m) in mended {
        pixels[p] = m;
    }
}

/// Standard uncertainty of the mean of the monitor readings, relative, as far as they scatter about a steady drift.
fn monitor_spread(frames: &[(&Exposure, f64)]) -> f64 {
    let mut by_time: Vec<(f64, f64)> =
        frames.iter().map(|(e, _)| (e.frame.sequence as f64, e.lamp_monitor)).collect();
    by_time.sort_by(|a, b| a.0.total_cmp(&b.0));
    let readings: Vec<f64> = by_time.iter().map(|v| v.1).collect();
    crate::lamp::scatter(&readings) / (readings.len() as f64).sqrt()
}
