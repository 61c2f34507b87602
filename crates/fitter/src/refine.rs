//! Levenberg–Marquardt on the reduced problem: the nonlinear parameters walk, the colours follow at their best (variable projection).
//!
//! Steps end at the bounds; a parameter at a bound stays there while the gradient pushes it out. Marquardt's scaled damping (Sopp 4.8), adapted by
//! how well the quadratic model foretold the gain (Nielsen 1999).

use crate::moments::{MAX_PARAMETERS, Reduced};

/// Where a refinement ended.
#[derive(Clone, Debug)]
pub(crate) struct Refined {
    pub q: Vec<f64>,
    pub at: Reduced,
    /// Whether the steps became negligible.
    pub converged: bool,
}

/// Steps smaller than this (in the logarithm, or relative to the range) are nothing.
pub(crate) const SMALLEST_STEP: f64 = 1e-11;
/// Steps that end a coarse refinement.
pub(crate) const COARSE_STEP: f64 = 1e-3;

/// Refines from `q`; `evaluate` gives the reduced problem at a place.
pub(crate) fn refine(
    start: &[f64],
    bounds: &[(f64, f64)],
    most: usize,
    smallest_step: f64,
    mut evaluate: impl FnMut(&[f64]) -> Reduced,
) -> Refined {
    let n = start.len().min(MAX_PARAMETERS);
    let clamp = |q: f64, i: usize| bounds.get(i).map_or(q, |b| q.clamp(b.0, b.1));
    let mut q: Vec<f64> = start.iter().enumerate().map(|(i, &x)| clamp(x, i)).collect();
    let mut at = evaluate(&q);
    let mut damping = 1e-3;
    let mut growth = 2.0;
    let mut converged = n == 0;
    for _ in 0..most {
        if converged || !at.squares.is_finite() {
            break;
        }
        let free: Vec<usize> = (0..n)
            .filter(|&i| {
                let b = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
                let out = (q[i] <= b.0 && at.gradient[i] > 0.0) || (q[i] >= b.1 && at.gradient[i] < 0.0);
                !out && at.curvature[i][i] > 0.0
            })
            .collect();
        if free.is_empty() {
            converged = true;
            break;
        }
        let Some((next, cut)) = step_within(&at, &q, bounds, free, damping) else {
            damping = (damping * growth).max(1e-10);
            growth *= 2.0;
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let moved: Vec<f64> = (0..n).map(|i| next[i] - q[i]).collect();
        let size = (0..n)
            .map(|i| {
                let range = bounds.get(i).map_or(1.0, |b| (b.1 - b.0).clamp(1e-12, 10.0));
                moved[i].abs() / range.max(1.0)
            })
            .fold(0.0, f64::max);
        let foretold: f64 = (0..n)
            .map(|i| {
                let bent: f64 = (0..n).map(|j| at.curvature[i][j] * moved[j]).sum();
                -moved[i] * (2.0 * at.gradient[i] + bent)
            })
            .sum();
        // a step that a bound cut short says nothing of how far the minimum is
        if !cut && (size < smallest_step || foretold <= 1e-16 * at.squares) {
            converged = true;
            // the last, smallest step is taken where it does not climb
            let last = evaluate(&next);
            if last.squares <= at.squares {
                (q, at) = (next, last);
            }
            break;
        }
        let trial = evaluate(&next);
        let gain = at.squares - trial.squares;
        if gain > 0.0 || (gain.abs() <= 1e-14 * at.squares && size < 1e-6) {
            let ratio = (gain / foretold).clamp(0.0, 1.0);
            damping = (damping * (1.0 - (2.0 * ratio - 1.0).powi(3)).max(0.1)).max(1e-12);
            growth = 2.0;
            (q, at) = (next, trial);
        } else {
            damping *= growth;
            growth *= 2.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    Refined { q, at, converged }
}

/// Where the damped step leads, and whether a bound cut it short: up to the first bound it meets. A parameter at a bound that the step would cross stays out of it.
fn step_within(
    at: &Reduced,
    q: &[f64],
    bounds: &[(f64, f64)],
    mut free: Vec<usize>,
    damping: f64,
) -> Option<(Vec<f64>, bool)> {
    loop {
        let step = damped(at, &free, damping)?;
        let room = |i: usize, s: f64| {
            let b = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            if s > 0.0 { b.1 - q[i] } else { q[i] - b.0 }
        };
        let stuck = free.iter().zip(&step).position(|(&i, &s)| s != 0.0 && room(i, s) <= 0.0);
        if let Some(k) = stuck {
            free.remove(k);
            if free.is_empty() {
                return Some((q.to_vec(), false));
            }
            continue;
        }
        let share = free
            .iter()
            .zip(&step)
            .map(|(&i, &s)| if s == 0.0 { 1.0 } else { room(i, s) / s.abs() })
            .fold(1.0, f64::min);
        let mut next = q.to_vec();
        for (&i, &s) in free.iter().zip(&step) {
            let b = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            next[i] = (q[i] + share * s).clamp(b.0, b.1);
            // the one that meets its bound ends on it exactly
            if share < 1.0 && room(i, s) <= share * s.abs() * (1.0 + 1e-12) {
                next[i] = if s > 0.0 { b.1 } else { b.0 };
            }
        }
        return Some((next, share < 1.0));
    }
}

/// The damped step of the free parameters; `None` where the damped curvature is not positive.
fn damped(at: &Reduced, free: &[usize], damping: f64) -> Option<Vec<f64>> {
    let m = free.len();
    let mut l = vec![vec![0.0; m]; m];
    let mut z = vec![0.0; m];
    for a in 0..m {
        for b in 0..=a {
            let mut rest = at.curvature[free[a]][free[b]];
            if a == b {
                rest *= 1.0 + damping;
            }
            rest -= (0..b).map(|k| l[a][k] * l[b][k]).sum::<f64>();
            if a == b {
                if rest.is_nan() || rest <= 1e-15 * at.curvature[free[a]][free[a]] {
                    return None;
                }
                l[a][a] = rest.sqrt();
            } else {
                l[a][b] = rest / l[b][b];
            }
        }
        z[a] = (-at.gradient[free[a]] - (0..a).map(|k| l[a][k] * z[k]).sum::<f64>()) / l[a][a];
    }
    let mut x = vec![0.0; m];
    for a in (0..m).rev() {
        x[a] = (z[a] - (a + 1..m).map(|k| l[k][a] * x[k]).sum::<f64>()) / l[a][a];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as residuals (10(y − x²), 1 − x).
    fn valley(q: &[f64]) -> Reduced {
        let (x, y) = (q[0], q[1]);
        let r = [10.0 * (y - x * x), 1.0 - x];
        let j = [[-20.0 * x, 10.0], [-1.0, 0.0]];
        let mut at = Reduced { squares: r[0] * r[0] + r[1] * r[1], ..Reduced::default() };
        for a in 0..2 {
            at.gradient[a] = (0..2).map(|i| j[i][a] * r[i]).sum();
            for b in 0..2 {
                at.curvature[a][b] = (0..2).map(|i| j[i][a] * j[i][b]).sum();
            }
        }
        at
    }

    #[test]
    fn a_bent_valley_is_followed_and_bounds_hold() {
        let r = refine(&[-1.2, 1.0], &[(-5.0, 5.0); 2], 200, SMALLEST_STEP, valley);
        assert!(r.converged && (r.q[0] - 1.0).abs() < 1e-8 && (r.q[1] - 1.0).abs() < 1e-8, "{r:?}");
        let r = refine(&[-1.2, 1.0], &[(-5.0, 0.5), (-5.0, 5.0)], 200, SMALLEST_STEP, valley);
        assert!((r.q[0] - 0.5).abs() < 1e-12 && (r.q[1] - 0.25).abs() < 1e-6, "{r:?}");
    }

    #[test]
    fn a_start_a_hair_from_its_bound_is_not_taken_for_the_end() {
        // two valleys' worth of slope: the step from here leaves through the upper bound of x, one rounding away
        let r = refine(&[1.5 - 2.3e-16, -4.0], &[(-5.0, 1.5), (-5.0, 5.0)], 200, SMALLEST_STEP, valley);
        assert!(r.converged && (r.q[0] - 1.0).abs() < 1e-8 && (r.q[1] - 1.0).abs() < 1e-8, "{r:?}");
        let r = refine(&[0.5 - 1.2e-16, 4.0], &[(-5.0, 0.5), (-5.0, 5.0)], 200, SMALLEST_STEP, valley);
        assert!(r.at.squares < 0.2501 && (r.q[0] - 0.5).abs() < 1e-12, "{r:?}");
    }

    #[test]
    fn numbers_that_do_not_exist_end_it() {
        let r = refine(&[0.0], &[(-1.0, 1.0)], 50, SMALLEST_STEP, |_| Reduced {
            squares: f64::NAN,
            ..Reduced::default()
        });
        assert!(!r.converged);
    }
}
