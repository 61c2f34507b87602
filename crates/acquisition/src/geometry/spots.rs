//! The lamp's mirror image on a black glass, to a few hundredths of a pixel.
//!
//! The shortest exposure shows where the brightest place is; around it the merged pixels are fitted by the image of a uniform lamp: an [`Ellipse`] whose
//! half axes the optics give, covering each pixel by its exact share, brighter where Fresnel's reflectance and the pixel's étendue are larger.
//! What is fitted is its centre, its level and a constant background, by Gauss and Newton with the merge's variances.

use std::sync::Arc;

use gonio_instrument::{Exposure, Pose, PoseRecord, ScanKind};
use gonio_optics::fresnel;
use nalgebra::{Matrix4, Vector4};

use super::ellipse::Ellipse;
use crate::dark::{DarkFrames, DarkModel};
use crate::error::AcquisitionError;
use crate::merge::{Merged, check_frames, merge};
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

/// A spot that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Spot {
    /// Session and pose, for people.
    pub name: String,
    /// Flat glass or wedge.
    pub kind: ScanKind,
    /// Where the encoders said the holder stood.
    pub readback: Pose,
    /// Centre (column, row), pixels from the outer corner of the first pixel.
    pub centre_px: [f64; 2],
    /// Standard uncertainty of either coordinate, pixels.
    pub sigma_px: f64,
    /// Half axes of the image, pixels.
    pub radii_px: [[f64; 2]; 2],
    /// Level, electrons per second of a pixel wholly inside.
    pub level: f64,
    /// Root mean square residual over the level.
    pub misfit: f64,
    /// Observed and modelled sums per channel, for their relative gains.
    pub channels: [[f64; 2]; 3],
}

/// Why a pose gave no spot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoSpot {
    /// Nothing brighter than noise: the mirror image falls outside the picture, into an opening or behind the holder.
    #[error(
        "nothing is brighter than the noise: the lamp's image falls outside the picture, into an opening or behind the holder"
    )]
    Dark,
    /// Too near to the picture's border, the mirror's rim or an opening.
    #[error(
        "the lamp's image at ({column:.0}, {row:.0}) is cut by the picture's border, the mirror's rim or an opening"
    )]
    Cut {
        /// Column.
        column: f64,
        /// Row.
        row: f64,
    },
    /// It does not look like the lamp.
    #[error(
        "what shines at ({column:.0}, {row:.0}) is not the lamp's image: it departs from it by {percent:.0} % of its level"
    )]
    Misfit {
        /// Column.
        column: f64,
        /// Row.
        row: f64,
        /// Departure, percent of the level.
        percent: f64,
    },
    /// Too few pixels that are not saturated.
    #[error(
        "the lamp's image at ({column:.0}, {row:.0}) is saturated in every exposure; scan with shorter exposures or a dimmer lamp"
    )]
    Saturated {
        /// Column.
        column: f64,
        /// Row.
        row: f64,
    },
}

/// Pixels around the image that are looked at, beyond its edge.
const MARGIN_PX: f64 = 3.0;
/// A clear way is asked for this far beyond its edge.
const CLEAR_PX: f64 = 1.5;
/// A block of 6 × 6 pixels must stand this many standard deviations of reading above black.
const DETECTED: f64 = 12.0;
/// Model errors at the edge of the image, over its level.
const EDGE_ERROR: f64 = 0.02;
/// Largest root mean square residual over the level.
const MOST_MISFIT: f64 = 0.12;

/// Most steps of a fit.
const MOST_TURNS: usize = 40;
/// A centre that moves less has arrived, pixels.
const ARRIVED_PX: f64 = 1e-4;

/// Finds the spots of one session, pose by pose.
pub struct SpotFinder {
    map: Arc<PixelMap>,
    sensor: Sensor,
    dark_frames: DarkFrames,
    dark: DarkModel,
    index: f64,
    gains: [f64; 3],
}

impl SpotFinder {
    /// For a session of black glass of refractive index `index`; `gains` are the channels' relative sensitivities (1 where unknown).
    #[must_use]
    pub fn new(map: Arc<PixelMap>, options: &Options, index: f64, gains: [f64; 3]) -> Self {
        let sensor = Sensor::of(map.description(), options);
        let dark = DarkFrames::default().model(&sensor, map.width() * map.height());
        Self { map, sensor, dark_frames: DarkFrames::default(), dark, index, gains }
    }

