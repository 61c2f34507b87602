//! From rows to the measured table: total σ out of its parts.
//!
//! `σ² = shot + read + dark + reference pixels + flakes + (u_cert f)² + (u_lamp f)² + (u_angle |∇f|)²`. The angle's u is
//! the calibration's, the pose's distance from its row and the visible part's distance from the bin's centroid.

use gonio_brdf::{Flag, Grid, Meaning, Measured};
use gonio_optics::Angle;

use crate::row::{Row, RowCell};

/// Names of the parts of σ, in the order of [`Budget`].
pub const PARTS: [&str; 9] =
    ["shot", "read", "dark", "reference", "flakes", "coat", "certificate", "lamp", "angle"];

/// Mean relative variance of the measured cells, part by part, as [`PARTS`] names them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Budget {
    /// Root mean square of σ_part / f over measured cells with f > 0 (all channels).
    pub relative: [f64; 9],
    /// Cells counted, times three.
    pub count: u64,
}

/// What σ needs beside the rows.
#[derive(Clone, Debug)]
pub struct Common {
    /// Relative standard uncertainty of the certificate.
    pub certificate: f64,
    /// Relative standard deviation of the lamp monitor's reading from pose to pose.
    pub lamp: f64,
    /// What the same brought to the white reference, relative, row by row.
    pub white_lamp: Vec<f64>,
    /// Of a direction.
    pub angle: Angle,
    /// Radius α of the lamp.
    pub lamp_half_angle: Angle,
}

/// Builds the table of measured cells; everything else is [`Flag::Invalid`].
#[must_use]
pub fn assemble(grid: &Grid, rows: &[Row], common: &Common, limit_deg: f64) -> (Measured, Budget) {
    let mut out =
        Measured::empty(grid.clone(), Meaning::CellMean { lamp_half_angle: common.lamp_half_angle });
    let mut budget = Budget::default();
    let mut kept: [Vec<[f32; 3]>; 9] = std::array::from_fn(|_| vec![[0.0; 3]; grid.len()]);
    let [_, no, np] = grid.shape();
    for (ti, row) in rows.iter().enumerate() {
        let cells: Vec<Option<RowCell>> = (0..no * np)
            .map(|k| if grid.theta_o_deg[k / np] > limit_deg + 1e-9 { None } else { row.cell(k) })
            .collect();
        let angle2 = common.angle.radians().powi(2) + row.off_row().radians().powi(2);
        // within the poses, between them, and between those of the white reference
        let lamp2 = row.lamp_relative().powi(2)
            + common.lamp.powi(2) / f64::from(row.poses().max(1))
            + common.white_lamp[ti].powi(2);
        for k in 0..no * np {
            let Some(cell) = cells[k] else { continue };
            let slope2 = slope_squared(grid, &cells, k / np, k % np);
            let index = grid.index(ti, k / np, k % np);
            out.flag[index] = Flag::Measured;
            for c in 0..3 {
                let f = cell.value[c];
                let mut parts = [0.0; 9];
                for (part, v) in parts.iter_mut().zip(cell.parts) {
                    *part = v[c];
                }
                parts[6] = (common.certificate * f).powi(2);
                parts[7] = lamp2 * f * f;
                parts[8] = (angle2 + cell.off_centre_rad.powi(2)) * slope2[c];
                out.values[index][c] = f as f32;
                out.sigma[index][c] = parts.iter().sum::<f64>().sqrt() as f32;
                for (kept, part) in kept.iter_mut().zip(parts) {
                    kept[index][c] = part.sqrt() as f32;
                }
                if f > 0.0 {
                    budget.count += 1;
                    for (sum, p) in budget.relative.iter_mut().zip(parts) {
                        *sum += p / (f * f);
                    }
                }
            }
        }
    }
    out.sigma_parts = PARTS.iter().map(|p| (*p).to_owned()).zip(kept).collect();
    let n = budget.count.max(1) as f64;
    budget.relative = budget.relative.map(|s| (s / n).sqrt());
    (out, budget)
}

/// |∇f|² in 1/sr² per rad², from the neighbours that were seen.
fn slope_squared(grid: &Grid, cells: &[Option<RowCell>], to: usize, phi: usize) -> [f64; 3] {
    let [_, no, np] = grid.shape();
    let at = |o: usize, p: usize| cells[o * np + p].map(|c| c.value);
    let along = |low: Option<([f64; 3], f64)>, mid: ([f64; 3], f64), high: Option<([f64; 3], f64)>| {
        let (a, b) = (low.unwrap_or(mid), high.unwrap_or(mid));
        let d = (b.1 - a.1).to_radians();
        [0, 1, 2].map(|c| if d > 0.0 { (b.0[c] - a.0[c]) / d } else { 0.0 })
    };
    let Some(here) = at(to, phi) else { return [0.0; 3] };
    let theta = |o: usize| grid.theta_o_deg[o];
    if to == 0 {
        // the cap has no azimuth: its steepest side counts
        let step = (theta(1) - theta(0)).to_radians();
        let rims = (0..np).filter_map(|p| at(1, p));
        return rims.fold([0.0; 3], |most, rim| {
            [0, 1, 2].map(|c| f64::max(most[c], ((rim[c] - here[c]) / step).powi(2)))
        });
    }
    let d_theta = along(
        to.checked_sub(1).and_then(|o| Some((at(o, phi)?, theta(o)))),
        (here, theta(to)),
        (to + 1 < no).then(|| at(to + 1, phi).map(|v| (v, theta(to + 1)))).flatten(),
    );
    let sine = theta(to).to_radians().sin();
    let azimuth = |p: usize| grid.phi_deg[p] * sine;
    let d_phi = along(
        phi.checked_sub(1).and_then(|p| Some((at(to, p)?, azimuth(p)))),
        (here, azimuth(phi)),
        (phi + 1 < np).then(|| at(to, phi + 1).map(|v| (v, azimuth(phi + 1)))).flatten(),
    );
    [0, 1, 2].map(|c| d_theta[c] * d_theta[c] + d_phi[c] * d_phi[c])
}
