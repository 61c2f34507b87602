//! From raw frames to the sums of the cells in one pass.
//!
//! The sensor is swept in bands of rows. A row is merged ([`crate::merge::lanes`]) into a few kilobytes that stay in the innermost cache, and
//! spread at once over the cells that it touches: for each bin that a row crosses there is a *run*, a stretch of neighbouring pixels with their
//! weights, so that the sums are dot products. Colours alternate along a row, so even lanes are one colour's and odd lanes the other's.
//! No picture of merged values is ever written; what a gloss must be looked for in is kept as a window.
//!
//! A weight in a run is the pixel's weight in the bin times what one electron per second there means in 1/sr: built once for all poses of a tilt.
//! What is rare (hot pixels, pixels that every exposure saturates) is put right afterwards, pixel by pixel.

mod band;
mod build;
mod picture;
mod window;

use gonio_instrument::PoseRecord;
use rayon::prelude::*;

use crate::cells::{PixelValue, Sum};
use crate::coat::gloss::Reached;
use crate::dark::DarkModel;
use crate::error::AcquisitionError;
use crate::merge::lanes::BLOCK;
use crate::merge::shots::Shots;
use crate::merge::{Merged, check_frames, mend, wide};
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

use band::{Band, Taken};
pub(crate) use window::Window;

/// Lanes of a run's sums.
const LANES: usize = 8;
/// Rows of a band. Fixed: sums are put together band by band, on any number of threads in the same order.
const BAND: usize = 64;

/// What the poses of a tilt have in common: runs with their weights.
#[derive(Clone, Debug)]
pub struct Sweep {
    width: usize,
    height: usize,
    bands: Vec<Band>,
    /// Per (bin, channel), as [`crate::weights::Weights::list`] counts: what the weights alone say.
    known: Vec<Known>,
    /// f in 1/sr per electron per second; 0 where the white reference says nothing.
    per_rate: Vec<f32>,
    /// Where a gloss is looked for.
    pub(crate) reached: Reached,
    /// Cells that it may hide something of.
    pub(crate) reached_cells: Vec<usize>,
    /// The pixels of both, empty.
    window: Window,
    visible: Vec<bool>,
    lit: usize,
    /// Channel of a pixel by (row parity, column parity).
    channels: [[usize; 2]; 2],
}

/// Sums of weights of a list.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    all: f64,
    valid: f64,
    w: f64,
}

/// A pose swept.
#[derive(Clone, Debug)]
pub struct Swept {
    /// Per (bin, channel).
    pub(crate) sums: Vec<Sum>,
    /// Pixels about the mirror direction.
    pub(crate) window: Window,
    /// Exposures used (shutter open).
    pub exposures: u32,
    /// Share of the visible pixels that no exposure shows unsaturated.
    pub saturated_share: f64,
    /// Relative standard uncertainty of the lamp's mean, from the spread of its monitor over the pose.
    pub lamp_relative: f64,
}

impl Swept {
    /// Mean of f over a bin in one channel, and the variances of its parts (shot, read, dark, white reference pixels); `None` where no pixel
    /// tells it.
    #[must_use]
    pub fn mean(&self, bin: usize, channel: usize) -> Option<(f64, [f64; 4])> {
        let s = self.sums.get(bin * 3 + channel).filter(|s| s.w > 0.0)?;
        Some((s.value / s.w, [s.shot, s.read, s.dark, s.reference].map(|v| v / (s.w * s.w))))
    }
}