    /// The spot of a pose, if there is one; the pose's dark frames serve from here on.
    ///
    /// # Errors
    /// [`AcquisitionError`] for frames of the wrong size or a pose without light.
    pub fn find(
        &mut self,
        record: &PoseRecord,
        kind: ScanKind,
        name: &str,
    ) -> Result<Result<Spot, NoSpot>, AcquisitionError> {
        check_frames(record, &self.map)?;
        if let Some(dark) = self.dark_frames.take(record, &self.sensor) {
            self.dark = dark;
        }
        let lit = record.exposures.iter().filter(|e| e.shutter_open && e.lamp_monitor > 0.0);
        let Some(shortest) = lit.min_by_key(|e| e.frame.exposure) else {
            return Err(AcquisitionError::NoLight { pose: record.index });
        };
        let Some(at) = self.brightest(shortest) else { return Ok(Err(NoSpot::Dark)) };
        let cut = NoSpot::Cut { column: at[0], row: at[1] };
        let Some(start) = self.image_at(at) else { return Ok(Err(cut)) };
        let window = Window::around(&start, MARGIN_PX + 3.0, self.map.width(), self.map.height());
        let mut wanted = vec![false; self.map.width() * self.map.height()];
        for (column, row) in window.pixels() {
            wanted[row * self.map.width() + column] = true;
        }
        let merged = merge(record, &self.map, &self.sensor, &self.dark, &wanted)?;
        Ok(self.fit(&merged.pixels, start).map(|(ellipse, f)| Spot {
            name: name.to_owned(),
            kind,
            readback: record.readback,
            centre_px: ellipse.centre,
            sigma_px: f.sigma_px,
            radii_px: ellipse.radii,
            level: f.level,
            misfit: f.misfit,
            channels: f.channels,
        }))
    }

