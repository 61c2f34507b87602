//! What the camera's own face gave back ([`super::face`]), taken off a table over four angles.
//!
//! As off an isotropic table, but S belongs to an azimuth of the light as well, and R of a view is, by reciprocity, what a light from there would send out:
//! it is taken from the rows on either side in θ and in azimuth. Nothing is filled in such a table, so what was not seen of a row counts with the mean of
//! what was, weighted by W for S and by the cosine for R. A gloss is in its cells like everything else.

use gonio_brdf::{Anisotropic, Flag, Rgb};
use gonio_instrument::Pose;
use gonio_optics::{Angle, Vec3};

use super::face;
use crate::pixel_map::PixelMap;

/// Least share of a row's weight that must have been seen, of W and of the cosine alike.
const LEAST_SEEN: f64 = 0.4;

/// What was taken off.
#[derive(Clone, Debug)]
pub struct TakenOff {
    /// Of each cell, in the table's order.
    pub taken: Vec<Rgb>,
    /// Of each row, φi by φi, then θi: the share of its weight that was not seen, and that what was taken off may therefore be wrong by.
    pub unseen: Vec<Vec<f64>>,
}

/// Takes what the face gave back off the table.
pub fn take_off(table: &mut Anisotropic, map: &PixelMap, kappa: f64) -> TakenOff {
    let seen = table.values.clone();
    let mut taken = vec![[0.0; 3]; seen.len()];
    let weights: Vec<Vec<[f64; 2]>> =
        (0..table.grid.theta_i_deg.len()).map(|ti| weights(table, map, ti)).collect();
    // from the table as corrected so far
    for _ in 0..2 {
        let rows: Vec<Vec<Option<[Rgb; 2]>>> = (0..table.phi_i_deg.len())
            .map(|pi| {
                weights.iter().enumerate().map(|(ti, w)| integrals(table, pi, ti, w)).collect::<Vec<_>>()
            })
            .collect();
        for at in (0..seen.len()).filter(|&at| table.flag[at] != Flag::Invalid) {
            let (pi, rest) = (at / table.grid.len(), at % table.grid.len());
            let [ti, to, phi] = table.grid.coordinates(rest);
            let azimuth = table.phi_i_deg[pi] + table.grid.phi_deg[phi];
            let back = sent_out(table, &rows, table.grid.theta_o_deg[to], azimuth);
            let (Some([s, _]), Some(r)) = (rows[pi][ti], back) else { continue };
            for c in 0..3 {
                taken[at][c] = kappa * s[c] * r[c];
                table.values[at][c] = (f64::from(seen[at][c]) - taken[at][c]) as f32;
            }
        }
    }
    let unseen = (0..table.phi_i_deg.len())
        .map(|pi| weights.iter().enumerate().map(|(ti, w)| unseen(table, pi, ti, w)).collect())
        .collect();
    TakenOff { taken, unseen }
}

/// Share of a row's weight that was not seen, of W and of the cosine together.
fn unseen(table: &Anisotropic, pi: usize, ti: usize, weights: &[[f64; 2]]) -> f64 {
    let first = pi * table.grid.len() + table.grid.index(ti, 0, 0);
    let share = |j: usize| {
        let whole: f64 = weights.iter().map(|w| w[j]).sum();
        let holes = weights.iter().enumerate().filter(|(k, _)| table.flag[first + k] == Flag::Invalid);
        holes.map(|(_, w)| w[j]).sum::<f64>() / whole.max(1e-300)
    };
    share(0).hypot(share(1))
}

/// Of each cell of a row its solid angle times W, and times the cosine.
fn weights(table: &Anisotropic, map: &PixelMap, ti: usize) -> Vec<[f64; 2]> {
    let grid = &table.grid;
    let tilt = map.optics().tilt_for(Angle::from_degrees(grid.theta_i_deg[ti]));
    let lab_from_sample = map.frame(Pose { tilt, spin: Angle::ZERO }).0.inverse();
    let [_, no, np] = grid.shape();
    let mut out = Vec::with_capacity(no * np);
    for to in 0..no {
        let (low, high) = grid.theta_o_bounds(to);
        let ring = low.cos() - high.cos();
        let theta = Angle::from_degrees(grid.theta_o_deg[to]);
        for p in 0..np {
            let phi = grid.phi_deg[p];
            let next = grid.phi_deg.get(p + 1).copied().unwrap_or(grid.phi_deg[0] + 360.0);
            let before = if p > 0 { grid.phi_deg[p - 1] } else { grid.phi_deg[np - 1] - 360.0 };
            let sr = ring * (0.5 * (next - before)).to_radians();
            let v = Vec3::from_polar(theta, Angle::from_degrees(phi));
            out.push([sr * face::weight(map.description(), lab_from_sample.apply(v)), sr * theta.cos()]);
        }
    }
    out
}

