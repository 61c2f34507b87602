//! Holes and grazing angles under a coat, filled in flake space.
//!
//! A coat of n = 1.5 bends 75°…90° outside into 40.1°…41.8°: what lies past the limit is beside what was measured, and many other
//! geometries stand for the same flakes. A flake map (K = 1) fitted to all measured cells of the base gives the shape; where cells
//! of the same row and azimuth were measured, their ratio to the map carries over and fades, so there is no jump.

use gonio_brdf::maps::{FitError, FlakeFitOptions, FlakeMap, Region, Sample};
use gonio_brdf::models::Coat;
use gonio_brdf::{Brdf, Flag, Measured};
use gonio_optics::Angle;

use super::separate::transmission;

/// Length over which a neighbour's ratio to the map is forgotten, degrees outside the coat.
const FORGET_DEG: f64 = 10.0;
/// The map's ratio to what stands beside it may not exceed this either way.
const LARGEST_RATIO: f64 = 2.0;

/// Fills `through`, the base seen through the coat: [`Flag::Filled`] up to `limit_deg` in θo and within the rows measured, [`Flag::Extrapolated`] beyond.
///
/// # Errors
/// [`FitError`] where the measured cells do not make a map; nothing is filled then.
pub fn fill(through: &mut Measured, coat: &Coat, limit_deg: f64) -> Result<(), FitError> {
    let grid = through.grid.clone();
    let [ni, no, np] = grid.shape();
    let mut samples = Vec::new();
    for ti in 0..ni {
        for to in 0..no {
            let both = transmission(&grid, coat, ti, to);
            for phi in 0..np {
                let at = grid.index(ti, to, phi);
                if through.flag[at] != Flag::Measured || both <= 0.0 {
                    continue;
                }
                let geometry = grid.geometry(ti, to, phi);
                let (light, view) = geometry.directions();
                let ring = geometry.theta_i.sin().max(Angle::from_degrees(0.5).sin());
                samples.push(Sample {
                    light,
                    view,
                    value: through.values[at].map(|f| f64::from(f) / both),
                    sigma: through.sigma[at].map(|s| f64::from(s) / both),
                    weight: grid.solid_angle(to, phi) * ring,
                });
            }
        }
    }
    let options = FlakeFitOptions {
        index: coat.index,
        harmonics: 1,
        own_error: 0.01,
        region: Region { largest: Angle::RIGHT, from_mirror: Angle::ZERO },
        ..FlakeFitOptions::default()
    };
    let map = FlakeMap::fit("base under a coat", &samples, &options)?;
    let error = relative_error(&map, &samples);
    let shape: Vec<[f64; 3]> = (0..grid.len())
        .map(|i| {
            let [ti, to, phi] = grid.coordinates(i);
            let (l, v) = grid.geometry(ti, to, phi).directions();
            let both = transmission(&grid, coat, ti, to);
            map.eval(l, v).map(|f| f * both)
        })
        .collect();
    let known: Vec<bool> = through.flag.iter().map(|f| *f != Flag::Invalid).collect();
    let rows: Vec<usize> =
        (0..ni).filter(|&t| (0..no * np).any(|k| known[grid.index(t, 0, 0) + k])).collect();
    for i in (0..grid.len()).filter(|&i| !known[i]) {
        let [ti, to, phi] = grid.coordinates(i);
        // the nearest known cells along θo, along φ and along θi, with their distances in degrees
        let mut beside: Vec<(usize, f64)> = Vec::new();
        let mut look = |step: &dyn Fn(usize) -> Option<(usize, f64)>| {
            beside.extend((1..).map_while(step).find(|(k, _)| known[*k]));
        };
        let d = |nodes: &[f64], a: usize, b: usize| (nodes[a] - nodes[b]).abs();
        let sine = Angle::from_degrees(grid.theta_o_deg[to]).sin();
        look(&|s| {
            let o = to.checked_sub(s)?;
            Some((grid.index(ti, o, phi), d(&grid.theta_o_deg, o, to)))
        });
        look(&|s| {
            let o = Some(to + s).filter(|o| *o < no)?;
            Some((grid.index(ti, o, phi), d(&grid.theta_o_deg, o, to)))
        });
        look(&|s| {
            let p = phi.checked_sub(s)?;
            Some((grid.index(ti, to, p), sine * d(&grid.phi_deg, p, phi)))
        });
        look(&|s| {
            let p = Some(phi + s).filter(|p| *p < np)?;
            Some((grid.index(ti, to, p), sine * d(&grid.phi_deg, p, phi)))
        });
        look(&|s| {
            let t = ti.checked_sub(s)?;
            Some((grid.index(t, to, phi), d(&grid.theta_i_deg, t, ti)))
        });
        look(&|s| {
            let t = Some(ti + s).filter(|t| *t < ni)?;
            Some((grid.index(t, to, phi), d(&grid.theta_i_deg, t, ti)))
        });
        let nearest = beside.iter().map(|b| b.1).fold(f64::INFINITY, f64::min);
        for c in 0..3 {
            let (mut sum, mut weights) = (0.0, 0.0);
            for &(k, far) in &beside {
                let (have, says) = (f64::from(through.values[k][c]), shape[k][c]);
                if have > 0.0 && says > 0.0 {
                    let w = 1.0 / (far * far);
                    sum += w * (have / says).clamp(1.0 / LARGEST_RATIO, LARGEST_RATIO).ln();
                    weights += w;
                }
            }
            let carried = if weights > 0.0 { sum / weights * (-nearest / FORGET_DEG).exp() } else { 0.0 };
            let value = shape[i][c] * carried.exp();
            let growth = 1.0 + nearest.min(90.0) / FORGET_DEG;
            let own = value * (error[c] * growth).hypot(0.5 * carried);
            let beside_sigma = beside
                .iter()
                .map(|&(k, _)| f64::from(through.sigma[k][c]) / f64::from(through.values[k][c]).max(1e-9))
                .fold(f64::INFINITY, f64::min);
            let inherited = if beside_sigma.is_finite() { beside_sigma.min(1.0) * value } else { 0.0 };
            through.values[i][c] = value as f32;
            through.sigma[i][c] = own.hypot(inherited) as f32;
        }
        let inner = grid.theta_o_deg[to] <= limit_deg + 1e-9
            && rows.first().is_some_and(|r| *r <= ti)
            && rows.last().is_some_and(|r| *r >= ti);
        through.flag[i] = if inner { Flag::Filled } else { Flag::Extrapolated };
    }
    Ok(())
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
