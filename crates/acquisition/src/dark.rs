//! The dark signal per pixel, `mean + current · (t − t̄)`, from frames taken with the shutter closed; hot pixels.
//!
//! Written about the mean exposure time t̄ of the dark frames, its two parts are independent.

mod steps;

use std::time::Duration;

use gonio_instrument::{Frame, PoseRecord};

use crate::sensor::Sensor;
pub(crate) use steps::Steps;

/// Sums over dark frames, grouped by exposure time; [`DarkFrames::model`] makes the model.
#[derive(Clone, Debug, Default)]
pub struct DarkFrames {
    groups: Vec<Group>,
}

#[derive(Clone, Debug)]
struct Group {
    exposure: Duration,
    frames: u32,
    /// Sum of electrons above the nominal black level.
    sum: Vec<f32>,
    /// Sum of the temperatures told, and how many frames told one.
    temperature: (f64, u32),
}

/// Temperature step that doubles the dark current of silicon, K, where no calibration tells the sensor's own.
pub const DOUBLING_K: f64 = 7.0;

/// Dark signal of every pixel.
#[derive(Clone, Debug)]
pub struct DarkModel {
    /// Electrons at the exposure t̄, above the nominal black level.
    mean_e: Steps,
    /// Electrons per second.
    current_e_s: Steps,
    hot: Vec<bool>,
    /// The hot pixels, in rising order.
    hot_list: Vec<u32>,
    /// Medians of mean and current.
    usual: [f32; 2],
    /// Sensor temperature at which the current was found (that of the longest exposure), °C.
    temperature_c: Option<f64>,
    /// Temperature step that doubles the current, K.
    doubling_k: f64,
    /// t̄, seconds.
    pub mean_t_s: f64,
    /// Variance of a mean, electrons².
    pub mean_variance: f64,
    /// Variance of a current, (electrons/s)²; the same for all pixels but hot ones.
    pub current_variance: f64,
}

impl DarkFrames {
    /// Takes the dark frames of a record (those with the shutter closed): the model with them, or `None` where it has none.
    pub fn take(&mut self, record: &PoseRecord, sensor: &Sensor) -> Option<DarkModel> {
        let mut pixels = None;
        for e in record.exposures.iter().filter(|e| !e.shutter_open) {
            self.add(&e.frame, sensor);
            pixels = Some(e.frame.pixels.len());
        }
        pixels.map(|n| self.model(sensor, n))
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: &Frame, sensor: &Sensor) {
        let group = match self.groups.iter_mut().position(|g| g.exposure == frame.exposure) {
            Some(k) => &mut self.groups[k],
            None => {
                let at = self.groups.partition_point(|g| g.exposure < frame.exposure);
                let empty = Group {
                    exposure: frame.exposure,
                    frames: 0,
                    sum: vec![0.0; frame.pixels.len()],
                    temperature: (0.0, 0),
                };
                self.groups.insert(at, empty);
                &mut self.groups[at]
            }
        };
        group.frames += 1;
        if let Some(t) = frame.sensor_temperature_c {
            group.temperature = (group.temperature.0 + t, group.temperature.1 + 1);
        }
        for (s, &raw) in group.sum.iter_mut().zip(&frame.pixels) {
            *s += sensor.electrons(raw) as f32;
        }
    }

