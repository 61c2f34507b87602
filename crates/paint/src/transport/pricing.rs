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
    let mut all = f64::INFINITY;
    for x in least {
        all = if x < all { x } else { all };
    }
    all
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
    let (mut first, mut second) = (f64::INFINITY, f64::INFINITY);
    for k in 0..LANES {
        for x in [least[k], next[k]] {
            let above = if x < first { first } else { x };
            second = if above < second { above } else { second };
            first = if x < first { x } else { first };
        }
    }
    [first, second]
}
