//! Which path to take up next: reduced costs `w_ij − u_i − v_j`, row by row, several lanes at a time.

use super::costs::LANES;

/// Smallest `w + π` of a padded row; π is −v, 0 in the padding.
#[inline(always)]
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
#[inline(always)]
pub(super) fn row_place(costs: &[f64], pi: &[f64], least: f64) -> usize {
    for (at, (c, p)) in costs.chunks_exact(LANES).zip(pi.chunks_exact(LANES)).enumerate() {
        let mut here = false;
        for k in 0..LANES {
            here |= c[k] + p[k] == least;
        }
        if here {
            return at * LANES + c.iter().zip(p).position(|(c, p)| c + p == least).unwrap_or(0);
        }
    }
    0
}

/// The two smallest `w + π` of a padded row (they may be equal).
#[inline(always)]
pub(super) fn two_least(costs: &[f64], pi: &[f64]) -> [f64; 2] {
    let mut least = [f64::INFINITY; LANES];
    let mut next = [f64::INFINITY; LANES];
    for (c, p) in costs.chunks_exact(LANES).zip(pi.chunks_exact(LANES)) {
        for k in 0..LANES {
            let x = c[k] + p[k];
            let above = if x < least[k] { least[k] } else { x };
            next[k] = if above < next[k] { above } else { next[k] };
            least[k] = if x < least[k] { x } else { least[k] };
        }
    }
    let (mut a, mut b) = (f64::INFINITY, f64::INFINITY);
    for x in least.into_iter().chain(next) {
        if x < a {
            (a, b) = (x, a);
        } else if x < b {
            b = x;
        }
    }
    [a, b]
}