    /// Whether no dark frame was seen.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> u32 {
        self.groups.iter().map(|g| g.frames).sum()
    }

    /// A straight line in the exposure time through every pixel's means, each group weighted by its number of frames.
    ///
    /// Pixels that a calibration found hot or dead count as hot whatever the frames say. With one exposure time alone the nominal black level is the offset. Hot are pixels whose current lies above the
    /// median by more than ten robust standard deviations and by more than the noise of its determination.
    #[must_use]
    pub fn model(&self, sensor: &Sensor, pixels: usize) -> DarkModel {
        let mut out = DarkModel::none(pixels);
        out.doubling_k = sensor.doubling_k;
        for &p in sensor.defects.iter().filter(|p| (**p as usize) < pixels) {
            out.hot[p as usize] = true;
        }
        let n: f64 = self.groups.iter().map(|g| f64::from(g.frames)).sum();
        if n == 0.0 {
            out.list_hot();
            return out;
        }
        let read = sensor.read_variance_e2;
        out.temperature_c = self
            .groups
            .last()
            .filter(|g| g.temperature.1 > 0)
            .map(|g| g.temperature.0 / f64::from(g.temperature.1));
        let mean_t = self.weighted(n, |g| g.exposure.as_secs_f64());
        let stt = self.weighted(n, |g| (g.exposure.as_secs_f64() - mean_t).powi(2)) * n;
        let two = stt > 1e-12;
        let t2 = self.weighted(n, |g| g.exposure.as_secs_f64().powi(2)) * n;
        let (mut means, mut currents) = (vec![0.0f32; pixels], vec![0.0f32; pixels]);
        for p in 0..pixels {
            let (mut mean, mut cov) = (0.0, 0.0);
            for g in &self.groups {
                let sum = f64::from(g.sum.get(p).copied().unwrap_or(0.0));
                mean += sum / n;
                cov += sum * if two { g.exposure.as_secs_f64() - mean_t } else { g.exposure.as_secs_f64() };
            }
            let current = if two { cov / stt } else { cov / t2.max(1e-12) };
            currents[p] = current as f32;
            means[p] = if two { mean as f32 } else { 0.0 };
        }
        let mut sorted = currents.clone();
        let median = f64::from(median_of(&mut sorted));
        let mut spread: Vec<f32> = sorted.iter().map(|c| (f64::from(*c) - median).abs() as f32).collect();
        let robust = 1.4826 * f64::from(median_of(&mut spread));
        // the noise of the dark electrons themselves, at the current that is usual
        let dark_noise = median.max(0.0) * self.weighted(n, |g| g.exposure.as_secs_f64());
        out.current_variance = (read + dark_noise) / if two { stt } else { t2.max(1e-12) };
        if two {
            out.mean_t_s = mean_t;
            out.mean_variance = (read + dark_noise) / n;
        }
        let bound = median + 10.0 * robust.max(out.current_variance.sqrt());
        for (hot, c) in out.hot.iter_mut().zip(&currents) {
            *hot |= f64::from(*c) > bound;
        }
        out.mean_e = Steps::of(&means, |p| !out.hot[p]);
        out.current_e_s = Steps::of(&currents, |p| !out.hot[p]);
        out.mean_variance += out.mean_e.variance();
        out.current_variance += out.current_e_s.variance();
        out.usual = [median_of(&mut means), median as f32];
        out.list_hot();
        out
    }

    fn weighted(&self, n: f64, f: impl Fn(&Group) -> f64) -> f64 {
        self.groups.iter().map(|g| f64::from(g.frames) * f(g)).sum::<f64>() / n
    }
}

impl DarkModel {
    /// No dark signal beyond the nominal black level, no hot pixels.
    #[must_use]
    pub fn none(pixels: usize) -> Self {
        Self {
            mean_e: Steps::none(pixels),
            current_e_s: Steps::none(pixels),
            hot: vec![false; pixels],
            hot_list: Vec::new(),
            usual: [0.0; 2],
            temperature_c: None,
            doubling_k: DOUBLING_K,
            mean_t_s: 0.0,
            mean_variance: 0.0,
            current_variance: 0.0,
        }
    }

    /// Mean (electrons at t̄) and current (electrons/s) of a pixel; hot ones may be cut off.
    #[must_use]
    pub fn at(&self, pixel: usize) -> (f64, f64) {
        (f64::from(self.mean_e.at(pixel)), f64::from(self.current_e_s.at(pixel)))
    }

    /// Mean and current of every pixel as they lie.
    pub(crate) const fn lanes(&self) -> (&Steps, &Steps) {
        (&self.mean_e, &self.current_e_s)
    }

    /// Medians of mean and current over the sensor.
    pub(crate) const fn usual(&self) -> [f32; 2] {
        self.usual
    }

    /// The hot pixels from `first` on before `end`, in rising order.
    pub(crate) fn hot_between(&self, first: usize, end: usize) -> &[u32] {
        let from = self.hot_list.partition_point(|&p| (p as usize) < first);
        let count = self.hot_list[from..].partition_point(|&p| (p as usize) < end);
        &self.hot_list[from..from + count]
    }

    fn list_hot(&mut self) {
        self.hot_list = (0..self.hot.len()).filter(|&p| self.hot[p]).map(|p| p as u32).collect();
    }

    /// Factor on the current at another sensor temperature; 1 where either is not known.
    #[must_use]
    pub fn at_temperature(&self, sensor_c: Option<f64>) -> f64 {
        match (sensor_c, self.temperature_c) {
            (Some(now), Some(then)) => ((now - then) / self.doubling_k).exp2(),
            _ => 1.0,
        }
    }

    /// Whether a pixel is hot: its values are not used.
    #[must_use]
    pub fn is_hot(&self, pixel: usize) -> bool {
        self.hot[pixel]
    }

    /// Number of hot pixels.
    #[must_use]
    pub fn hot_pixels(&self) -> usize {
        self.hot_list.len()
    }
}

/// The middle one, in place; 0 of nothing.
fn median_of(values: &mut [f32]) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
