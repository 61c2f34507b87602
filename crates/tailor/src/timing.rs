//! What an evaluation costs on this machine: candidates timed in turn, so that whatever else the machine does strikes all of them alike.

use std::hint::black_box;
use std::time::Instant;

/// Directions a batch: their vectors stay in the second-level cache, and come in no order, as in a scene.
const BATCH: usize = 2048;
/// How many times each candidate has its turn.
const ROUNDS: usize = 41;

/// A single-precision direction, z the normal.
pub type Direction = [f32; 3];

/// What one evaluation takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Median over rounds.
    pub median_ns: f64,
    /// Fastest round.
    pub least_ns: f64,
}

/// An evaluation of many geometries: lights, views, and where f goes.
pub type Evaluate<'a> = &'a (dyn Fn(&[Direction], &[Direction], &mut [[f32; 3]]) + Sync);

/// Times candidates over the same directions (repeated up to a batch of 2048), 41 rounds of one batch each, in turn; one thread.
/// Without directions all costs are NaN.
#[must_use]
pub fn costs(directions: &[(Direction, Direction)], candidates: &[Evaluate<'_>]) -> Vec<Cost> {
    if directions.is_empty() {
        return vec![Cost { median_ns: f64::NAN, least_ns: f64::NAN }; candidates.len()];
    }
    let (lights, views): (Vec<_>, Vec<_>) = directions.iter().copied().cycle().take(BATCH).unzip();
    let mut out = vec![[0.0f32; 3]; lights.len()];
    let mut times = vec![Vec::with_capacity(ROUNDS); candidates.len()];
    // the first round warms caches and is not counted
    for round in 0..=ROUNDS {
        for (candidate, times) in candidates.iter().zip(&mut times) {
            let start = Instant::now();
            candidate(black_box(&lights), black_box(&views), &mut out);
            black_box(&mut out);
            if round > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e9 / lights.len() as f64);
            }
        }
    }
    times
        .into_iter()
        .map(|mut t| {
            t.sort_by(f64::total_cmp);
            Cost { median_ns: t[t.len() / 2], least_ns: t[0] }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_work_costs_more_and_all_directions_are_asked() {
        let work = |n: u32| {
            move |l: &[Direction], v: &[Direction], out: &mut [[f32; 3]]| {
                for ((l, v), f) in l.iter().zip(v).zip(out) {
                    let mut x = l[2] + v[2];
                    for _ in 0..n {
                        x = black_box(x * 0.99 + 0.01);
                    }
                    *f = [x; 3];
                }
            }
        };
        let (little, much) = (work(10), work(400));
        let d = [([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])];
        let c = costs(&d, &[&little, &much]);
        assert!(c[1].median_ns > 2.0 * c[0].median_ns && c[0].least_ns > 0.0, "{c:?}");
        assert!(costs(&[], &[&little])[0].median_ns.is_nan());
    }
}
