//! A first basis: each source ships to the target that is cheapest for it beyond what every other source would pay there.

use super::costs::{LANES, Table};
use super::pricing::{row_least, row_place};

/// A cell of the basis and its flow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub row: u32,
    pub column: u32,
    pub flow: i64,
}

/// Scratch of the start.
#[derive(Debug, Default)]
pub(super) struct Start {
    offset: Vec<f64>,
    left: Vec<i64>,
    pub cells: Vec<Cell>,
}

impl Start {
    /// Fills `cells` with a feasible spanning tree of `supply.len() + demand.len() − 1` cells. The masses are perturbed, so a source
    /// and a target are never used up at once before the last cell.
    pub fn fill(&mut self, table: &Table, supply: &[i64], demand: &[i64]) {
        let (ns, nt) = (supply.len(), demand.len());
        self.cells.clear();
        self.left.clear();
        self.left.extend_from_slice(demand);
        // column reduction: −min_i w_ij
        self.offset.clear();
        self.offset.resize(table.stride, f64::INFINITY);
        for i in 0..ns {
            for (o, c) in self.offset.iter_mut().zip(table.row(i)) {
                *o = if *c < *o { *c } else { *o };
            }
        }
        for o in &mut self.offset[..nt] {
            *o = -*o;
        }
        self.offset[nt..].fill(0.0);
        debug_assert!(self.offset.len().is_multiple_of(LANES));
        for (i, mass) in supply.iter().enumerate() {
            let mut mass = *mass;
            let row = table.row(i);
            while mass > 0 {
                let least = row_least(row, &self.offset);
                let j = row_place(row, &self.offset, least);
                let flow = mass.min(self.left[j]);
                self.cells.push(Cell { row: i as u32, column: j as u32, flow });
                mass -= flow;
                self.left[j] -= flow;
                if self.left[j] == 0 {
                    self.offset[j] = f64::INFINITY;
                }
            }
        }
    }
}
