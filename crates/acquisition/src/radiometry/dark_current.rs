//! Black level and dark current against exposure and temperature.
//!
//! The mean over the pixels that are not hot, frame by frame, is `black + current · t / g` at each sensor temperature; over temperatures the current
//! doubles every so many kelvin and the black level may move. Frames that do not tell their temperature form one group of their own.

use gonio_instrument::PoseRecord;
use gonio_instrument::radiometry::{DarkCurrent, DarkPoint, Known};

use crate::dark::{DOUBLING_K, DarkFrames};
use crate::sensor::Sensor;

/// Temperatures nearer than this are one, K.
const SAME_K: f64 = 0.5;
/// Least spread of temperatures from which a doubling is told, K.
const SPREAD_K: f64 = 2.0;

/// Dark frames of all sessions.
#[derive(Debug, Default)]
pub struct DarkSeries {
    means: Vec<Mean>,
    /// Those of the session with most exposure time, for the pixels.
    pixels: DarkFrames,
    longest_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Mean {
    temperature_c: Option<f64>,
    exposure_s: f64,
    counts: f64,
    /// Variance of the mean from its own scatter over the picture, counts².
    variance: f64,
}

/// The line at one temperature.
#[derive(Clone, Copy)]
struct Line {
    temperature_c: Option<f64>,
    black: Known,
    /// Counts per second.
    slope: Known,
    /// Largest departure, counts.
    departure: f64,
}

impl DarkSeries {
    /// Takes the dark frames of a session's poses.
    pub fn add(&mut self, poses: &mut dyn Iterator<Item = PoseRecord>, sensor: &Sensor) {
        let (mut own, mut longest) = (DarkFrames::default(), 0.0f64);
        let mut held: Vec<(Option<f64>, f64, f64, f64)> = Vec::new();
        for record in poses {
            for e in record.exposures.iter().filter(|e| !e.shutter_open) {
                own.add(&e.frame, sensor);
                let t = e.frame.exposure.as_secs_f64();
                longest = longest.max(t);
                let (mean, variance) = usual_mean(&e.frame.pixels);
                held.push((e.frame.sensor_temperature_c, t, mean, variance));
            }
        }
        self.means.extend(held.into_iter().map(|(temperature_c, exposure_s, counts, variance)| Mean {
            temperature_c,
            exposure_s,
            counts,
            variance,
        }));
        if longest > self.longest_s || self.pixels.is_empty() {
            (self.longest_s, self.pixels) = (longest, own);
        }
    }

    /// Whether no dark frame was seen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Hot pixels.
    #[must_use]
    pub fn hot(&self, sensor: &Sensor, pixels: usize) -> Vec<u32> {
        let model = self.pixels.model(sensor, pixels);
        (0..pixels).filter(|&p| model.is_hot(p)).map(|p| p as u32).collect()
    }

    /// Dark current of each pixel, electrons per second: for the picture.
    #[must_use]
    pub fn map(&self, sensor: &Sensor, pixels: usize) -> Vec<f32> {
        let model = self.pixels.model(sensor, pixels);
        (0..pixels).map(|p| model.at(p).1 as f32).collect()
    }

