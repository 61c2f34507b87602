//! The settings of a flake map that its own data choose: those with which a fit to one part of the measurements predicts the other part best.

use super::{
    FlakeFitOptions,
    flake_rows::{Datum, Row, Shape, solve},
};

/// Nodes per axis while settings are tried: what they change does not hang on the finest detail.
const COARSE: usize = 20;
/// Measurements that take part in trials.
const TRIED: usize = 4000;
/// With fewer measurements than this nothing is chosen.
const LEAST: usize = 60;
/// Default λ at 40 × 40 nodes, and where nothing is chosen.
const SMOOTHNESS: f64 = 1e-3;
/// β is taken over 0 only if it lowers the squared error of prediction by more than this share, λ by more than the other: where noise is most of that
/// error, a good λ changes little of it.
const WORTH: f64 = 0.02;
const WORTH_SMOOTH: f64 = 0.001;

/// Chosen settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Choice {
    pub(super) edge: f64,
    pub(super) smoothness: f64,
    /// Error of prediction with the index given over that without a coat; `None` where it was not tried.
    pub(super) against_none: Option<f64>,
}

/// Chooses what the options leave open.
pub(super) fn choose(data: &[Datum], options: &FlakeFitOptions) -> Choice {
    let coarse = options.nodes.map(|n| n.min(COARSE));
    let shape = Shape { nodes: coarse, ..Shape::of(options) };
    // second differences over a step of twice the length are four times as large, and stand at a quarter of the nodes with four times the weight each
    let finer = (0..2).map(|a| (options.nodes[a] as f64 / coarse[a] as f64).powi(2)).product::<f64>();
    let (mut edge, mut smoothness) =
        (options.edge.fixed().unwrap_or(0.0), options.smoothness.fixed().unwrap_or(SMOOTHNESS));
    if data.len() < LEAST {
        return Choice { edge, smoothness, against_none: None };
    }
    let step = data.len().div_ceil(TRIED);
    let tried: Vec<&Datum> = data.iter().step_by(step).collect();
    // λ stands against a mean weight of 1 per node: with fewer measurements each weighs more, and what they leave open needs more of it
    let fewer = 2.0 * data.len() as f64 / tried.len() as f64;
    let error = |shape: &Shape, edge: f64, smoothness: f64| {
        prediction(&tried, shape, edge, (smoothness / finer * fewer).clamp(1e-9, 1e6))
    };
    if options.smoothness.fixed().is_none() {
        let at = |l: f64| (l, error(&shape, edge, l));
        let start = at(smoothness);
        smoothness = best(WORTH_SMOOTH, start, [1e-4, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0, 10.0].map(at));
    }
    if options.edge.fixed().is_none() {
        let at = |b: f64| (b, error(&shape, b, smoothness));
        let start = at(0.0);
        edge = best(WORTH, start, [-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0, 1.5].map(at));
    }
    let against_none = (options.index > 1.0).then(|| {
        let bare = Shape { index: 1.0, ..shape };
        (error(&shape, edge, smoothness) / error(&bare, edge, smoothness).max(1e-30)).sqrt()
    });
    Choice { edge, smoothness, against_none }
}

/// The setting of the least error, or the first one where none is worth it.
fn best<const N: usize>(worth: f64, start: (f64, f64), others: [(f64, f64); N]) -> f64 {
    let least = others.into_iter().fold(start, |a, b| if b.1 < a.1 { b } else { a });
    if least.1 < (1.0 - worth) * start.1 { least.0 } else { start.0 }
}

/// Mean squared error on the scale of the fit, weighted, of each half predicted from the other.
fn prediction(data: &[&Datum], shape: &Shape, edge: f64, smoothness: f64) -> f64 {
    let rows: Vec<Row> = data.iter().map(|d| Row::new(d, shape, edge)).collect();
    // the halves are mixed: neighbours on a measured grid must not fall by turns into either
    let half = |i: usize| (i as u32).wrapping_mul(2_654_435_769) >> 31;
    let (mut sum, mut total) = (0.0, 0.0);
    for part in [0, 1] {
        let seen = rows.iter().enumerate().filter(|(i, _)| half(*i) != part).map(|(_, r)| r);
        let Some(coefficients) = solve(seen, shape, smoothness) else { return f64::INFINITY };
        for (_, row) in rows.iter().enumerate().filter(|(i, _)| half(*i) == part) {
            // the weight holds the scale's square: errors of f count, not those of f/E
            let r = row.residual(&coefficients);
            sum += row.weight * r.iter().map(|r| r * r).sum::<f64>();
            total += row.weight / (row.scale * row.scale);
        }
    }
    if total > 0.0 { sum / total } else { f64::INFINITY }
}
