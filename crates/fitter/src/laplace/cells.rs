//! What every row holds: its entries over the bins, its diffuse term, and the gloss of its coat.

use gonio_brdf::Meaning;

use super::measure::{self, Entry};
use crate::{
    Observations, Options, family::Family, nodes::Nodes, observations::Source, ray::reflectance, rows::Rows,
    term::Term,
};

/// The entries of the rows, in their order, of a lobe under a coat of `index` (or none); `kept` for the next fit on the same grid.
pub(super) fn gather(
    obs: &Observations,
    options: &Options,
    (term, index): (Term, Option<f64>),
    rows: &Rows,
    kept: bool,
) -> (Vec<Entry>, Vec<u32>) {
    let mut entries = Vec::with_capacity(rows.len());
    let mut start = Vec::with_capacity(rows.len() + 1);
    start.push(0);
    let mut take = |all: &[Entry], cell: u32, at: &mut usize| {
        // entries and rows run in the same order
        while all.get(*at).is_some_and(|e| e.cell < cell) {
            *at += 1;
        }
        while let Some(e) = all.get(*at).filter(|e| e.cell == cell) {
            entries.push(*e);
            *at += 1;
        }
        start.push(entries.len() as u32);
    };
    match &obs.source {
        Source::Grid(grid, meaning) if kept => {
            let made = measure::of_grid(grid, *meaning, (term, index), options.max_angle);
            let (mut incidence, mut at) = (u32::MAX, 0);
            let mut all: &[Entry] = &[];
            for row in &rows.rows {
                if row.datum.row != incidence {
                    (incidence, at) = (row.datum.row, 0);
                    all = made.row(incidence as usize);
                }
                take(all, row.datum.cell, &mut at);
            }
        }
        Source::Grid(grid, meaning) => {
            let places: Vec<u32> = rows.rows.iter().map(|r| r.datum.place).collect();
            let all = measure::of_some(grid, *meaning, (term, index), &places);
            let mut at = 0;
            for row in 0..rows.len() {
                take(&all, row as u32, &mut at);
            }
        }
        Source::Points(points) => {
            let all = measure::of_points(points, (term, index));
            let mut at = 0;
            for row in &rows.rows {
                take(&all, row.datum.cell, &mut at);
            }
        }
    }
    (entries, start)
}

/// The diffuse term of every row, seen through the coat if there is one.
pub(super) fn diffuse(obs: &Observations, family: &Family, index: Option<f64>, rows: &Rows) -> Vec<f64> {
    let term = family.parts[0].term;
    if term == Term::Lambert && index.is_none() {
        return vec![std::f64::consts::FRAC_1_PI; rows.len()];
    }
    let smooth = matches!(obs.source, Source::Grid(_, Meaning::CellMean { .. }));
    let nodes = Nodes::new(obs, rows, if smooth { 1.0 } else { 0.0 }, index, false);
    (0..rows.len()).map(|r| nodes.rays(r).map(|(w, ray)| w * term.value(&[0.0; 3], ray)).sum()).collect()
}

/// The gloss of every row; empty where there is no coat or nothing glosses.
pub(super) fn gloss(obs: &Observations, index: Option<f64>, rows: &Rows) -> Vec<f64> {
    let Some(index) = index.filter(|_| obs.averages()) else { return Vec::new() };
    let nodes = Nodes::new(obs, rows, 0.0, Some(index), true);
    nodes.gloss.iter().map(|&(share, cos)| share * reflectance(cos, index)).collect()
}
