//! Lobe means of the last few grids, so that the fit after each captured pose pays for the new row of cells alone.
//!
//! A process-wide store: the nodes depend on grid, lamp and limit only, never on data, so results do not depend on what is in it.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use gonio_brdf::{Grid, Meaning, average::lobe::LobeCells};
use gonio_optics::Angle;

/// Grids kept.
const KEPT: usize = 3;
/// Step of the coarse search in ln n.
const STEP: f64 = 0.5;
/// Number of its exponents: 1 … e^9 ≈ 8.1e3.
pub(crate) const KNOTS: usize = 19;

/// Exponent of a knot of the coarse search.
pub(crate) fn knot(k: usize) -> f64 {
    (STEP * k as f64).exp()
}

/// Lobe means at the knots, for one grid.
#[derive(Debug)]
pub(crate) struct Lobes {
    pub cells: LobeCells,
    rows: usize,
    /// `[knot][row]` → (P, Q) of every cell.
    at_knots: Vec<OnceLock<Vec<(f64, f64)>>>,
}

impl Lobes {
    fn new(grid: &Grid, meaning: Meaning, limit: Angle) -> Self {
        let rows = grid.theta_i_deg.len();
        Self {
            cells: LobeCells::new(grid.clone(), meaning, limit),
            rows,
            at_knots: (0..KNOTS * rows).map(|_| OnceLock::new()).collect(),
        }
    }

    /// (P, Q) of the cells of a row at a knot.
    pub(crate) fn at_knot(&self, k: usize, row: usize) -> &[(f64, f64)] {
        match self.at_knots.get(k * self.rows + row) {
            Some(slot) if row < self.rows => slot.get_or_init(|| {
                let nodes = self.cells.row(row, knot(k));
                (0..nodes.len()).map(|c| nodes.value(c, knot(k))).collect()
            }),
            _ => &[],
        }
    }
}

/// The lobe means for a grid, made or found.
pub(crate) fn lobes(grid: &Grid, meaning: Meaning, limit: Angle) -> Arc<Lobes> {
    static STORE: Mutex<Vec<Arc<Lobes>>> = Mutex::new(Vec::new());
    let mut store = STORE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(at) = store.iter().position(|l| l.cells.serves(grid, meaning, limit)) {
        let found = store.remove(at);
        store.push(Arc::clone(&found));
        return found;
    }
    if store.len() >= KEPT {
        store.remove(0);
    }
    let made = Arc::new(Lobes::new(grid, meaning, limit));
    store.push(Arc::clone(&made));
    made
}