    /// Centre of the brightest 6 × 6 pixels of a frame.
    fn brightest(&self, e: &Exposure) -> Option<[f64; 2]> {
        let (w, h) = (self.map.width(), self.map.height());
        let (tw, th) = (w / 2, h / 2);
        let mut tiles = vec![0.0f32; tw * th];
        for (ty, line) in tiles.chunks_mut(tw).enumerate() {
            for (tx, t) in line.iter_mut().enumerate() {
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let p = (2 * ty + dy) * w + 2 * tx + dx;
                    if !self.dark.is_hot(p) {
                        *t += self.sensor.electrons(e.frame.pixels[p]) as f32;
                    }
                }
            }
        }
        let noise = DETECTED * (36.0 * self.sensor.read_variance_e2).sqrt();
        let (mut best, mut most) = (None, noise);
        for ty in 1..th.saturating_sub(1) {
            for tx in 1..tw.saturating_sub(1) {
                let sum: f32 =
                    (0..3).map(|j| tiles[(ty + j - 1) * tw + tx - 1..][..3].iter().sum::<f32>()).sum();
                if f64::from(sum) > most {
                    most = f64::from(sum);
                    best = Some((tx, ty));
                }
            }
        }
        let (tx, ty) = best?;
        // centre of gravity of what is around it
        let (mut sum, mut moment) = (0.0, [0.0; 2]);
        for y in (2 * ty).saturating_sub(8)..(2 * ty + 10).min(h) {
            for x in (2 * tx).saturating_sub(8)..(2 * tx + 10).min(w) {
                let v = self.sensor.electrons(e.frame.pixels[y * w + x]);
                if v > 8.0 * self.sensor.read_variance_e2.sqrt() && !self.dark.is_hot(y * w + x) {
                    sum += v;
                    moment = [moment[0] + v * (x as f64 + 0.5), moment[1] + v * (y as f64 + 0.5)];
                }
            }
        }
        if sum > 0.0 {
            Some(moment.map(|m| m / sum))
        } else {
            Some([2.0 * tx as f64 + 1.0, 2.0 * ty as f64 + 1.0])
        }
    }

    /// The lamp's image as the optics draw it at a pixel.
    fn image_at(&self, at: [f64; 2]) -> Option<Ellipse> {
        let optics = self.map.optics();
        let d = optics.view(at[0], at[1])?.direction;
        let alpha = self.map.description().lamp.half_angle().radians();
        let image = optics.image(d, alpha)?;
        Some(Ellipse { centre: at, radii: image.radii_px })
    }

    /// Brightness of a wholly covered pixel: Fresnel's reflectance times étendue, relative to `Ellipse::centre`.
    fn sheen(&self, column: f64, row: f64) -> f64 {
        let optics = self.map.optics();
        let Some(view) = optics.view(column, row) else { return 0.0 };
        let half = (0.5 * view.direction.angle_to(optics.lamp()).radians()).cos();
        fresnel::dielectric(half, self.index) * optics.etendue(column, row)
    }

    fn fit(&self, pixels: &[Merged], start: Ellipse) -> Result<(Ellipse, Fitted), NoSpot> {
        let (w, h) = (self.map.width(), self.map.height());
        let mut e = start;
        let cut = |e: &Ellipse| NoSpot::Cut { column: e.centre[0], row: e.centre[1] };
        for turn in 0..MOST_TURNS {
            // the half axes follow the centre while it still moves
            if turn < 4 {
                e = self.image_at(e.centre).ok_or_else(|| cut(&e))?;
            }
            let window = Window::around(&e, MARGIN_PX, w, h);
            if !window.whole || window.pixels().any(|(x, y)| !self.clear_enough(&e, x, y)) {
                return Err(cut(&e));
            }
            let step = self.step(pixels, &e, &window)?;
            let size = step.shift[0].hypot(step.shift[1]);
            // an image hardly wider than a pixel may jump to and fro over its neighbours' edges
            let limit = (2.0 / size).min(if turn < 10 { 1.0 } else { 0.5 });
            e.centre = [0, 1].map(|k| e.centre[k] + limit * step.shift[k]);
            let away = (e.centre[0] - start.centre[0]).hypot(e.centre[1] - start.centre[1]);
            if !away.is_finite() || away > 8.0 {
                break;
            }
            if turn >= 4 && size < ARRIVED_PX {
                return if step.fitted.misfit > MOST_MISFIT {
                    let percent = 100.0 * step.fitted.misfit;
                    Err(NoSpot::Misfit { column: e.centre[0], row: e.centre[1], percent })
                } else {
                    Ok((e, step.fitted))
                };
            }
        }
        Err(NoSpot::Misfit { column: start.centre[0], row: start.centre[1], percent: 100.0 })
    }

    /// Whether a pixel that the image reaches (with a margin) sees the mirror.
    fn clear_enough(&self, e: &Ellipse, x: usize, y: usize) -> bool {
        let grown = |v: [f64; 2]| {
            let n = v[0].hypot(v[1]).max(1e-9);
            v.map(|c| c * (1.0 + CLEAR_PX / n))
        };
        let wide = Ellipse { centre: e.centre, radii: e.radii.map(grown) };
        wide.coverage(x, y) == 0.0 || self.map.is_clear(y * self.map.width() + x)
    }

    /// One step of Gauss and Newton.
    fn step(&self, pixels: &[Merged], e: &Ellipse, window: &Window) -> Result<Step, NoSpot> {
        let w = self.map.width();
        let centre_sheen = self.sheen(e.centre[0], e.centre[1]).max(1e-300);
        const H: f64 = 1e-3;
        let moved = |dx: f64, dy: f64| Ellipse { centre: [e.centre[0] + dx, e.centre[1] + dy], ..*e };
        let shifted = [moved(H, 0.0), moved(-H, 0.0), moved(0.0, H), moved(0.0, -H)];
        struct Datum {
            value: f64,
            variance: f64,
            gain: f64,
            share: f64,
            slope: [f64; 2],
            channel: usize,
        }
        let mut saturated = 0;
        let mut data = Vec::new();
        for (x, y) in window.pixels() {
            let p = y * w + x;
            let m = pixels[p];
            if m.rate == f32::INFINITY {
                saturated += 1;
            }
            if !m.is_valid() || self.dark.is_hot(p) {
                continue;
            }
            let channel = self.map.channel(p);
            let gain = self.gains[channel] * self.sheen(x as f64 + 0.5, y as f64 + 0.5) / centre_sheen;
            let [a, b, c, d] = [0, 1, 2, 3].map(|k: usize| shifted[k].coverage(x, y));
            data.push(Datum {
                value: f64::from(m.rate),
                variance: f64::from(m.shot + m.read + m.dark),
                gain,
                share: e.coverage(x, y),
                slope: [(a - b) / (2.0 * H), (c - d) / (2.0 * H)],
                channel,
            });
        }
        let too_few = NoSpot::Saturated { column: e.centre[0], row: e.centre[1] };
        if data.len() < 12 || saturated as f64 > 0.9 * e.area() {
            return Err(too_few);
        }
        // level and background first: the rest is linear about them
        let level = {
            let (mut num, mut den) = (0.0, 1e-300);
            for d in &data {
                num += d.value * d.share * d.gain;
                den += (d.share * d.gain).powi(2);
            }
            num / den
        };
        let mut normal = Matrix4::<f64>::zeros();
        let mut right = Vector4::<f64>::zeros();
        let mut chi2 = 0.0;
        let solve = |background: f64,
                     level: f64,
                     normal: &mut Matrix4<f64>,
                     right: &mut Vector4<f64>,
                     chi2: &mut f64| {
            *normal = Matrix4::zeros();
            *right = Vector4::zeros();
            *chi2 = 0.0;
            for d in &data {
                let blur = EDGE_ERROR * level * 4.0 * d.share * (1.0 - d.share);
                let weight = 1.0 / (d.variance + blur * blur + (1e-3 * level).powi(2)).max(1e-300);
                let r = d.value - level * d.gain * d.share - background;
                let j = Vector4::new(
                    level * d.gain * d.slope[0],
                    level * d.gain * d.slope[1],
                    level * d.gain * d.share,
                    level,
                );
                *normal += j * j.transpose() * weight;
                *right += j * (r * weight);
                *chi2 += r * r * weight;
            }
        };
        solve(0.0, level, &mut normal, &mut right, &mut chi2);
        let Some(inverse) = normal.try_inverse() else { return Err(too_few) };
        let s = inverse * right;
        let (level, background) = (level * (1.0 + s[2]), level * s[3]);
        // how well it fits once moved
        let after = moved(s[0].clamp(-2.0, 2.0), s[1].clamp(-2.0, 2.0));
        let (mut sum, mut n) = (0.0, 0.0);
        let mut channels = [[0.0; 2]; 3];
        for d in &data {
            let model = d.gain
                * (d.share
                    + d.slope[0] * (after.centre[0] - e.centre[0])
                    + d.slope[1] * (after.centre[1] - e.centre[1]));
            let r = d.value - background - level * model;
            sum += r * r;
            n += 1.0;
            if d.share > 0.5 {
                channels[d.channel][0] += d.value - background;
                channels[d.channel][1] += level * model / self.gains[d.channel];
            }
        }
        let covered = data.iter().filter(|d| d.share > 0.0).count().max(1) as f64;
        let scale = (chi2 / (n - 4.0f64).max(1.0)).max(1.0);
        let sigma_px = (0.5 * (inverse[(0, 0)] + inverse[(1, 1)]) * scale).sqrt();
        Ok(Step {
            shift: [s[0], s[1]],
            fitted: Fitted {
                sigma_px,
                level,
                misfit: (sum / covered).sqrt() / level.abs().max(1e-300),
                channels,
            },
        })
    }
}

