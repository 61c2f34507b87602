//! Merged pictures of a white session, pose by pose, for whoever looks for edges in them.

use std::sync::Arc;

use gonio_instrument::PoseRecord;

use crate::dark::{DarkFrames, DarkModel};
use crate::error::AcquisitionError;
use crate::merge::{MergedPose, check_frames, merge};
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

/// Merges the poses of one session; dark frames serve from where they stand.
pub struct Merger {
    map: Arc<PixelMap>,
    sensor: Sensor,
    dark_frames: DarkFrames,
    dark: DarkModel,
}

impl Merger {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(map: Arc<PixelMap>, options: &Options) -> Self {
        let sensor = Sensor::of(map.description(), options);
        let dark = DarkFrames::default().model(&sensor, map.width() * map.height());
        Self { map, sensor, dark_frames: DarkFrames::default(), dark }
    }

    /// The merged pose and the channels' relative sensitivities (green 1) in it; `None` for a pose of dark frames alone.
    ///
    /// # Errors
    /// [`AcquisitionError`] for frames of the wrong size.
    pub fn add(
        &mut self,
        record: &PoseRecord,
        wanted: &[bool],
    ) -> Result<Option<(MergedPose, [f64; 3])>, AcquisitionError> {
        check_frames(record, &self.map)?;
        if let Some(dark) = self.dark_frames.take(record, &self.sensor) {
            self.dark = dark;
        }
        if record.exposures.iter().all(|e| !e.shutter_open) {
            return Ok(None);
        }
        let merged = merge(record, &self.map, &self.sensor, &self.dark, wanted)?;
        let gains = self.gains(&merged);
        Ok(Some((merged, gains)))
    }

    /// Mean ratio of red and blue pixels to the green beside them, over what is bright.
    fn gains(&self, merged: &MergedPose) -> [f64; 3] {
        let (w, h) = (self.map.width(), self.map.height());
        let (mut sums, mut greens) = ([0.0; 3], [0.0; 3]);
        let rate = |p: usize| f64::from(merged.pixels[p].rate);
        for y in 1..h.saturating_sub(1) {
            for x in 1..w.saturating_sub(1) {
                let p = y * w + x;
                let channel = self.map.channel(p);
                let beside = [p - 1, p + 1, p - w, p + w];
                if channel == 1 || !rate(p).is_finite() || beside.iter().any(|&q| !rate(q).is_finite()) {
                    continue;
                }
                sums[channel] += rate(p);
                greens[channel] += 0.25 * beside.iter().map(|&q| rate(q)).sum::<f64>();
            }
        }
        [0, 1, 2].map(
            |c: usize| if c == 1 || greens[c] <= 0.0 || sums[c] <= 0.0 { 1.0 } else { sums[c] / greens[c] },
        )
    }
}
