//! Flake textures brought to the level of the measurement.
//!
//! A texture shows a few hundred flakes on a fraction of a square millimetre, and at a given pair of angles a few dozen of them flash: its mean is uncertain by
//! their number, far more than that of the BRDF, which is measured over a spot of millimetres and several spins. Taken off as it is, it leaves a base that is
//! the noise of the textures. So each slice, flakes and the floor between them alike, gets a factor per channel ([`super::relative`]) that brings its mean to the
//! BRDF; the contrast of the sparkle, relative to its mean, stays.

use std::sync::Arc;

use gonio_brdf::{Coat, Rgb};

use super::relative::{self, Hold, corners};
use super::subject::Data;
use crate::FlakeBtf;
use crate::car_paint::{CarPaint, CarPaintError, CarPaintParts, FlakeSlices};

/// A factor beyond means that textures and BRDF are not of one paint.
const HOLD: Hold = Hold { stiffness: 1e-3, pull: 5e-2, bounds: [0.1, 10.0] };

/// Factors by which the means of slices were changed, over slices that lie within the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlakeLevel {
    /// Below it lie 5 % of the factors.
    pub p5: f64,
    /// Half of them.
    pub median: f64,
    /// Above it lie 5 %.
    pub p95: f64,
}

/// The flakes at the level of the measurement, which is given as it is and less the gloss of its coat; `floors` are what lies between them, in order of the slices, 1/sr.
pub(super) fn bring(
    [whole, below_gloss]: [&Data; 2],
    slices: &FlakeSlices,
    floors: &[Rgb],
    coat: Option<Coat>,
) -> Result<(FlakeSlices, FlakeLevel), CarPaintError> {
    let btf = slices.btf();
    let (half, incidence) = (slices.half(), slices.incidence());
    let n = half.len() * incidence.len();
    if floors.len() != n {
        return Err(CarPaintError::Count {
            what: "floors of flake slices",
            found: floors.len(),
            expected: n,
        });
    }
    let textures: Vec<Rgb> =
        slices.means().iter().zip(floors).map(|(m, f)| [0, 1, 2].map(|c| m[c] + f[c])).collect();
    let only_coat = CarPaint::new(CarPaintParts { coat, ..CarPaintParts::default() })?;
    let mut touched = vec![0.0; n];
    let mut rows = Vec::new();
    for (place, geometry, value) in below_gloss.valid() {
        let (l, v) = geometry.directions();
        let Some(at) = only_coat.inside(l, v) else { continue };
        let around = corners(half, incidence, at.place);
        for (k, share) in around {
            touched[k as usize] += share;
        }
        let entries = around.map(|(k, share)| (k, textures[k as usize].map(|m| share * at.factor * m)));
        let seen = whole.at(place).iter().sum::<f64>() / 3.0;
        rows.push(relative::Row { entries, value, seen, weight: whole.weight(place) });
    }
    let factors = relative::factors(&rows, [half.len(), incidence.len()], HOLD);
    let size = btf.size();
    let texels = btf
        .slices()
        .zip(&factors)
        .flat_map(|(texels, f)| texels.iter().map(|t| [0, 1, 2].map(|c| (f64::from(t[c]) * f[c]) as f32)))
        .collect();
    let scaled = FlakeBtf::new(btf.half().to_vec(), btf.incidence().to_vec(), size, texels)?;
    let mut told: Vec<f64> =
        factors.iter().zip(&touched).filter(|(_, t)| **t > 1e-3).flat_map(|(f, _)| *f).collect();
    told.sort_by(f64::total_cmp);
    let at = |q: f64| told.get((q * (told.len().max(1) - 1) as f64).round() as usize).copied().unwrap_or(1.0);
    let level = FlakeLevel { p5: at(0.05), median: at(0.5), p95: at(0.95) };
    Ok((FlakeSlices::new(Arc::new(scaled), slices.texel_mm())?, level))
}
