//! Cells of a table for drawing: the nearest bin of an angle, whole-table values, robust ranges.

use gonio_brdf::{Brdf, Flag, Grid, Meaning, Measured, Rgb, average};
use gonio_optics::colour;
use rayon::prelude::*;

/// Index of the node whose bin holds `x`: bins reach halfway to the neighbours and end at the outermost nodes. `None` outside;
/// a single node stands for the whole axis.
pub(crate) fn bin(nodes: &[f64], x: f64) -> Option<usize> {
    match nodes {
        [] => None,
        [_] => Some(0),
        [first, .., last] if x < first - 1e-6 || x > last + 1e-6 => None,
        _ => nearest(nodes, x),
    }
}

/// Index of the node nearest to `x`; `None` for an empty axis.
pub(crate) fn nearest(nodes: &[f64], x: f64) -> Option<usize> {
    let k = nodes.partition_point(|&n| n <= x);
    match (k.checked_sub(1).and_then(|j| Some((j, *nodes.get(j)?))), nodes.get(k)) {
        (Some((j, below)), Some(&above)) => Some(if x - below <= above - x { j } else { k }),
        (Some((j, _)), None) => Some(j),
        (None, Some(_)) => Some(k),
        (None, None) => None,
    }
}

/// An azimuth in degrees on the side that the table holds: folded to 0…180 unless its nodes go further round.
pub(crate) fn folded(phi_nodes_deg: &[f64], phi_deg: f64) -> f64 {
    let turned = phi_deg.rem_euclid(360.0);
    if phi_nodes_deg.last().is_some_and(|&p| p > 180.0 + 1e-6) { turned } else { turned.min(360.0 - turned) }
}

/// The cell's value, `None` where it is invalid or not a number.
pub(crate) fn value(m: &Measured, index: usize) -> Option<Rgb> {
    let (flag, v) = (m.flag.get(index)?, m.values.get(index)?);
    (*flag != Flag::Invalid && v.iter().all(|x| x.is_finite())).then(|| v.map(f64::from))
}

/// Relative standard uncertainty of the luminance, σ_Y / Y. The channels' parts are added as if they were fully correlated, which
/// most of them are (lamp, reference, angle): an upper bound. `None` without a value or where it is not above zero.
pub(crate) fn relative_sigma(m: &Measured, index: usize) -> Option<f64> {
    let y = colour::luminance(value(m, index)?);
    let s = colour::luminance(m.sigma.get(index)?.map(f64::from));
    let r = s / y;
    (y > 0.0 && r.is_finite() && r >= 0.0).then_some(r)
}

/// What a model would have given in every cell of `like`: averaged over bin and lamp where the table holds cell means,
/// at the node where it holds node values; all cells measured, σ zero.
#[must_use]
pub fn model_table(like: &Measured, brdf: &dyn Brdf, nodes: usize, rings: usize) -> Measured {
    let grid: &Grid = &like.grid;
    let mut table = Measured::empty(grid.clone(), like.meaning);
    table.values = (0..grid.len())
        .into_par_iter()
        .map(|i| {
            let cell = grid.coordinates(i);
            average::cell_mean(brdf, grid, like.meaning, cell, nodes.max(1), rings).map(|f| f as f32)
        })
        .collect();
    table.flag = vec![Flag::Measured; grid.len()];
    table
}

/// Whether the table holds averages over bins.
pub(crate) fn is_mean(m: &Measured) -> bool {
    matches!(m.meaning, Meaning::CellMean { .. })
}

/// The `q` quantile (0…1) of the finite numbers, `None` when there is none.
pub(crate) fn quantile(values: impl Iterator<Item = f64>, q: f64) -> Option<f64> {
    let mut v: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    v.sort_by(f64::total_cmp);
    let k = (q.clamp(0.0, 1.0) * v.len().saturating_sub(1) as f64).round() as usize;
    v.get(k).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_belongs_to_the_node_it_is_nearest_to() {
        let nodes = [0.0, 10.0, 30.0];
        for (x, k) in [(-5.0, 0), (4.9, 0), (5.1, 1), (19.9, 1), (20.1, 2), (99.0, 2)] {
            assert_eq!(nearest(&nodes, x), Some(k), "{x}");
        }
        assert_eq!(nearest(&[], 1.0), None);
    }

    #[test]
    fn quantiles_ignore_what_is_not_a_number() {
        assert_eq!(quantile([3.0, f64::NAN, 1.0, 2.0].into_iter(), 0.5), Some(2.0));
        assert_eq!(quantile(std::iter::empty(), 0.5), None);
    }
}