    /// Black level (counts) at the temperature of the largest group, and the dark current; what had to be assumed, in words.
    #[must_use]
    pub fn find(&self, gain: Known) -> (Known, DarkCurrent, Vec<String>) {
        let electrons_per_count = gain.value;
        let mut notes = Vec::new();
        let mut groups: Vec<Vec<Mean>> = Vec::new();
        for m in &self.means {
            let same = |g: &&mut Vec<Mean>| match (g[0].temperature_c, m.temperature_c) {
                (Some(a), Some(b)) => (a - b).abs() < SAME_K,
                (a, b) => a.is_none() && b.is_none(),
            };
            match groups.iter_mut().find(same) {
                Some(g) => g.push(*m),
                None => groups.push(vec![*m]),
            }
        }
        groups.sort_by_key(|g| std::cmp::Reverse(g.len()));
        let lines: Vec<Line> = groups.iter().filter_map(|g| line(g)).collect();
        let Some(first) = lines.first() else {
            let m = self.means.iter().map(|m| m.counts).sum::<f64>() / self.means.len().max(1) as f64;
            notes.push(
                "all dark frames have one exposure: the dark current is not known, the black level holds it"
                    .to_owned(),
            );
            return (Known::new(m, 1.0), DarkCurrent::default(), notes);
        };
        let known = |l: &Line| {
            let current = l.slope.value * gain.value;
            Known::new(current, (l.slope.sigma * gain.value).hypot(current * gain.sigma / gain.value))
        };
        let mut told: Vec<(f64, &Line)> =
            lines.iter().filter_map(|l| l.temperature_c.map(|t| (t, l))).collect();
        told.sort_by(|a, b| a.0.total_cmp(&b.0));
        let spread = told.last().map_or(0.0, |l| l.0) - told.first().map_or(0.0, |l| l.0);
        let (mut doubling_k, mut black_per_k) = (None, None);
        if spread >= SPREAD_K {
            let logs: Vec<(f64, f64, f64)> = told
                .iter()
                .filter(|(_, l)| l.slope.value > 3.0 * l.slope.sigma)
                .map(|(t, l)| {
                    (*t, l.slope.value.log2(), l.slope.sigma / l.slope.value / std::f64::consts::LN_2)
                })
                .collect();
            if let Some(s) = straight(&logs).filter(|s| s.value > 0.0) {
                doubling_k = Some(Known::new(1.0 / s.value, s.sigma / (s.value * s.value)));
            }
            let blacks: Vec<(f64, f64, f64)> =
                told.iter().map(|(t, l)| (*t, l.black.value, l.black.sigma)).collect();
            black_per_k = straight(&blacks);
        }
        if doubling_k.is_none() {
            notes.push(format!(
                "the temperature that doubles the dark current is not known (the sessions' sensor temperatures differ by {spread:.1} K, \
                 at least {SPREAD_K} K are needed): {DOUBLING_K} K is assumed; add a dark session of a colder or warmer instrument"
            ));
        }
        let dark = DarkCurrent {
            current_e_s: known(first),
            temperature_c: first.temperature_c,
            doubling_k,
            black_per_k,
            nonlinearity_e: lines.iter().map(|l| l.departure).fold(0.0, f64::max) * electrons_per_count,
            points: told
                .iter()
                .map(|(t, l)| DarkPoint { temperature_c: *t, current_e_s: known(l), black_level: l.black })
                .collect(),
        };
        (first.black, dark, notes)
    }
}

/// Mean of the pixels within what noise and the usual spread explain, and its variance.
fn usual_mean(pixels: &[u16]) -> (f64, f64) {
    let mut histogram = vec![0u32; 65_536];
    for &v in pixels {
        histogram[usize::from(v)] += 1;
    }
    let half = pixels.len() as u32 / 2;
    let mut seen = 0;
    let median = histogram.iter().position(|n| {
        seen += n;
        seen > half
    });
    let median = median.unwrap_or(0) as f64;
    let mut far: Vec<(f64, u32)> = histogram
        .iter()
        .enumerate()
        .filter(|(_, n)| **n > 0)
        .map(|(v, n)| ((v as f64 - median).abs(), *n))
        .collect();
    far.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut seen = 0;
    let spread = far.iter().find(|(_, n)| {
        seen += n;
        seen > half
    });
    let reach = 12.0 * spread.map_or(1.0, |s| s.0).max(1.0);
    let (mut n, mut sum, mut square) = (0.0, 0.0, 0.0);
    for (v, count) in histogram.iter().enumerate().filter(|(v, _)| (*v as f64 - median).abs() <= reach) {
        let (v, c) = (v as f64 - median, f64::from(*count));
        n += c;
        sum += c * v;
        square += c * v * v;
    }
    let n = f64::max(n, 1.0);
    (median + sum / n, (square / n - (sum / n).powi(2)).max(1.0 / 12.0) / n)
}

/// The straight line in the exposure; `None` where there is only one exposure.
fn line(group: &[Mean]) -> Option<Line> {
    let weight = |m: &Mean| 1.0 / m.variance;
    let total: f64 = group.iter().map(weight).sum();
    let mean_t = group.iter().map(|m| weight(m) * m.exposure_s).sum::<f64>() / total;
    let mean_c = group.iter().map(|m| weight(m) * m.counts).sum::<f64>() / total;
    let stt: f64 = group.iter().map(|m| weight(m) * (m.exposure_s - mean_t).powi(2)).sum();
    if stt / total < 1e-12 {
        return None;
    }
    let stc: f64 = group.iter().map(|m| weight(m) * (m.exposure_s - mean_t) * m.counts).sum();
    let slope = stc / stt;
    let residual = |m: &Mean| m.counts - mean_c - slope * (m.exposure_s - mean_t);
    let freedom = (group.len() as f64 - 2.0).max(1.0);
    let chi2 = group.iter().map(|m| weight(m) * residual(m).powi(2)).sum::<f64>() / freedom;
    let widened = chi2.max(1.0);
    let black_sigma = (widened * (1.0 / total + mean_t * mean_t / stt)).sqrt();
    // departures of exposures, not of single frames
    let mut times: Vec<f64> = group.iter().map(|m| m.exposure_s).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let departure = times
        .iter()
        .map(|t| {
            let own: Vec<f64> = group.iter().filter(|m| m.exposure_s == *t).map(residual).collect();
            (own.iter().sum::<f64>() / own.len().max(1) as f64).abs()
        })
        .fold(0.0, f64::max);
    let temperatures: Vec<f64> = group.iter().filter_map(|m| m.temperature_c).collect();
    Some(Line {
        temperature_c: (!temperatures.is_empty())
            .then(|| temperatures.iter().sum::<f64>() / temperatures.len() as f64),
        black: Known::new(mean_c - slope * mean_t, black_sigma),
        slope: Known::new(slope, (widened / stt).sqrt()),
        departure,
    })
}

/// Slope of a straight line through (x, y, σ).
fn straight(points: &[(f64, f64, f64)]) -> Option<Known> {
    let w = |p: &(f64, f64, f64)| 1.0 / p.2.max(1e-12).powi(2);
    let total: f64 = points.iter().map(w).sum();
    let mean = points.iter().map(|p| w(p) * p.0).sum::<f64>() / total;
    let sxx: f64 = points.iter().map(|p| w(p) * (p.0 - mean).powi(2)).sum();
    let sxy: f64 = points.iter().map(|p| w(p) * (p.0 - mean) * p.1).sum();
    (points.len() >= 2 && sxx > 0.0).then(|| Known::new(sxy / sxx, sxx.sqrt().recip()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_mean_passes_over_hot_pixels() {
        let mut pixels: Vec<u16> = (0..1000).map(|k| 64 + (k % 3) as u16).collect();
        pixels[5] = 4000;
        pixels[900] = 3000;
        let (mean, variance) = usual_mean(&pixels);
        assert!(
            (mean - 65.0).abs() < 0.01 && (variance - 2.0 / 3.0 / 998.0).abs() < 1e-5,
            "{mean} {variance}"
        );
        assert_eq!(usual_mean(&[]).0, 0.0);
    }
}
