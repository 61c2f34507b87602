//! Holes within a measured row: the smoothest surface over (θo, φ) that meets what is known around them.
//!
//! Each unknown cell is the mean of its four neighbours, weighted by their inverse squared distance (a membrane, ∇²f = 0); at
//! φ = 0 and 180° the neighbour beyond is the mirror image. Solved by relaxation, so a value never leaves the range of its rim.

use gonio_brdf::{Flag, Measured};

/// Sweeps of the relaxation; holes are a few cells wide.
const SWEEPS: usize = 400;

pub(super) fn fill(m: &mut Measured, limit_deg: f64) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let within = (0..no).take_while(|&o| grid.theta_o_deg[o] <= limit_deg + 1e-9).count();
    for ti in 0..ni {
        let known: Vec<bool> =
            (0..within * np).map(|k| m.flag[grid.index(ti, 0, 0) + k] != Flag::Invalid).collect();
        let count = known.iter().filter(|k| **k).count();
        if count == known.len() || count * 4 < known.len() {
            continue;
        }
        let start = grid.index(ti, 0, 0);
        // neighbours of a cell with weights
        let neighbours = |k: usize| -> [(Option<usize>, f64); 4] {
            let (o, p) = (k / np, k % np);
            let sine = grid.theta_o_deg[o].to_radians().sin().max(0.02);
            let along = |a: usize, b: usize| 1.0 / (grid.theta_o_deg[a] - grid.theta_o_deg[b]).powi(2);
            let across = |a: usize, b: usize| 1.0 / ((grid.phi_deg[a] - grid.phi_deg[b]) * sine).powi(2);
            let mut out = [(None, 0.0); 4];
            if o > 0 {
                out[0] = (Some(k - np), along(o, o - 1));
            } else {
                // the cap: all azimuths are one cell, its neighbour opposite lies at φ + 180°
                out[0] = (Some(np + (np - 1 - p)), along(1, 0));
            }
            if o + 1 < within {
                out[1] = (Some(k + np), along(o, o + 1));
            }
            if o > 0 {
                out[2] = if p > 0 { (Some(k - 1), across(p, p - 1)) } else { (Some(k + 1), across(0, 1)) };
                out[3] = if p + 1 < np {
                    (Some(k + 1), across(p, p + 1))
                } else {
                    (Some(k - 1), across(p, p - 1))
                };
            }
            out
        };
        let holes: Vec<usize> = (0..known.len()).filter(|k| !known[*k]).collect();
        let mut reach = vec![0.0f64; known.len()];
        for c in 0..3 {
            let mean = (0..known.len())
                .filter(|k| known[*k])
                .map(|k| f64::from(m.values[start + k][c]))
                .sum::<f64>()
                / count as f64;
            let mut f: Vec<f64> = (0..known.len())
                .map(|k| if known[k] { f64::from(m.values[start + k][c]) } else { mean })
                .collect();
            let mut s: Vec<f64> = (0..known.len())
                .map(|k| if known[k] { f64::from(m.sigma[start + k][c]) } else { 0.0 })
                .collect();
            for sweep in 0..SWEEPS {
                let mut change = 0.0f64;
                for &k in &holes {
                    let (mut sum, mut spread, mut weight, mut far) = (0.0, 0.0, 0.0, 0.0);
                    for (n, w) in neighbours(k) {
                        if let Some(n) = n {
                            sum += w * f[n];
                            spread += w * s[n];
                            far += w * reach[n];
                            weight += w;
                        }
                    }
                    let next = sum / weight;
                    change = change.max((next - f[k]).abs() / next.abs().max(1e-12));
                    f[k] = next;
                    s[k] = spread / weight;
                    if c == 0 {
                        reach[k] = far / weight + 1.0;
                    }
                }
                if sweep > 20 && change < 1e-7 {
                    break;
                }
            }
            for &k in &holes {
                let value = f[k].max(0.0);
                // how much the rim varies around the hole, in steps of a cell's distance from it
                let rim = neighbours(k)
                    .iter()
                    .filter_map(|(n, _)| n.map(|n| (f[n] - f[k]).abs()))
                    .fold(0.0, f64::max);
                m.values[start + k][c] = value as f32;
                m.sigma[start + k][c] =
                    (s[k] * s[k] + (rim * reach[k].sqrt()).powi(2) + (0.02 * value).powi(2)).sqrt() as f32;
            }
        }
        for &k in &holes {
            m.flag[start + k] = Flag::Filled;
        }
    }
}
