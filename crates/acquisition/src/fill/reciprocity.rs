//! Helmholtz reciprocity: f(θi, θo, φ) = f(θo, θi, φ).

use gonio_brdf::{Flag, Measured};

use super::{Filling, NEAR_DEG};

/// Pairs below which a median says nothing.
const FEWEST: usize = 30;

/// Gives every cell that was not measured the value measured with light and view exchanged, where there is one.
///
/// Between two rows of θi the value is interpolated and half their difference joins σ.
pub(super) fn fill(m: &mut Measured, limit_deg: f64, how: Filling) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let mut found = Vec::new();
    for ti in 0..ni {
        let Some(o) = grid.theta_o_deg.iter().position(|t| (t - grid.theta_i_deg[ti]).abs() < 1e-9) else {
            continue;
        };
        for to in 0..no {
            let beyond = grid.theta_o_deg[to] > limit_deg + 1e-9;
            let Some((low, high, t)) = between(&grid.theta_i_deg, grid.theta_o_deg[to]) else { continue };
            for phi in 0..np {
                let index = grid.index(ti, to, phi);
                if m.flag[index] != Flag::Invalid || !how.method(&grid, [ti, to, phi], limit_deg).reciprocity
                {
                    continue;
                }
                let (a, b) = (grid.index(low, o, phi), grid.index(high, o, phi));
                if m.flag[a] != Flag::Measured || m.flag[b] != Flag::Measured {
                    continue;
                }
                let mut value = [0.0f32; 3];
                let mut sigma = [0.0f32; 3];
                for c in 0..3 {
                    let (va, vb) = (m.values[a][c], m.values[b][c]);
                    value[c] = (va + (vb - va) * t).max(0.0);
                    let half = if t > 0.0 { 0.5 * (va - vb) } else { 0.0 };
                    // bins and lamp do not exchange with the directions: a cell's mean is not quite its swapped one's
                    sigma[c] =
                        (m.sigma[a][c].max(m.sigma[b][c]).powi(2) + half * half + (0.01 * value[c]).powi(2))
                            .sqrt();
                }
                let flag = if beyond { Flag::Extrapolated } else { Flag::Filled };
                found.push((index, value, sigma, flag));
            }
        }
    }
    for (index, value, sigma, flag) in found {
        m.values[index] = value;
        m.sigma[index] = sigma;
        m.flag[index] = flag;
    }
}

/// Median of |ln f(θi, θo, φ) − ln f(θo, θi, φ)| over the pairs of measured cells beyond 15° of the mirror direction, of the channel where it is largest;
/// `None` for fewer than 30 pairs.
pub(super) fn residual(m: &Measured) -> Option<f64> {
    let grid = &m.grid;
    let swapped = |[ti, to, phi]: [usize; 3]| -> Option<usize> {
        let node = |nodes: &[f64], x: f64| nodes.iter().position(|n| (n - x).abs() < 1e-9);
        let (a, b) =
            (node(&grid.theta_i_deg, grid.theta_o_deg[to])?, node(&grid.theta_o_deg, grid.theta_i_deg[ti])?);
        Some(grid.index(a, b, phi))
    };
    let mut off: [Vec<f64>; 3] = Default::default();
    for i in (0..grid.len()).filter(|&i| m.flag[i] == Flag::Measured) {
        let cell = grid.coordinates(i);
        let [ti, to, phi] = cell;
        if grid.geometry(ti, to, phi).from_mirror().degrees() <= NEAR_DEG {
            continue;
        }
        let Some(j) = swapped(cell).filter(|&j| j > i && m.flag[j] == Flag::Measured) else { continue };
        for (c, off) in off.iter_mut().enumerate() {
            let (a, b) = (m.values[i][c], m.values[j][c]);
            if a > 0.0 && b > 0.0 {
                off.push(f64::from(a / b).ln().abs());
            }
        }
    }
    let median = |mut all: Vec<f64>| {
        all.sort_unstable_by(f64::total_cmp);
        (all.len() >= FEWEST).then(|| all[all.len() / 2])
    };
    off.into_iter().filter_map(median).max_by(f64::total_cmp)
}

/// The rows around a node and the fraction towards the upper one.
fn between(nodes: &[f64], x: f64) -> Option<(usize, usize, f32)> {
    if let Some(k) = nodes.iter().position(|n| (n - x).abs() < 1e-9) {
        return Some((k, k, 0.0));
    }
    let high = nodes.iter().position(|n| *n > x)?;
    let low = high.checked_sub(1)?;
    Some((low, high, ((x - nodes[low]) / (nodes[high] - nodes[low])) as f32))
}