/// S and R of a row; `None` where little of it was seen.
fn integrals(table: &Anisotropic, pi: usize, ti: usize, weights: &[[f64; 2]]) -> Option<[Rgb; 2]> {
    let first = pi * table.grid.len() + table.grid.index(ti, 0, 0);
    let (mut sums, mut known, mut whole) = ([[0.0; 3]; 2], [0.0; 2], [0.0; 2]);
    for (k, w) in weights.iter().enumerate() {
        for j in 0..2 {
            whole[j] += w[j];
            if table.flag[first + k] != Flag::Invalid {
                known[j] += w[j];
                (0..3).for_each(|c| sums[j][c] += w[j] * f64::from(table.values[first + k][c]));
            }
        }
    }
    let enough = (0..2).all(|j| known[j] > 0.0 && known[j] >= LEAST_SEEN * whole[j]);
    enough.then(|| [0, 1].map(|j| sums[j].map(|s| s * whole[j] / known[j])))
}

/// R of a view at a polar angle and an azimuth on the sample, degrees: linear between the rows that have one, level beyond them.
fn sent_out(
    table: &Anisotropic,
    rows: &[Vec<Option<[Rgb; 2]>>],
    theta_deg: f64,
    azimuth_deg: f64,
) -> Option<Rgb> {
    let at = |pi: usize| -> Option<Rgb> {
        let known: Vec<(f64, Rgb)> = table
            .grid
            .theta_i_deg
            .iter()
            .zip(&rows[pi])
            .filter_map(|(deg, row)| row.map(|[_, r]| (*deg, r)))
            .collect();
        face::between(&known, theta_deg)
    };
    let azimuth = azimuth_deg.rem_euclid(360.0);
    let n = table.phi_i_deg.len();
    let above = table.phi_i_deg.partition_point(|a| *a <= azimuth);
    let (low, high) = ((above + n - 1) % n, above % n);
    let span = (table.phi_i_deg[high] - table.phi_i_deg[low]).rem_euclid(360.0);
    let along = (azimuth - table.phi_i_deg[low]).rem_euclid(360.0);
    let w = if span > 0.0 { along / span } else { 0.0 };
    match (at(low), at(high)) {
        (Some(a), Some(b)) => Some([0, 1, 2].map(|c| (1.0 - w) * a[c] + w * b[c])),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::anisotropic::both_sides;
    use gonio_brdf::models::AshikhminShirleyAnisotropic;
    use gonio_brdf::{Brdf as _, Grid, Meaning};
    use gonio_instrument::builtin;

    const BRUSHED: AshikhminShirleyAnisotropic = AshikhminShirleyAnisotropic {
        diffuse: [0.1, 0.15, 0.2],
        specular: [0.5, 0.5, 0.45],
        exponent_u: 12.0,
        exponent_v: 4.0,
        r0: 0.5,
    };

    fn polar(theta_deg: f64, phi_deg: f64) -> Vec3 {
        Vec3::from_polar(Angle::from_degrees(theta_deg), Angle::from_degrees(phi_deg))
    }

    /// ∫ f(l, ω) weight(ω) dω by the midpoint rule.
    fn over(light: Vec3, weight: impl Fn(Vec3) -> f64) -> Rgb {
        let mut sum = [0.0; 3];
        for i in 0..120 {
            for j in 0..240 {
                let theta = 0.75 * (f64::from(i) + 0.5);
                let v = polar(theta, 1.5 * (f64::from(j) + 0.5));
                let sr = 0.75f64.to_radians() * 1.5f64.to_radians() * theta.to_radians().sin();
                let w = weight(v) * sr;
                BRUSHED.eval(light, v).iter().zip(&mut sum).for_each(|(f, s)| *s += f * w);
            }
        }
        sum
    }

    #[test]
    fn a_brushed_table_with_its_own_light_thrown_back_becomes_itself_again() {
        // sums over cells, and azimuths 45 degrees apart, against the integrals
        let [left, worst, unseen] = left_over(90.0);
        assert!(left < 0.03 && worst < 0.1 && unseen < 1e-9, "{left} {worst} {unseen}");
        // a lobe that rises towards the horizon, where nothing was seen: wrong by no more than the share that is missing
        let [left, worst, unseen] = left_over(75.0);
        assert!(
            left < unseen && worst < 2.0 * unseen && (0.05..0.4).contains(&unseen),
            "{left} {worst} {unseen}"
        );
    }

    /// What is left over of the light thrown back once it is taken off a table seen up to a limit: r.m.s. and largest, relative to what was thrown back; and
    /// the share that was not seen.
    fn left_over(limit_deg: f64) -> [f64; 3] {
        let map = PixelMap::new(&builtin::description("tiny").expect("known").expect("readable"));
        let grid = Grid {
            theta_i_deg: (0..8).map(|k| 10.0 * f64::from(k)).collect(),
            phi_deg: both_sides(&Grid::sopp().phi_deg),
            ..Grid::sopp()
        };
        let azimuths: Vec<f64> = (0..8).map(|k| 45.0 * f64::from(k)).collect();
        let mut t = Anisotropic::empty(azimuths, grid, Meaning::Node);
        let kappa = 0.03;
        // R by the integral, from views every five degrees
        let back: Vec<Vec<Rgb>> = (0..18)
            .map(|i| (0..72).map(|j| over(polar(5.0 * f64::from(i), 5.0 * f64::from(j)), |w| w.z)).collect())
            .collect();
        let mut added = vec![[0.0; 3]; t.values.len()];
        for pi in 0..t.phi_i_deg.len() {
            for ti in 0..t.grid.theta_i_deg.len() {
                let (deg, phi_i) = (t.grid.theta_i_deg[ti], t.phi_i_deg[pi]);
                let tilt = map.optics().tilt_for(Angle::from_degrees(deg));
                let lab = map.frame(Pose { tilt, spin: Angle::ZERO }).0.inverse();
                // the frame of the light is turned by φi on the sample
                let s = over(polar(deg, phi_i), |w| {
                    let (around, up) = (w.y.atan2(w.x).to_degrees() - phi_i, w.z.clamp(-1.0, 1.0).acos());
                    face::weight(map.description(), lab.apply(polar(up.to_degrees(), around)))
                });
                for to in (0..t.grid.theta_o_deg.len()).filter(|&to| t.grid.theta_o_deg[to] <= limit_deg) {
                    for p in 0..t.grid.phi_deg.len() {
                        let at = pi * t.grid.len() + t.grid.index(ti, to, p);
                        let azimuth = phi_i + t.grid.phi_deg[p];
                        let f = BRUSHED.eval(polar(deg, phi_i), polar(t.grid.theta_o_deg[to], azimuth));
                        let r = back[((t.grid.theta_o_deg[to] / 5.0).round() as usize).min(17)]
                            [(azimuth / 5.0).round() as usize % 72];
                        added[at] = [0, 1, 2].map(|c| kappa * s[c] * r[c]);
                        t.values[at] = [0, 1, 2].map(|c| (f[c] + added[at][c]) as f32);
                        t.flag[at] = Flag::Measured;
                    }
                }
            }
        }
        let TakenOff { taken, unseen } = take_off(&mut t, &map, kappa);
        let (mut left, mut whole, mut worst) = (0.0, 0.0, 0.0f64);
        for at in (0..taken.len()).filter(|&at| t.flag[at] == Flag::Measured) {
            let off = taken[at][1] - added[at][1];
            left += off * off;
            whole += added[at][1] * added[at][1];
            worst = worst.max((off / added[at][1]).abs());
        }
        let missing = unseen.iter().flatten().sum::<f64>() / unseen.iter().flatten().count() as f64;
        [(left / whole).sqrt(), worst, missing]
    }
}
