//! How far a renderer's material is from the model: CIEDE2000 on Sopp's grid up to 75°.

use gonio_optics::colour::{ciede2000, lab_from_brdf};
use serde::Serialize;

use crate::{Brdf, Grid};

/// Largest polar angle compared: beyond, instruments hardly measure and fits are extrapolations.
const LIMIT_DEG: f64 = 75.0;
/// Degrees from the mirror direction that split the geometries.
const SPLIT_DEG: f64 = 15.0;

/// Mean, 95th percentile and largest of a set of colour differences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// 95th percentile (nearest rank).
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// CIEDE2000 between model and material over Sopp's grid, θi and θo up to 75°.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Loss {
    /// Up to 15° from the mirror direction.
    pub within_15_deg: Spread,
    /// Farther than that.
    pub beyond_15_deg: Spread,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let rank = (0.95 * values.len() as f64).ceil() as usize;
        let count = values.len().max(1) as f64;
        Self {
            mean: values.iter().sum::<f64>() / count,
            p95: values.get(rank.max(1) - 1).copied().unwrap_or(0.0),
            max: values.last().copied().unwrap_or(0.0),
        }
    }
}

impl Loss {
    /// Between two BRDFs.
    #[must_use]
    pub fn between(model: &dyn Brdf, material: &dyn Brdf) -> Self {
        let grid = Grid::sopp();
        let (mut within, mut beyond) = (Vec::new(), Vec::new());
        for place in 0..grid.len() {
            let [ti, to, phi] = grid.coordinates(place);
            let g = grid.geometry(ti, to, phi);
            if g.theta_i.degrees() > LIMIT_DEG || g.theta_o.degrees() > LIMIT_DEG {
                continue;
            }
            let (l, v) = g.directions();
            let d = ciede2000(lab_from_brdf(model.eval(l, v)), lab_from_brdf(material.eval(l, v)));
            if g.from_mirror().degrees() <= SPLIT_DEG { &mut within } else { &mut beyond }.push(d);
        }
        Self { within_15_deg: Spread::of(within), beyond_15_deg: Spread::of(beyond) }
    }
}

/// Mean difference on some of the grid, geometries within and beyond 15° counting alike: for choosing between materials.
pub(super) fn on_some(model: &dyn Brdf, material: &dyn Brdf) -> f64 {
    let grid = Grid::sopp();
    let mut sums = [(0.0, 0.0); 2];
    // a step that shares no factor with 36 azimuths and 37 angles
    for place in (0..grid.len()).step_by(23) {
        let [ti, to, phi] = grid.coordinates(place);
        let g = grid.geometry(ti, to, phi);
        if g.theta_i.degrees() > LIMIT_DEG || g.theta_o.degrees() > LIMIT_DEG {
            continue;
        }
        let (l, v) = g.directions();
        let side = &mut sums[usize::from(g.from_mirror().degrees() > SPLIT_DEG)];
        side.0 += ciede2000(lab_from_brdf(model.eval(l, v)), lab_from_brdf(material.eval(l, v)));
        side.1 += 1.0;
    }
    sums.iter().map(|(sum, count)| sum / f64::max(*count, 1.0)).sum()
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let one = |s: &Spread| format!("{:.2} / {:.2} / {:.2}", s.mean, s.p95, s.max);
        write!(
            f,
            "CIEDE2000 against the model (mean / 95 % / max, angles up to 75 degrees): {} beyond 15 degrees of the mirror direction, {} within",
            one(&self.beyond_15_deg),
            one(&self.within_15_deg)
        )
    }
}
