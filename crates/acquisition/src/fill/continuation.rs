//! Beyond what was measured: rows between and outside those of the poses, and polar angles past the limit.
//!
//! Past the limit log f goes on with the slope it has there, damped to nothing over ten degrees: it starts where the data end, so there is no jump;
//! it is a positive number times an exponential, so it never turns negative; and the damping keeps a rising lobe from running away.

use gonio_brdf::{Flag, Measured};

/// Length over which the slope of log f is forgotten, degrees.
pub(super) const FORGET_DEG: f64 = 10.0;
/// Largest slope of log f that is carried on, per degree.
const STEEPEST: f64 = 0.15;
/// Relative σ gained per degree beyond the data.
const PER_DEGREE: f64 = 0.03;

/// Rows of θi that no pose stands for but whose neighbours on both sides were measured: linear in θi.
pub(super) fn between_rows(m: &mut Measured, limit_deg: f64) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let within = (0..no).take_while(|&o| grid.theta_o_deg[o] <= limit_deg + 1e-9).count();
    let known: Vec<bool> = (0..ni)
        .map(|ti| (0..within * np).any(|k| m.flag[grid.index(ti, 0, 0) + k] == Flag::Measured))
        .collect();
    for ti in (0..ni).filter(|&t| !known[t]) {
        let low = (0..ti).rev().find(|&t| known[t]);
        let high = (ti + 1..ni).find(|&t| known[t]);
        let (Some(low), Some(high)) = (low, high) else { continue };
        let span = grid.theta_i_deg[high] - grid.theta_i_deg[low];
        let t = ((grid.theta_i_deg[ti] - grid.theta_i_deg[low]) / span) as f32;
        for k in 0..within * np {
            let at = grid.index(ti, 0, 0) + k;
            let (a, b) = (grid.index(low, 0, 0) + k, grid.index(high, 0, 0) + k);
            if m.flag[at] != Flag::Invalid || m.flag[a] == Flag::Invalid || m.flag[b] == Flag::Invalid {
                continue;
            }
            for c in 0..3 {
                let (va, vb) = (m.values[a][c].max(0.0), m.values[b][c].max(0.0));
                m.values[at][c] = va + (vb - va) * t;
                m.sigma[at][c] = (m.sigma[a][c].max(m.sigma[b][c]).powi(2)
                    + (0.5 * (va - vb)).powi(2)
                    + (0.02 * m.values[at][c]).powi(2))
                .sqrt();
            }
            m.flag[at] = Flag::Filled;
        }
    }
}

/// Polar viewing angles past the limit, along θo at fixed θi and φ.
pub(super) fn beyond_limit(m: &mut Measured, limit_deg: f64, settle: bool) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let within = (0..no).take_while(|&o| grid.theta_o_deg[o] <= limit_deg + 1e-9).count();
    if within < 3 {
        return;
    }
    for ti in 0..ni {
        for phi in 0..np {
            for to in within..no {
                let at = grid.index(ti, to, phi);
                if m.flag[at] != Flag::Invalid {
                    continue;
                }
                // the last three known cells below, those found by reciprocity included
                let line: Vec<(f64, usize)> = (0..to)
                    .rev()
                    .map(|o| (grid.theta_o_deg[o], grid.index(ti, o, phi)))
                    .take_while(|(_, k)| m.flag[*k] != Flag::Invalid)
                    .take(3)
                    .collect();
                let edge = grid.theta_o_deg[within - 1];
                carry_on(m, at, grid.theta_o_deg[to], &line, edge, settle);
            }
        }
    }
}

/// Rows of θi outside those known (θi = 90° among them), along θi at fixed θo and φ.
pub(super) fn outer_rows(m: &mut Measured, settle: bool) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    for k in 0..no * np {
        let (to, phi) = (k / np, k % np);
        let known: Vec<usize> =
            (0..ni).filter(|&t| m.flag[grid.index(t, to, phi)] != Flag::Invalid).collect();
        let (Some(&first), Some(&last)) = (known.first(), known.last()) else { continue };
        for ti in last + 1..ni {
            let line: Vec<(f64, usize)> = (0..ti)
                .rev()
                .map(|t| (grid.theta_i_deg[t], grid.index(t, to, phi)))
                .take_while(|(_, k)| m.flag[*k] != Flag::Invalid)
                .take(3)
                .collect();
            carry_on(m, grid.index(ti, to, phi), grid.theta_i_deg[ti], &line, grid.theta_i_deg[last], settle);
        }
        for ti in (0..first).rev() {
            let line: Vec<(f64, usize)> = (ti + 1..ni)
                .map(|t| (-grid.theta_i_deg[t], grid.index(t, to, phi)))
                .take_while(|(_, k)| m.flag[*k] != Flag::Invalid)
                .take(3)
                .collect();
            carry_on(
                m,
                grid.index(ti, to, phi),
                -grid.theta_i_deg[ti],
                &line,
                -grid.theta_i_deg[first],
                settle,
            );
        }
    }
}

/// Continues from `line` (nearest first, coordinate in degrees) to `x`; `edge` is where the data end. What is to settle is a ratio to something
/// better known: it returns to 1.
fn carry_on(m: &mut Measured, at: usize, x: f64, line: &[(f64, usize)], edge: f64, settle: bool) {
    let Some(&(x0, nearest)) = line.first() else { return };
    for c in 0..3 {
        let f0 = f64::from(m.values[nearest][c]).max(0.0);
        let slope = line
            .last()
            .filter(|(xb, _)| x0 - xb > 1e-9)
            .map_or(0.0, |&(xb, k)| {
                let fb = f64::from(m.values[k][c]);
                if f0 > 0.0 && fb > 0.0 { (f0 / fb).ln() / (x0 - xb) } else { 0.0 }
            })
            .clamp(-STEEPEST, STEEPEST);
        let left = (-(x - x0) / FORGET_DEG).exp();
        let grown = if settle { f0.max(1e-9).ln() * (left - 1.0) } else { slope * FORGET_DEG * (1.0 - left) };
        let value = f0 * grown.exp();
        let beyond = (x - edge).max(0.0);
        let own = value * (PER_DEGREE * beyond + 0.5 * grown.abs());
        m.values[at][c] = value as f32;
        m.sigma[at][c] = (f64::from(m.sigma[nearest][c]).powi(2) + own * own).sqrt() as f32;
    }
    m.flag[at] = Flag::Extrapolated;
}
