//! What the texture camera sees: each head's picture of the sample, texel by texel, without noise.
//!
//! ```text
//! rate(p) = G · mean over the pixel of  f(x) cos θi        (e/s)
//! ```
//!
//! G is chosen as for the instrument's camera: a white sample in normal light fills half the well in 20 ms. A head is telecentric: all its pixels look along one
//! direction, and a pixel grows on the sample by 1/cos θo. The lamp lights the whole picture; where a head looks into its mirror image in a smooth coat
//! the gloss F/Ω lies over everything. The mirror and the holder stand in nobody's way here, which a real arc of heads would have to be built for.

use gonio_instrument::{BayerPattern, Description, Misalignment, Pose, TextureCamera};
use gonio_optics::{Vec3, fresnel};
use rayon::prelude::*;

use super::holder::Holder;
use super::lamp::Lamp;
use super::radiance::RateMap;
use super::sample::Sample;
use super::turn;

const SCALE_ALBEDO: f64 = 0.98;
const SCALE_TIME_S: f64 = 0.020;
/// Points across a pixel, along the direction in which it does not grow.
const POINTS: usize = 2;

/// The heads of an instrument.
#[derive(Clone, Debug)]
pub struct TextureOptics {
    camera: TextureCamera,
    holder: Holder,
    lamp: Lamp,
    tilt_axis: Vec3,
    lamp_nominal: Vec3,
    pattern: BayerPattern,
    scale_e_per_s: f64,
    spin_offset_mm: f64,
}

impl TextureOptics {
    /// The heads of a description whose frames are theirs; `None` of any other. Errors move holder and lamp, not the heads.
    #[must_use]
    pub fn new(d: &Description, errors: &Misalignment) -> Option<Self> {
        let camera = d.textures()?.clone();
        Some(Self {
            camera,
            holder: Holder::new(d, errors),
            lamp: Lamp::new(d, errors),
            tilt_axis: d.holder.tilt_axis(),
            lamp_nominal: d.lamp.direction(),
            pattern: d.camera.pattern,
            scale_e_per_s: 0.5 * d.camera.full_well_e * std::f64::consts::PI / (SCALE_TIME_S * SCALE_ALBEDO),
            spin_offset_mm: d.holder.spin_offset_mm,
        })
    }

    /// The electron rates of every pixel of a frame at an actual pose.
    #[must_use]
    pub fn rate_map(&self, actual: Pose, sample: &Sample) -> RateMap {
        let [width, height] = self.camera.frame_size();
        let rows = self.camera.size[1] as usize;
        let mut rates = vec![0f32; width as usize * height as usize];
        rates.par_chunks_mut(width as usize).enumerate().for_each(|(row, out)| {
            self.row(actual, sample, row / rows, row % rows, out);
        });
        RateMap { width, height, rates }
    }

    /// One row of a head's picture.
    fn row(&self, actual: Pose, sample: &Sample, head: usize, row: usize, out: &mut [f32]) {
        let stand = self.holder.at(actual, 0.0, sample.wedge);
        let Some(&angle_deg) = self.camera.heads_deg.get(head) else { return };
        let to_head = turn::about(self.lamp_nominal, self.tilt_axis, angle_deg.to_radians());
        let along_columns = self.tilt_axis.cross(to_head);
        let (light, view) = (stand.sample_from_lab(self.lamp.direction), stand.sample_from_lab(to_head));
        if light.z <= 0.0 || view.z <= 1e-3 {
            return;
        }
        let gloss = self.gloss(sample, light, view);
        let plain = sample.base.eval(light, view);
        let seen = sample.flakes.as_ref().map(|f| f.prepared(light, view));
        let (sin, cos) = actual.spin.sin_cos();
        let origin = [self.spin_offset_mm * cos, -self.spin_offset_mm * sin];
        let p = self.camera.pixel_mm;
        let [w, h] = self.camera.size.map(f64::from);
        // pixels grow across the tilt axis
        let across = ((POINTS as f64 / view.z).ceil() as usize).min(16);
        for (column, rate) in out.iter_mut().enumerate() {
            let channel = self.pattern.channel(column as u32, row as u32) as usize;
            let f = match &seen {
                None => plain[channel],
                Some(seen) => {
                    let mut sum = 0.0;
                    for j in 0..POINTS {
                        for i in 0..across {
                            let a = (column as f64 + (i as f64 + 0.5) / across as f64 - 0.5 * w) * p;
                            let b = (row as f64 + (j as f64 + 0.5) / POINTS as f64 - 0.5 * h) * p;
                            let from = along_columns * a + self.tilt_axis * b;
                            // down the head's line of sight onto the surface
                            let n = stand.axes[2];
                            let at = from - to_head * (from.dot(n) / to_head.dot(n));
                            let place = stand.sample_from_lab(at);
                            sum += seen.at([place.x + origin[0], place.y + origin[1]])[channel];
                        }
                    }
                    sum / (POINTS * across) as f64
                }
            };
            *rate = (self.scale_e_per_s * (f + gloss) * light.z) as f32;
        }
    }

    /// The gloss of a smooth coat, 1/sr: F/(Ω cos θi) inside the lamp's mirror image.
    fn gloss(&self, sample: &Sample, light: Vec3, view: Vec3) -> f64 {
        let Some(index) = sample.gloss_index else { return 0.0 };
        let mirror = Vec3::new(-light.x, -light.y, light.z);
        let chord = 2.0 * (0.5 * self.lamp.half_angle_rad).sin();
        if (view - mirror).norm() > chord {
            return 0.0;
        }
        fresnel::dielectric(light.z, index) / (self.lamp.omega_sr * light.z)
    }
}