/// The channels' relative sensitivities, green as 1, from all spots of a calibration; 1 for a channel nobody saw.
#[must_use]
pub fn channel_gains(spots: &[Spot]) -> [f64; 3] {
    let ratio = [0, 1, 2].map(|c: usize| {
        let sum = |k: usize| spots.iter().map(|s| s.channels[c][k] / s.level).sum::<f64>();
        let (seen, modelled) = (sum(0), sum(1));
        if modelled > 0.0 && seen > 0.0 { seen / modelled } else { 1.0 }
    });
    ratio.map(|r| r / ratio[1])
}

struct Fitted {
    sigma_px: f64,
    level: f64,
    misfit: f64,
    channels: [[f64; 2]; 3],
}

struct Step {
    shift: [f64; 2],
    fitted: Fitted,
}

/// A box of pixels.
struct Window {
    columns: std::ops::Range<usize>,
    rows: std::ops::Range<usize>,
    /// Nothing of it lies outside the sensor.
    whole: bool,
}

impl Window {
    fn around(e: &Ellipse, margin: f64, width: usize, height: usize) -> Self {
        let r = e.reach();
        let low = [0, 1].map(|k| (e.centre[k] - r[k] - margin).floor());
        let high = [0, 1].map(|k| (e.centre[k] + r[k] + margin).ceil());
        let within = |v: f64, n: usize| v.clamp(0.0, n as f64) as usize;
        let whole = low[0] >= 0.0 && low[1] >= 0.0 && high[0] <= width as f64 && high[1] <= height as f64;
        Self {
            columns: within(low[0], width)..within(high[0], width),
            rows: within(low[1], height)..within(high[1], height),
            whole,
        }
    }

    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.rows.clone().flat_map(move |y| self.columns.clone().map(move |x| (x, y)))
    }
}
