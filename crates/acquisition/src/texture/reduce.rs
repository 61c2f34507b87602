//! Frames of a pose to slices, one per head.

use std::sync::Arc;

use gonio_instrument::{PoseRecord, TextureCamera};
use gonio_optics::flake::FlakeVectors;
use gonio_optics::{Angle, fresnel};
use rayon::prelude::*;

use super::heads::{Head, heads};
use super::{TextureError, TextureWhite};
use crate::dark::{DarkFrames, DarkModel};
use crate::merge::{Merged, merge};
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

/// A texture with the angles it belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureSlice {
    /// Place of its pose in the plan.
    pub pose: u32,
    /// Its head.
    pub head: usize,
    /// Half angle inside the coat.
    pub half: Angle,
    /// Angle of incidence on a flake that flashes, inside the coat.
    pub incidence: Angle,
    /// f in 1/sr, row by row on the sample's raster: of the base under a coat of known index, else as seen.
    pub texels: Vec<[f32; 3]>,
    /// Texels no exposure shows; they hold the mean of the others.
    pub holes: usize,
}

/// Turns poses into slices.
pub struct TextureReducer {
    map: Arc<PixelMap>,
    sensor: Sensor,
    white: TextureWhite,
    index: Option<f64>,
    dark_frames: DarkFrames,
    dark: DarkModel,
}

impl TextureReducer {
    /// For the texture camera that `map` was made of and a coat of this index (none for an uncoated sample).
    ///
    /// # Errors
    /// [`TextureError`] for a description without a texture camera, or a reference of other heads.
    pub fn new(
        map: &Arc<PixelMap>,
        options: &Options,
        white: TextureWhite,
        index: Option<f64>,
    ) -> Result<Self, TextureError> {
        let d = map.description();
        d.textures().ok_or(TextureError::NoTextures)?;
        if white.scale.len() != d.camera.pixels() {
            return Err(TextureError::OtherHeads);
        }
        Ok(Self {
            sensor: Sensor::of(d, options),
            white,
            index,
            dark_frames: DarkFrames::default(),
            dark: DarkModel::none(d.camera.pixels()),
            map: Arc::clone(map),
        })
    }

    /// The slices of a pose; heads in the gloss, or too steep, give none.
    ///
    /// # Errors
    /// [`TextureError`] for frames of another camera or a pose without light.
    pub fn add(&mut self, record: &PoseRecord) -> Result<Vec<TextureSlice>, TextureError> {
        let d = self.map.description();
        let camera = d.textures().ok_or(TextureError::NoTextures)?;
        if let Some(dark) = self.dark_frames.take(record, &self.sensor) {
            self.dark = dark;
        }
        let wanted = super::interest(d, record.readback);
        let merged = merge(record, &self.map, &self.sensor, &self.dark, &wanted)?;
        let seen = heads(d, camera, record.readback);
        let usable: Vec<Head> = seen.into_iter().filter(|h| !h.in_gloss(d.lamp.half_angle())).collect();
        Ok(usable.par_iter().map(|head| self.slice(record.index, camera, head, &merged.pixels)).collect())
    }

    fn slice(&self, pose: u32, camera: &TextureCamera, head: &Head, merged: &[Merged]) -> TextureSlice {
        let [columns, rows] = camera.texels();
        let mm = camera.texel_mm();
        let through = self.index.map_or(1.0, |n| {
            let t = |cos: f64| 1.0 - fresnel::dielectric(cos, n);
            t(head.light.z) * t(head.view.z) / (n * n)
        });
        let factor = 1.0 / (head.light.z * through);
        let mut texels = vec![[f32::NAN; 3]; columns * rows];
        for (k, texel) in texels.iter_mut().enumerate() {
            let x = ((k % columns) as f64 + 0.5 - 0.5 * columns as f64) * mm;
            let y = ((k / columns) as f64 + 0.5 - 0.5 * rows as f64) * mm;
            *texel = self.texel(camera, head, merged, [x, y]).map(|v| (v * factor) as f32);
        }
        let holes = fill(&mut texels);
        let angles = match self.index {
            Some(n) => FlakeVectors::new(head.light, head.view, n).angles(),
            None => FlakeVectors::inside(head.light, head.view).angles(),
        };
        TextureSlice {
            pose,
            head: head.number,
            half: angles.theta_flake,
            incidence: angles.theta_inc,
            texels,
            holes,
        }
    }

    /// Rate over scale of each channel at a place of the sample; not a number where no pixel of a channel is known.
    fn texel(&self, camera: &TextureCamera, head: &Head, merged: &[Merged], [x, y]: [f64; 2]) -> [f64; 3] {
        let [w, h] = camera.size.map(|n| n as usize);
        let m = head.pixel_from_sample;
        // in pixels from the centre of the first one
        let column = m[0][0] * x + m[0][1] * y + 0.5 * w as f64 - 0.5;
        let row = m[1][0] * x + m[1][1] * y + 0.5 * h as f64 - 0.5;
        let pattern = self.map.description().camera.pattern;
        let (mut sum, mut total) = ([0.0; 3], [0.0; 3]);
        let first = |at: f64| (at - 2.0).ceil().max(0.0) as usize;
        for j in first(row)..h.min((row + 2.0).max(0.0) as usize + 1) {
            for i in first(column)..w.min((column + 2.0).max(0.0) as usize + 1) {
                let tent = |d: f64| (1.0 - 0.5 * d.abs()).max(0.0);
                let weight = tent(i as f64 - column) * tent(j as f64 - row);
                let p = head.number * w * h + j * w + i;
                let value = f64::from(merged[p].rate) / self.white.scale[p];
                if weight > 0.0 && value.is_finite() {
                    let channel = pattern.channel(i as u32, j as u32) as usize;
                    sum[channel] += weight * value;
                    total[channel] += weight;
                }
            }
        }
        [0, 1, 2].map(|c| if total[c] > 0.0 { sum[c] / total[c] } else { f64::NAN })
    }
}

/// Gives texels without a value the mean of the others; says how many there were.
fn fill(texels: &mut [[f32; 3]]) -> usize {
    let (mut sum, mut n) = ([0.0f64; 3], 0.0f64);
    for t in texels.iter().filter(|t| t.iter().all(|v| v.is_finite())) {
        n += 1.0;
        for (s, v) in sum.iter_mut().zip(t) {
            *s += f64::from(*v);
        }
    }
    let mean = sum.map(|s| (s / n.max(1.0)) as f32);
    let mut holes = 0;
    for t in texels.iter_mut().filter(|t| !t.iter().all(|v| v.is_finite())) {
        *t = mean;
        holes += 1;
    }
    holes
}
