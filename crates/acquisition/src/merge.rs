//! One rate per pixel out of all exposures of a pose, with its variance in parts.
//!
//! Per frame j with exposure t_j and lamp monitor m_j: signal `s_j = electrons − dark(t_j)`, `x_j = t_j m_j`. The rate is
//! `Σ w_j s_j / Σ w_j x_j` with `w_j = x_j / (λ x_j + d t_j + σ²)`, the inverse *expected* variance of s_j/x_j per unit of x_j.
//! Where shot noise rules that is the Poisson maximum likelihood `Σ s / Σ x`, which has no bias; weights from each frame's
//! own noisy counts would favour those that came out low. λ is the mean of the pixels of the same colour nearby ([`lanes`]).
//!
//! Whether a pixel is saturated in a frame is decided from its eight neighbours of the same colour, not from its own
//! value: dropping the frames in which its own noise was high would pull the rest down.

mod classes;
pub(crate) mod lanes;
pub(crate) mod mend;
mod plan;
pub(crate) mod shots;
pub(crate) mod wide;

use gonio_instrument::PoseRecord;
use rayon::prelude::*;

use crate::dark::DarkModel;
use crate::error::AcquisitionError;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;
use lanes::{BLOCK, Row};
use shots::Shots;
use wide::{Task, Wide};

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
    let w = map.width();
    let shots = Shots::of(record, w, sensor, dark)?;
    let mut pixels = vec![Merged::INVALID; w * map.height()];
    pixels.par_chunks_mut(w).enumerate().for_each_init(
        || Row::of(w),
        |row, (y, out)| {
            let wanted = &wanted[y * w..(y + 1) * w];
            let blocks = blocks_of(wanted);
            if !blocks.is_empty() {
                wide::run(OneRow { row, shots: &shots, y, blocks: &blocks });
                for (x, out) in
                    out.iter_mut().enumerate().filter(|(x, _)| wanted[*x] && !dark.is_hot(y * w + x))
                {
                    *out = row.pixel(x);
                }
            }
        },
    );
    let lit = wanted.iter().filter(|v| **v).count().max(1);
    let lost = (0..pixels.len()).filter(|&p| wanted[p] && !dark.is_hot(p) && !pixels[p].is_valid()).count();
    let hot = (0..pixels.len()).filter(|&p| wanted[p] && dark.is_hot(p));
    let mended: Vec<(usize, Merged)> = hot
        .filter_map(|p| Some((p, mend::from_neighbours(p, w, map.height(), &mut |q| pixels[q])?)))
        .collect();
    for (p, m) in mended {
        pixels[p] = m;
    }
    Ok(MergedPose {
        pixels,
        exposures: shots.len() as u32,
        saturated_share: lost as f64 / lit as f64,
        lamp_relative: shots.lamp_relative,
    })
}

/// The blocks of a row that hold a wanted pixel.
pub(crate) fn blocks_of(wanted: &[bool]) -> Vec<u32> {
    (0u32..).zip(wanted.chunks(BLOCK)).filter(|(_, block)| block.contains(&true)).map(|(b, _)| b).collect()
}

/// A row merged with the widest vectors that the machine has.
struct OneRow<'a, 'b> {
    row: &'a mut Row,
    shots: &'a Shots<'b>,
    y: usize,
    blocks: &'a [u32],
}

impl Task for OneRow<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self, wide: W) {
        self.row.merge(wide, self.shots, self.y, self.blocks);
    }
}

impl Row {
    /// A pixel of the row.
    pub(crate) fn pixel(&self, x: usize) -> Merged {
        if self.rate[x] == f32::INFINITY {
            return Merged::SATURATED;
        }
        Merged {
            rate: self.rate[x],
            shot: self.shot[x],
            read: self.read[x],
            dark: self.dark[x],
            exposure: self.exposure[x],
        }
    }
}

#[cfg(test)]
mod tests;
