//! Helmholtz reciprocity: f(θi, θo, φ) = f(θo, θi, φ).

use gonio_brdf::{Flag, Measured};

/// Gives every cell that was not measured the value measured with light and view exchanged, where there is one.
///
/// Between two rows of θi the value is interpolated and half their difference joins σ.
pub(super) fn fill(m: &mut Measured, limit_deg: f64) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let mut found = Vec::new();
    for ti in 0..ni {
        let Some(o) = grid.theta_o_deg.iter().position(|t| (t - grid.theta_i_deg[ti]).abs() < 1e-9) else {
            continue;
        };
        for to in 0..no {
            let Some((low, high, t)) = between(&grid.theta_i_deg, grid.theta_o_deg[to]) else { continue };
            for phi in 0..np {
                let index = grid.index(ti, to, phi);
                if m.flag[index] == Flag::Measured {
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
                let flag =
                    if grid.theta_o_deg[to] > limit_deg + 1e-9 { Flag::Extrapolated } else { Flag::Filled };
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

/// The rows around a node and the fraction towards the upper one.
fn between(nodes: &[f64], x: f64) -> Option<(usize, usize, f32)> {
    if let Some(k) = nodes.iter().position(|n| (n - x).abs() < 1e-9) {
        return Some((k, k, 0.0));
    }
    let high = nodes.iter().position(|n| *n > x)?;
    let low = high.checked_sub(1)?;
    Some((low, high, ((x - nodes[low]) / (nodes[high] - nodes[low])) as f32))
}
