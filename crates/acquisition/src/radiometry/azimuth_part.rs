//! The corrections of a table over four angles: what a table over three gets, cell by cell.
//!
//! Glare, tails and haze are off the pictures already. Left are what the camera's face gave back, the part of σ that stray light leaves, and the colour matrix.
//! Such a table keeps σ whole, without parts.

use gonio_brdf::{Anisotropic, Flag, Rgb};

use super::face_azimuths::TakenOff;
use super::table_part::Returned;
use super::{chart, face_azimuths};
use crate::pixel_map::PixelMap;

/// What a table is corrected by.
#[derive(Clone, Debug)]
pub struct Corrections<'a> {
    /// What each row errs by in f for glare, tails and haze.
    pub rows: &'a [Rgb],
    /// Relative uncertainty that the white reference keeps of them.
    pub white: f64,
    /// What the white reference looks brighter by for its own light, over κ.
    pub own_light: f64,
}

/// Corrects a table with what the calibration in `map` knows; nothing without one.
pub fn correct(t: &mut Anisotropic, map: &PixelMap, c: &Corrections<'_>) {
    let Some(radiometry) = &map.description().radiometry else { return };
    if let Some(stray) = &radiometry.stray {
        let returned = stray.face.map(|kappa| {
            let TakenOff { taken, unseen } = face_azimuths::take_off(t, map, kappa.value);
            (Returned { taken, kappa, white: c.own_light }, unseen)
        });
        for at in (0..t.values.len()).filter(|&at| t.flag[at] != Flag::Invalid) {
            let (pi, ti) = (at / t.grid.len(), t.grid.coordinates(at % t.grid.len())[0]);
            for k in 0..3 {
                let f = f64::from(t.values[at][k]);
                let face = returned.as_ref().map_or(0.0, |(r, unseen)| {
                    r.sigma(f, r.taken[at][k]).hypot(unseen[pi][ti] * r.taken[at][k])
                });
                let own = f64::from(t.sigma[at][k]);
                t.sigma[at][k] = own.hypot(c.rows[ti][k]).hypot(face).hypot(c.white * f) as f32;
            }
        }
    }
    if let Some(colour) = &radiometry.colour {
        chart::take_cells_through(&mut t.values, &mut t.sigma, &colour.matrix);
    }
}
