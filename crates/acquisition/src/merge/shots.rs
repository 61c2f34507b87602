//! The exposures of a pose as the merge needs them, and which of their pixels serve.

use gonio_instrument::{Exposure, PoseRecord};

use super::lanes::take;
use super::plan::{Floor, Plans};
use super::wide::{WIDE, Wide};
use crate::dark::DarkModel;
use crate::error::AcquisitionError;
use crate::sensor::Sensor;

/// Share of the level of saturation below which a pixel is clear of it whatever its neighbours say.
const CLEAR: f32 = 0.8;

/// One exposure with the shutter open.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shot<'a> {
    pub(crate) raw: &'a [u16],
    /// Exposure times lamp monitor, s.
    pub(crate) x: f32,
    /// Exposure in seconds of dark current at the temperature of the dark frames.
    pub(crate) dark_s: f32,
    /// The same less the mean exposure of the dark frames.
    pub(crate) since_mean_s: f32,
    /// Variance of what is there without light (usual dark current, reading) over x: a rate of as much noise.
    pub(crate) noise_rate: f32,
    /// The rate that a mean level tells: slope and offset.
    rate_of_level: [f32; 2],
}

impl Shot<'_> {
    /// The rate that a mean level tells, not below 0.
    #[inline(always)]
    pub(crate) fn expected(&self, level: f32) -> f32 {
        let [slope, offset] = self.rate_of_level;
        let rate = slope * level + offset;
        if rate > 0.0 { rate } else { 0.0 }
    }
}

/// From raw values to electrons.
#[derive(Clone, Debug)]
pub(crate) enum Ramp {
    /// slope · raw + offset.
    Straight {
        /// Electrons per count.
        slope: f32,
        /// Electrons at count 0.
        offset: f32,
    },
    /// Electrons by raw value.
    Table(Vec<f32>),
}

impl Ramp {
    fn of(sensor: &Sensor) -> Self {
        let top = usize::from(sensor.clipped);
        let table: Vec<f32> = (0..=top).map(|raw| sensor.electrons(raw as u16) as f32).collect();
        let offset = sensor.electrons(0);
        let slope = (sensor.electrons(top as u16) - offset) / top.max(1) as f64;
        let straight = (0..=top).all(|raw| {
            (slope.mul_add(raw as f64, offset) - f64::from(table[raw])).abs() < 1e-3 * slope.abs()
        });
        if straight {
            Self::Straight { slope: slope as f32, offset: offset as f32 }
        } else {
            Self::Table(table)
        }
    }

    /// Slope and offset on what a raw value is read as: itself, or its entry in the table.
    pub(crate) const fn line(&self) -> (f32, f32) {
        match self {
            Self::Straight { slope, offset } => (*slope, *offset),
            Self::Table(_) => (1.0, 0.0),
        }
    }
}

/// The exposures of a pose that show light, shortest first.
#[derive(Clone, Debug)]
pub(crate) struct Shots<'a> {
    pub(crate) list: Vec<Shot<'a>>,
    pub(crate) plans: Plans,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) ramp: Ramp,
    /// Dark signal at the mean exposure and current of every pixel, in steps, and what a step of either is.
    pub(crate) dark_mean: &'a [i16],
    pub(crate) dark_current: &'a [i16],
    pub(crate) dark_step: [f32; 2],
    pub(crate) dark: &'a DarkModel,
    /// Variances of the dark signal's two parts.
    pub(crate) dark_mean_e2: f32,
    pub(crate) dark_current_e2: f32,
    /// Of reading and rounding, electrons².
    pub(crate) read_e2: f32,
    /// Raw value from which on a pixel is clipped.
    pub(crate) clipped: u16,
    /// Raw value from which on a neighbourhood's mean counts as saturated.
    pub(crate) saturated: f32,
    /// The same for a single raw value.
    pub(crate) saturated_from: u16,
    /// Raw value below which no neighbour need be asked.
    pub(crate) surely_below: u16,
    /// Relative standard uncertainty of the lamp's mean over the pose.
    pub(crate) lamp_relative: f64,
}