impl Sweep {
    /// Number of (pixel, cell) weights, those that fill lanes up included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bands.iter().map(|b| b.weights.len() * LANES).sum()
    }

    /// Whether no pixel is in any cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bands.iter().all(|b| b.weights.is_empty())
    }

    /// Share of the sensor that sees the sample at this tilt.
    #[must_use]
    pub fn visible_share(&self) -> f64 {
        self.lit as f64 / self.visible.len().max(1) as f64
    }

    /// Share of the sensor that is merged: blocks of pixels of which one sees the sample.
    #[must_use]
    pub fn merged_share(&self) -> f64 {
        let blocks: usize = self.bands.iter().flat_map(|b| &b.blocks).map(Vec::len).sum();
        (blocks * BLOCK) as f64 / self.visible.len().max(1) as f64
    }

    /// Sweeps a pose.
    ///
    /// # Errors
    /// [`AcquisitionError`] for frames of the wrong size and for a pose without light.
    pub fn pose(
        &self,
        record: &PoseRecord,
        map: &PixelMap,
        sensor: &Sensor,
        dark: &DarkModel,
    ) -> Result<Swept, AcquisitionError> {
        check_frames(record, map)?;
        let shots = Shots::of(record, self.width, sensor, dark)?;
        let taken: Vec<Taken> =
            self.bands.par_iter().map(|band| wide::run(band.task(self, &shots))).collect();
        let mut sums: Vec<Sum> =
            self.known.iter().map(|k| Sum { w: k.w, all: k.all, valid: k.valid, ..Sum::default() }).collect();
        let mut window = self.window.clone();
        let mut lost = 0;
        for (band, taken) in self.bands.iter().zip(&taken) {
            for (slot, parts) in band.slots.iter().zip(&taken.sums) {
                for (column, p) in parts.iter().enumerate() {
                    let s =
                        &mut sums[slot.bin as usize * 3 + self.channels[slot.row_parity as usize][column]];
                    s.value += p[0];
                    s.shot += p[1];
                    s.read += p[2];
                    s.dark += p[3];
                    s.reference += p[4];
                }
            }
            for &(p, value) in &taken.window {
                window.set(p as usize, value);
            }
            lost += taken.lost.len();
        }
        let beside: Vec<(u32, Merged)> = taken.iter().flat_map(|t| t.beside.iter().copied()).collect();
        for (band, taken) in self.bands.iter().zip(&taken) {
            for &p in &taken.lost {
                self.take_out(band, p as usize, &mut sums, true);
                window.set(p as usize, PixelValue { f: f32::INFINITY, ..PixelValue::UNKNOWN });
            }
            self.mend(band, &taken.hot, &beside, &mut sums, &mut window);
        }
        Ok(Swept {
            sums,
            window,
            exposures: shots.len() as u32,
            saturated_share: lost as f64 / self.lit.max(1) as f64,
            lamp_relative: shots.lamp_relative,
        })
    }

    /// Hot pixels take the value of their neighbours, of which `beside` knows those that say something.
    fn mend(
        &self,
        band: &Band,
        hot: &[u32],
        beside: &[(u32, Merged)],
        sums: &mut [Sum],
        window: &mut Window,
    ) {
        let mut at = |q: usize| match beside.binary_search_by_key(&q, |e| e.0 as usize) {
            Ok(k) => beside[k].1,
            Err(_) => Merged::INVALID,
        };
        for &p in hot {
            let p = p as usize;
            match mend::from_neighbours(p, self.width, self.height, &mut at) {
                Some(m) => {
                    band.each(self.width, p, &mut |bin, weight, relative| {
                        let s = &mut sums[bin * 3 + self.channel(p)];
                        let (t, w2) = (f64::from(weight * m.rate), f64::from(weight).powi(2));
                        s.value += t;
                        s.shot += w2 * f64::from(m.shot);
                        s.read += w2 * f64::from(m.read);
                        s.dark += w2 * f64::from(m.dark);
                        s.reference += t * t * f64::from(relative);
                    });
                    window.set(p, window.value(p, self.per_rate[p], &m));
                }
                None => {
                    self.take_out(band, p, sums, false);
                    window.set(p, PixelValue::UNKNOWN);
                }
            }
        }
    }

    fn channel(&self, p: usize) -> usize {
        self.channels[p / self.width % 2][p % self.width % 2]
    }

    /// A pixel that says nothing counts in no list; one that saturates makes its cells unknown.
    fn take_out(&self, band: &Band, p: usize, sums: &mut [Sum], saturated: bool) {
        let one = f64::from(self.per_rate[p]);
        band.each(self.width, p, &mut |bin, weight, _| {
            let s = &mut sums[bin * 3 + self.channel(p)];
            let w = f64::from(weight) / one;
            s.valid -= w.abs();
            s.w -= w;
            s.saturated |= saturated;
        });
    }
}

#[cfg(test)]
mod tests;
