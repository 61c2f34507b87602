//! What every cell holds of a lobe, for every width at once: the sums Σ w k t^j of its nodes over the bins of u.
//!
//! They depend on grid, lamp and kind of lobe alone, never on data; so they are made once per angle of incidence and kept for the next fit.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use gonio_brdf::{
    Grid, Meaning,
    average::{CellBounds, every_lobe_nodes, is_cap},
};
use gonio_optics::{Angle, Vec3};
use rayon::prelude::*;

use super::{
    axis::{ORDER, place, powers},
    kernel,
};
use crate::{ray::Sample, term::Term};

/// Largest rate x a cell is sampled for.
const LARGEST: f64 = 8.2e3;
/// Grids kept.
const KEPT: usize = 6;

/// What one cell holds in one bin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub cell: u32,
    pub bin: u32,
    /// Sums of P.
    pub p: [f64; ORDER],
    /// Sums of Q.
    pub q: [f64; ORDER],
}

/// The entries of many cells, cell after cell, bins ascending.
pub(crate) type Entries = Vec<Entry>;

fn push(entries: &mut Entries, from: usize, cell: u32, (weight, u, k, m): (f64, f64, f64, f64)) {
    let (bin, t) = place(u);
    let bin = bin as u32;
    let at = match entries[from..].iter().position(|e| e.bin == bin) {
        Some(i) => from + i,
        None => {
            entries.push(Entry { cell, bin, p: [0.0; ORDER], q: [0.0; ORDER] });
            entries.len() - 1
        }
    };
    let e = &mut entries[at];
    for (j, t) in powers(t).into_iter().enumerate() {
        e.p[j] += weight * k * t;
        e.q[j] += weight * k * m * t;
    }
}

/// A lobe and the index of the coat it is seen through.
type Lobe = (Term, Option<f64>);

fn of_direction(
    entries: &mut Entries,
    from: usize,
    cell: u32,
    (term, index): Lobe,
    (w, l, v): (f64, Vec3, Vec3),
) {
    if let Some(s) = Sample::new(w, l, v)
        && let Some((u, k, m)) = kernel::at(term, &s.ray(index))
    {
        push(entries, from, cell, (s.weight, u, k, m));
    }
}

/// The entries of one cell of a grid, by the place of its coordinates.
fn of_cell(
    entries: &mut Entries,
    (grid, meaning): (&Grid, Meaning),
    lobe: Lobe,
    (cell, [ti, to, phi]): (u32, [usize; 3]),
) {
    let from = entries.len();
    match meaning {
        Meaning::Node => {
            let (l, v) = grid.geometry(ti, to, phi).directions();
            of_direction(entries, from, cell, lobe, (1.0, l, v));
        }
        Meaning::CellMean { lamp_half_angle } => {
            let bounds = CellBounds::of(grid, lamp_half_angle, [ti, to, phi]);
            every_lobe_nodes(&bounds, kernel::sharpness(lobe.0, LARGEST), &mut |w, l, v| {
                of_direction(entries, from, cell, lobe, (w, l, v));
            });
            entries[from..].sort_by_key(|e| e.bin);
        }
    }
}

/// The entries of some cells of a grid, made for once: `cell` counts them.
pub(crate) fn of_some(grid: &Grid, meaning: Meaning, lobe: Lobe, places: &[u32]) -> Entries {
    places
        .par_iter()
        .enumerate()
        .with_min_len(64)
        .map(|(cell, &place)| {
            let mut out = Entries::new();
            of_cell(&mut out, (grid, meaning), lobe, (cell as u32, grid.coordinates(place as usize)));
            out
        })
        .collect::<Vec<Entries>>()
        .concat()
}

/// The entries of values at points.
pub(crate) fn of_points(points: &[(Vec3, Vec3)], lobe: Lobe) -> Entries {
    let mut out = Vec::with_capacity(points.len());
    for (cell, &(l, v)) in points.iter().enumerate() {
        let from = out.len();
        of_direction(&mut out, from, cell as u32, lobe, (1.0, l, v));
    }
    out
}

/// The entries of a grid, made per angle of incidence when first asked for.
#[derive(Debug)]
pub(crate) struct GridEntries {
    grid: Grid,
    meaning: Meaning,
    lobe: Lobe,
    limit: Angle,
    rows: Vec<OnceLock<Entries>>,
}

impl GridEntries {
    /// The entries of one angle of incidence; cells are `to · azimuths + phi`.
    ///
    /// They are made outside the lock: a thread that waits for its part of them may take up another fit of the same grid, which would wait for itself.
    pub(crate) fn row(&self, ti: usize) -> &[Entry] {
        let Some(slot) = self.rows.get(ti) else { return &[] };
        if let Some(made) = slot.get() {
            return made;
        }
        let made = self.make(ti);
        slot.get_or_init(|| made)
    }

    fn make(&self, ti: usize) -> Entries {
        let [_, no, np] = self.grid.shape();
        let limit = self.limit.degrees() + 1e-9;
        (0..no)
            .into_par_iter()
            .filter(|&to| self.grid.theta_o_deg[to] <= limit)
            .map(|to| {
                let mut out = Entries::new();
                // the cap is one cell and enters under its first azimuth, whichever that is
                let cap = is_cap(&self.grid, to) && matches!(self.meaning, Meaning::CellMean { .. });
                for phi in 0..np {
                    let cell = (to * np + phi) as u32;
                    if cap && phi > 0 {
                        let first: Entries =
                            out.iter().filter(|e| e.cell == (to * np) as u32).copied().collect();
                        out.extend(first.into_iter().map(|e| Entry { cell, ..e }));
                        continue;
                    }
                    of_cell(&mut out, (&self.grid, self.meaning), self.lobe, (cell, [ti, to, phi]));
                }
                out
            })
            .collect::<Vec<Entries>>()
            .concat()
    }
}

/// The entries for a grid, made or found.
pub(crate) fn of_grid(grid: &Grid, meaning: Meaning, (term, index): Lobe, limit: Angle) -> Arc<GridEntries> {
    static STORE: Mutex<Vec<Arc<GridEntries>>> = Mutex::new(Vec::new());
    // the two Ashikhmin–Shirley terms share their kernel
    let lobe = (if term == Term::AshikhminFresnel { Term::Ashikhmin } else { term }, index);
    let mut store = STORE.lock().unwrap_or_else(PoisonError::into_inner);
    let serves =
        |e: &Arc<GridEntries>| e.lobe == lobe && e.meaning == meaning && e.limit == limit && e.grid == *grid;
    if let Some(at) = store.iter().position(serves) {
        let found = store.remove(at);
        store.push(Arc::clone(&found));
        return found;
    }
    if store.len() >= KEPT {
        store.remove(0);
    }
    let rows = (0..grid.theta_i_deg.len()).map(|_| OnceLock::new()).collect();
    let made = Arc::new(GridEntries { grid: grid.clone(), meaning, lobe, limit, rows });
    store.push(Arc::clone(&made));
    made
}