impl<'a> Shots<'a> {
    /// Those of a record whose frames were held against the camera.
    ///
    /// # Errors
    /// [`AcquisitionError::NoLight`].
    pub(crate) fn of(
        record: &'a PoseRecord,
        width: usize,
        sensor: &Sensor,
        dark: &'a DarkModel,
    ) -> Result<Self, AcquisitionError> {
        let mut lit: Vec<&Exposure> = record
            .exposures
            .iter()
            .filter(|e| e.shutter_open && e.lamp_monitor > 0.0 && e.frame.exposure.as_nanos() > 0)
            .collect();
        // the order of taking must not matter for rounding either
        lit.sort_by_key(|e| (e.frame.exposure, e.frame.sequence));
        let Some(height) = lit.first().map(|e| e.frame.pixels.len() / width.max(1)) else {
            return Err(AcquisitionError::NoLight { pose: record.index });
        };
        let (ramp, usual) = (Ramp::of(sensor), dark.usual());
        let (slope, offset) = ramp.line();
        let list: Vec<Shot<'_>> = lit
            .iter()
            .map(|e| {
                let t = e.frame.exposure.as_secs_f64();
                let dark_s = t * dark.at_temperature(e.frame.sensor_temperature_c);
                let x = t * e.lamp_monitor;
                let dark_e = f64::from(usual[0]) + f64::from(usual[1]) * (dark_s - dark.mean_t_s);
                let noise = f64::from(usual[1].max(0.0)) * dark_s + sensor.read_variance_e2;
                Shot {
                    raw: &e.frame.pixels,
                    x: x as f32,
                    dark_s: dark_s as f32,
                    since_mean_s: (dark_s - dark.mean_t_s) as f32,
                    noise_rate: (noise / x) as f32,
                    rate_of_level: [f64::from(slope) / x, (f64::from(offset) - dark_e) / x].map(|v| v as f32),
                }
            })
            .collect();
        let (mean, current) = dark.lanes();
        let ((dark_mean, mean_step), (dark_current, current_step)) = (mean.parts(), current.parts());
        let floor = Floor {
            read_e2: sensor.read_variance_e2,
            dark_mean_e2: dark.mean_variance,
            dark_current_e2: dark.current_variance,
            ramp: [f64::from(slope), f64::from(offset)],
        };
        Ok(Self {
            plans: Plans::of(&list, &floor),
            list,
            width,
            height,
            ramp,
            dark_mean,
            dark_current,
            dark_step: [mean_step, current_step],
            dark,
            dark_mean_e2: dark.mean_variance as f32,
            dark_current_e2: dark.current_variance as f32,
            read_e2: sensor.read_variance_e2 as f32,
            clipped: sensor.clipped,
            saturated: sensor.saturated,
            saturated_from: sensor.saturated.ceil() as u16,
            surely_below: ((CLEAR * sensor.saturated).ceil() as u16).min(sensor.clipped),
            lamp_relative: monitor_spread(&lit),
        })
    }

    /// Number of exposures.
    pub(crate) const fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether each of eight pixels from (x, y) serves in an exposure: 1 or 0. A single one is judged by its eight neighbours of the same colour,
    /// not by its own value: dropping the frames in which its own noise was high would pull the rest down.
    #[inline(always)]
    pub(crate) fn usable<W: Wide>(&self, wide: W, raw: &[u16], x: usize, y: usize) -> W::F {
        let (w, h) = (self.width, self.height);
        let p = y * w + x;
        if x < 2 || x + WIDE + 2 > w || y < 2 || y + 2 >= h {
            let n = WIDE.min(w - x);
            let serves = |k: usize| {
                let own = raw[p + k];
                own < self.clipped
                    && (own < self.surely_below || self.neighbourhood(raw, p + k) < self.saturated)
            };
            return wide.load(&std::array::from_fn(|k| f32::from(k >= n || serves(k))));
        }
        let row = |p: usize| {
            let all: &[u16; WIDE + 4] = take(raw, p - 2);
            [0, 2, 4].map(|k| wide.counts(take(all, k)))
        };
        let [left, own, right] = row(p);
        let mut sum = wide.add(left, right);
        for [left, middle, right] in [row(p - 2 * w), row(p + 2 * w)] {
            sum = wide.add(sum, wide.add(left, wide.add(middle, right)));
        }
        let clear = wide.add(
            wide.below(own, wide.splat(f32::from(self.surely_below))),
            wide.below(sum, wide.splat(8.0 * self.saturated)),
        );
        let below = wide.below(own, wide.splat(f32::from(self.clipped)));
        wide.where_above_zero(clear, below, wide.splat(0.0))
    }

    /// Mean raw value of the eight neighbours of the same colour lattice (those there are).
    fn neighbourhood(&self, raw: &[u16], p: usize) -> f32 {
        let (w, h) = (self.width, self.height);
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
}

/// Standard uncertainty of the mean of the monitor readings, relative, as far as they scatter about a steady drift.
fn monitor_spread(lit: &[&Exposure]) -> f64 {
    let mut by_time: Vec<(f64, f64)> =
        lit.iter().map(|e| (e.frame.sequence as f64, e.lamp_monitor)).collect();
    by_time.sort_by(|a, b| a.0.total_cmp(&b.0));
    let readings: Vec<f64> = by_time.iter().map(|v| v.1).collect();
    crate::lamp::scatter(&readings) / (readings.len() as f64).sqrt()
}
