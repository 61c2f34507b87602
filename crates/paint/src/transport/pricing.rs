//! Which path to take up next: reduced costs `w_ij − u_i − v_j`, row by row, several lanes at a time.

use super::costs::LANES;

/// Smallest `w + π` of a padded row; π is −v, 0 in the padding.
pub(super) fn row_least(costs: &[f64], pi: &[f64]) -> f64 {
    let mut least = [f64::INFINITY; LANES];
    for (c, p) in costs.chunks_exact(LANES).zip(pi.chunks_exact(LANES)) {
        for k in 0..LANES {
            let x = c[k] + p[k];
            least[k] = if x < least[k] { x } else { least[k] };
        }
    }
    let mut half = [0.0; LANES / 2];
    for k in 0..LANES / 2 {
        half[k] = least[k].min(least[k + LANES / 2]);
    }
    (half[0].min(half[1])).min(half[2].min(half[3]))
}

/// Column at which `w + π` is `least`, which [`row_least`] found.
pub(super) fn row_place(costs: &[f64], pi: &[f64], least: f64) -> usize {
    costs.iter().zip(pi).position(|(c, p)| c + p == least).unwrap_or(0)
}
