//! What cells look like by the flakes that they show: a flake map fitted to all measured cells, averaged like them over T(θi) T(θo)/n².

use gonio_brdf::maps::{FitError, FlakeFitOptions, FlakeMap, Region, Sample};
use gonio_brdf::models::Coat;
use gonio_brdf::{Brdf, Flag, Measured};
use gonio_optics::Angle;

use super::Filling;
use super::continuation::FORGET_DEG;
use crate::coat::separate::transmission;

/// Share of the mean below which the map says nothing that could be divided by.
const FLOOR: f64 = 1e-3;

/// The map at every cell.
pub(super) struct Shape {
    values: Vec<[f32; 3]>,
    /// Root mean square of map / measured − 1, per channel.
    error: [f64; 3],
}

impl Shape {
    /// The shape of the measured cells, seen through `coat`.
    pub(super) fn of(m: &Measured, coat: Option<&Coat>) -> Result<Self, FitError> {
        let grid = &m.grid;
        let through = |ti, to| coat.map_or(1.0, |c| transmission(grid, c, ti, to));
        let mut samples = Vec::new();
        for at in (0..grid.len()).filter(|&i| m.flag[i] == Flag::Measured) {
            let [ti, to, phi] = grid.coordinates(at);
            let both = through(ti, to);
            if both <= 0.0 {
                continue;
            }
            let geometry = grid.geometry(ti, to, phi);
            let (light, view) = geometry.directions();
            let ring = geometry.theta_i.sin().max(Angle::from_degrees(0.5).sin());
            samples.push(Sample {
                light,
                view,
                value: m.values[at].map(|f| f64::from(f) / both),
                sigma: m.sigma[at].map(|s| f64::from(s) / both),
                weight: grid.solid_angle(to, phi) * ring,
            });
        }
        let options = FlakeFitOptions {
            index: coat.map_or(1.0, |c| c.index),
            harmonics: 1,
            own_error: 0.01,
            region: Region { largest: Angle::RIGHT, from_mirror: Angle::ZERO },
            ..FlakeFitOptions::default()
        };
        let map = FlakeMap::fit("what was measured", &samples, &options)?;
        let n = samples.len() as f64;
        let floor: [f64; 3] =
            std::array::from_fn(|c| FLOOR * (samples.iter().map(|s| s.value[c]).sum::<f64>() / n).max(1e-9));
        let values = (0..grid.len())
            .map(|i| {
                let [ti, to, phi] = grid.coordinates(i);
                let (l, v) = grid.geometry(ti, to, phi).directions();
                let (f, both) = (map.eval(l, v), through(ti, to));
                std::array::from_fn(|c| (f[c].max(floor[c]) * both.max(1e-9)) as f32)
            })
            .collect();
        Ok(Self { values, error: relative_error(&map, &samples) })
    }

    /// σ of what was made up gains the map's own error, more of it the farther beyond the limit.
    pub(super) fn add_own_error(&self, m: &mut Measured, limit_deg: f64, how: Filling) {
        for i in 0..m.flag.len() {
            let cell = m.grid.coordinates(i);
            let beyond = m.grid.theta_o_deg[cell[1]] - limit_deg;
            let growth = match m.flag[i] {
                Flag::Filled if how.method(&m.grid, cell, limit_deg).flake_space => 1.0,
                Flag::Extrapolated if how.rim.flake_space => 1.0 + beyond.max(0.0) / FORGET_DEG,
                _ => continue,
            };
            for c in 0..3 {
                let own = f64::from(m.values[i][c]) * self.error[c] * growth;
                m.sigma[i][c] = f64::from(m.sigma[i][c]).hypot(own) as f32;
            }
        }
    }
}

/// Does `work` on the ratio of the table to a shape, then multiplies what it made by the shape. Cells that were known keep their bits.
pub(super) fn relative_to(m: &mut Measured, shape: Option<&Shape>, work: impl FnOnce(&mut Measured)) {
    let Some(shape) = shape else { return work(m) };
    let before = (m.values.clone(), m.sigma.clone(), m.flag.clone());
    for ((v, s), by) in m.values.iter_mut().zip(&mut m.sigma).zip(&shape.values) {
        for c in 0..3 {
            v[c] /= by[c];
            s[c] /= by[c];
        }
    }
    work(m);
    for i in 0..m.flag.len() {
        if before.2[i] != Flag::Invalid {
            (m.values[i], m.sigma[i]) = (before.0[i], before.1[i]);
            continue;
        }
        for c in 0..3 {
            m.values[i][c] *= shape.values[i][c];
            m.sigma[i][c] *= shape.values[i][c];
        }
    }
}

/// Root mean square of map / sample − 1, per channel, solid angle weighted.
fn relative_error(map: &FlakeMap, samples: &[Sample]) -> [f64; 3] {
    let (mut sum, mut weights) = ([0.0; 3], [0.0; 3]);
    for s in samples {
        let f = map.eval(s.light, s.view);
        for c in 0..3 {
            if s.value[c] > 0.0 {
                sum[c] += s.weight * (f[c] / s.value[c] - 1.0).powi(2).min(1.0);
                weights[c] += s.weight;
            }
        }
    }
    [0, 1, 2].map(|c| if weights[c] > 0.0 { (sum[c] / weights[c]).sqrt() } else { 0.0 })
}
