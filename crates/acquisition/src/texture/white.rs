//! The white reference under the texture camera: k E0 g of every pixel.

use std::sync::Arc;

use gonio_brdf::{Brdf as _, ModelFile};
use gonio_instrument::PoseRecord;

use super::{TextureError, heads::heads};
use crate::dark::{DarkFrames, DarkModel};
use crate::merge::merge;
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

/// Scale of every pixel, electrons/s · sr; NaN where no white pose lights it.
#[derive(Clone, Debug)]
pub struct TextureWhite {
    pub(super) scale: Vec<f64>,
}

/// Sums over white poses.
pub struct TextureWhiteBuilder {
    map: Arc<PixelMap>,
    sensor: Sensor,
    brdf: ModelFile,
    dark_frames: DarkFrames,
    dark: DarkModel,
    /// Σ rate and Σ f cos θi per pixel.
    sums: Vec<[f64; 2]>,
}

impl TextureWhiteBuilder {
    /// For a reference of this BRDF under the texture camera that `map` was made of.
    #[must_use]
    pub fn new(map: &Arc<PixelMap>, options: &Options, brdf: ModelFile) -> Self {
        let camera = &map.description().camera;
        Self {
            sensor: Sensor::of(map.description(), options),
            brdf,
            dark_frames: DarkFrames::default(),
            dark: DarkModel::none(camera.pixels()),
            sums: vec![[0.0; 2]; camera.pixels()],
            map: Arc::clone(map),
        }
    }

    /// Takes a pose.
    ///
    /// # Errors
    /// [`TextureError`] for frames of another camera or a pose without light.
    pub fn add(&mut self, record: &PoseRecord) -> Result<(), TextureError> {
        let d = self.map.description();
        let camera = d.textures().ok_or(TextureError::NoTextures)?;
        if let Some(dark) = self.dark_frames.take(record, &self.sensor) {
            self.dark = dark;
        }
        let wanted = super::interest(d, record.readback);
        let merged = merge(record, &self.map, &self.sensor, &self.dark, &wanted)?;
        let (w, picture) = (camera.size[0] as usize, (camera.size[0] * camera.size[1]) as usize);
        for head in heads(d, camera, record.readback) {
            let f = self.brdf.eval(head.light, head.view);
            let part = head.number * picture..(head.number + 1) * picture;
            let pixels = merged.pixels[part.clone()].iter().zip(&wanted[part.clone()]);
            for ((p, (pixel, wanted)), sum) in pixels.enumerate().zip(&mut self.sums[part]) {
                let rate = f64::from(pixel.rate);
                if *wanted && rate.is_finite() {
                    let channel = d.camera.pattern.channel((p % w) as u32, (p / w) as u32) as usize;
                    sum[0] += rate;
                    sum[1] += f[channel] * head.light.z;
                }
            }
        }
        Ok(())
    }

    /// The reference.
    ///
    /// # Errors
    /// [`TextureError::NoWhite`] where no pose lit any pixel.
    pub fn finish(self) -> Result<TextureWhite, TextureError> {
        let scale: Vec<f64> = self
            .sums
            .iter()
            .map(|[rate, f]| if *f > 0.0 && *rate > 0.0 { rate / f } else { f64::NAN })
            .collect();
        if scale.iter().all(|s| s.is_nan()) { Err(TextureError::NoWhite) } else { Ok(TextureWhite { scale }) }
    }
}
