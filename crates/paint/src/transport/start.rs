//! A first basis, by regret (Vogel's rule on rows): the source that would lose most by missing its best target ships first.

use super::costs::{LANES, Table};
use super::pricing::{row_least, row_place, two_least};

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
    /// Infinite where a target is full.
    closed: Vec<f64>,
    left: Vec<i64>,
    mass: Vec<i64>,
    /// Costs of each source's best and second best open target.
    least: Vec<f64>,
    next: Vec<f64>,
    urgency: Vec<f64>,
    zeros: Vec<f64>,
    pub cells: Vec<Cell>,
}

impl Start {
    /// Fills `cells` with a feasible spanning tree of `supply.len() + demand.len() − 1` cells. The masses are perturbed, so a source
    /// and a target are never used up at once before the last cell.
    #[inline(always)]
    pub fn fill(&mut self, table: &Table, supply: &[i64], demand: &[i64]) {
        let ns = supply.len();
        self.cells.clear();
        self.left.clear();
        self.left.extend_from_slice(demand);
        self.closed.clear();
        self.closed.resize(table.stride, 0.0);
        self.mass.clear();
        self.mass.extend_from_slice(supply);
        let padded = ns.next_multiple_of(LANES);
        self.next.clear();
        self.least.clear();
        self.urgency.clear();
        self.urgency.resize(padded, f64::INFINITY);
        self.zeros.clear();
        self.zeros.resize(padded, 0.0);
        for i in 0..ns {
            let [least, next] = two_least(table.row(i), &self.closed);
            self.least.push(least);
            self.next.push(next);
            self.urgency[i] = urgency(least, next);
        }
        let mut open = ns;
        while open > 0 {
            let i = row_place(&self.urgency, &self.zeros, row_least(&self.urgency, &self.zeros));
            let j = row_place(table.row(i), &self.closed, self.least[i]);
            let flow = self.mass[i].min(self.left[j]);
            self.cells.push(Cell { row: i as u32, column: j as u32, flow });
            self.mass[i] -= flow;
            self.left[j] -= flow;
            if self.mass[i] == 0 {
                self.urgency[i] = f64::INFINITY;
                self.next[i] = f64::NEG_INFINITY;
                open -= 1;
            }
            if self.left[j] == 0 {
                self.closed[j] = f64::INFINITY;
                for k in 0..ns {
                    let row = table.row(k);
                    // its best or second target is gone, or one as dear as these
                    if row[j] <= self.next[k] {
                        let [least, next] = two_least(row, &self.closed);
                        self.least[k] = least;
                        self.next[k] = next;
                        self.urgency[k] = urgency(least, next);
                    }
                }
            }
        }
    }
}

/// Minus what it costs a source to be late: the difference of its second best target from its best.
#[inline(always)]
fn urgency(least: f64, next: f64) -> f64 {
    if next < f64::INFINITY { least - next } else { -f64::MAX }
}
