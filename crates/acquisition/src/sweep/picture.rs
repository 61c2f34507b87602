//! The plain way, for pictures that something was done to as a whole before they become cells.

use rayon::prelude::*;

use super::{Sweep, Swept};
use crate::cells::{PixelValue, sum};
use crate::merge::MergedPose;
use crate::weights::Weights;

impl Sweep {
    /// The sums of a merged picture, list by list; `relative` are the variances that the white reference's pixels bring. What does not see the sample
    /// counts for nothing, whatever is in the picture there.
    pub(crate) fn picture(&self, merged: &MergedPose, weights: &Weights, relative: &[f32]) -> Swept {
        let value = |p: usize| match self.visible[p] {
            true => PixelValue::of(&merged.pixels[p], self.per_rate[p], relative[p]),
            false => PixelValue::UNKNOWN,
        };
        let sums = (0..weights.bins() * 3)
            .into_par_iter()
            .map(|list| sum(weights, &value, list / 3, list % 3))
            .collect();
        let mut window = self.window.clone();
        for y in window.rows() {
            for x in window.columns() {
                let p = y * self.width + x;
                window.set(p, value(p));
            }
        }
        let lost = (0..self.visible.len())
            .filter(|&p| self.visible[p] && merged.pixels[p].rate == f32::INFINITY)
            .count();
        Swept {
            sums,
            window,
            exposures: merged.exposures,
            saturated_share: lost as f64 / self.lit.max(1) as f64,
            lamp_relative: merged.lamp_relative,
        }
    }
}
