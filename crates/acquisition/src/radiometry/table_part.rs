//! The part of a table's σ that stray light leaves: what glare, tail and haze are uncertain by, and the camera's own face.
//!
//! Glare and haze err alike over a row; of the tail the usual pixel's share is counted, so that close to a gloss the part is too small.

use gonio_brdf::{Flag, Measured, Rgb};
use gonio_instrument::radiometry::Known;

use crate::pixel_map::PixelMap;

/// Name of the part.
pub const STRAY: &str = "stray";

/// f per electron and second of a usual pixel, colour by colour: the median of 1/(k E0 g) over the pixels seen, over cos θi.
#[must_use]
pub fn per_rate(scale: &[f32], visible: &[bool], map: &PixelMap, mean_cos_i: f64) -> [f64; 3] {
    let mut of: [Vec<f32>; 3] = Default::default();
    for p in (0..scale.len()).step_by(5).filter(|&p| visible[p] && scale[p] > 0.0) {
        of[map.channel(p)].push(scale[p]);
    }
    of.map(|mut v| {
        v.sort_unstable_by(f32::total_cmp);
        v.get(v.len() / 2).map_or(0.0, |k| 1.0 / (f64::from(*k) * mean_cos_i))
    })
}

/// What the camera's face gave back, and what its κ is uncertain by.
#[derive(Clone, Debug)]
pub struct Returned {
    /// What was taken off each cell, in the table's order.
    pub taken: Vec<Rgb>,
    /// κ.
    pub kappa: Known,
    /// How much brighter the white reference looks for its own light, over κ: it errs by the same κ, so that only what a sample differs by is uncertain.
    pub white: f64,
}

impl Returned {
    /// Standard uncertainty that κ brings to a value f of which so much was taken off.
    #[must_use]
    pub fn sigma(&self, f: f64, taken: f64) -> f64 {
        let own = if self.kappa.value.abs() > 1e-12 { taken / self.kappa.value } else { 0.0 };
        self.kappa.sigma * (self.white * f - own).abs()
    }
}

/// Adds the part to σ. `rows` holds what each row errs by in f, `white` is the relative uncertainty that the white reference keeps of glare, tails and haze.
pub fn add(m: &mut Measured, rows: &[Rgb], returned: Option<&Returned>, white: f64) {
    let mut part = vec![[0.0f32; 3]; m.flag.len()];
    for (i, part) in part.iter_mut().enumerate() {
        if m.flag[i] == Flag::Invalid {
            continue;
        }
        let [ti, _, _] = m.grid.coordinates(i);
        for (c, part) in part.iter_mut().enumerate() {
            let f = f64::from(m.values[i][c]);
            let face = returned.map_or(0.0, |r| r.sigma(f, r.taken[i][c]));
            let sigma = rows[ti][c].hypot(face).hypot(white * f);
            *part = sigma as f32;
            m.sigma[i][c] = f64::from(m.sigma[i][c]).hypot(sigma) as f32;
        }
    }
    if part.iter().flatten().any(|v| *v > 0.0) {
        m.sigma_parts.insert(STRAY.to_owned(), part);
    }
}
