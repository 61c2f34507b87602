//! The simplex itself: price a block of rows, take the best path up, until no path is worth it.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::basis::Basis;
use super::costs::Table;
use super::masses::Units;
use super::plan::{Path, Plan};
use super::pricing::{row_least, row_place};
use super::start::Start;
use super::{Costs, TransportError};

/// A transport problem: masses on both sides, with equal totals, and what a unit costs on each path.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Masses of the sources, p_i ≥ 0.
    pub supply: &'a [f64],
    /// Masses of the targets, q_j ≥ 0.
    pub demand: &'a [f64],
    /// Costs w_ij.
    pub costs: Costs<'a>,
}

/// A solver with its scratch memory: nothing but the plan is allocated from the second problem on.
#[derive(Debug, Default)]
pub struct Solver {
    units: Units,
    table: Table,
    start: Start,
    basis: Basis,
    potentials: Vec<f64>,
}

/// Rows priced before the best of their paths is taken.
const BLOCK: usize = 7;

/// A path is taken up if it saves more than this part of the largest cost: below, rounding speaks.
const WORTH: f64 = 1e-13;

impl Solver {
    /// A solver without memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The cheapest plan.
    ///
    /// # Errors
    /// Sizes that do not fit, masses that are negative or not finite, totals that differ by more than 1e-9, costs that are not finite.
    /// Of smaller differences of the totals the sources are right.
    pub fn solve(&mut self, problem: &Problem<'_>) -> Result<Plan, TransportError> {
        let (sources, targets) = (problem.supply.len(), problem.demand.len());
        self.units.fill(problem.supply, problem.demand)?;
        problem.costs.check(sources, targets)?;
        let arch = Arch::new();
        arch.dispatch(Costing { table: &mut self.table, costs: problem.costs, targets, units: &self.units })?;
        self.perturb();
        let (ns, nt) = (self.units.supply.len(), self.units.demand.len());
        arch.dispatch(Starting { start: &mut self.start, table: &self.table, units: &self.units });
        self.basis.plant(ns, nt, &self.start.cells);
        // targets are padded to whole lanes; the padding costs infinitely much and is never chosen
        self.potentials.clear();
        self.potentials.resize(ns + self.table.stride, 0.0);
        let mut pivots = 0;
        loop {
            self.potentials_from_tree();
            let made = arch.dispatch(Improving { solver: self, before: pivots })?;
            pivots += made;
            // prices from the tree again, free of what many shifts have summed up: done when these too find nothing
            if made == 0 {
                break;
            }
        }
        Ok(self.plan(problem, pivots))
    }

    /// One unit more for each source, all of them for the last target.
    fn perturb(&mut self) {
        for m in &mut self.units.supply {
            *m += 1;
        }
        let all = self.units.supply.len() as i64;
        if let Some(last) = self.units.demand.last_mut() {
            *last += all;
        }
    }

    fn potentials_from_tree(&mut self) {
        let ns = self.basis.sources;
        for &x in self.basis.order() {
            let x = x as usize;
            self.potentials[x] = match self.basis.parent(x) {
                None => 0.0,
                Some(up) if x < ns => self.potentials[up] + self.table.row(x)[up - ns],
                Some(up) => self.potentials[up] - self.table.row(up)[x - ns],
            };
        }
    }

    /// Pivots until a whole round finds nothing worth taking up; their number.
    #[inline(always)]
    fn improve(&mut self, before: usize) -> Result<usize, TransportError> {
        let ns = self.basis.sources;
        let block = BLOCK.min(ns);
        let worth = -WORTH * self.table.largest * f64::from(u16::try_from(ns).unwrap_or(u16::MAX)).sqrt();
        let limit = 1_000 + 20 * self.table.values.len();
        let (mut row, mut idle, mut pivots) = (0, 0, 0);
        while idle < ns {
            let (mut best, mut best_row, mut best_least) = (worth, 0, 0.0);
            for _ in 0..block {
                let pi = &self.potentials[ns..];
                let least = row_least(self.table.row(row), pi);
                let reduced = least - self.potentials[row];
                if reduced < best {
                    (best, best_row, best_least) = (reduced, row, least);
                }
                row = if row + 1 == ns { 0 } else { row + 1 };
            }
            if best < worth {
                let column = row_place(self.table.row(best_row), &self.potentials[ns..], best_least);
                self.basis.pivot(best_row, ns + column, best, &mut self.potentials);
                pivots += 1;
                idle = 0;
                if before + pivots > limit {
                    return Err(TransportError::Stalled {
                        pivots: before + pivots,
                        largest: self.table.largest,
                    });
                }
            } else {
                idle += block;
            }
        }
        Ok(pivots)
    }

    /// The plan in the problem's places and masses.
    fn plan(&mut self, problem: &Problem<'_>, pivots: usize) -> Plan {
        let (sources, targets) = (problem.supply.len(), problem.demand.len());
        let (ns, room, unit) = (self.basis.sources, self.units.room, self.units.unit);
        let half = 1_i64 << (room - 1);
        let mut paths = Vec::with_capacity(self.basis.order().len());
        for &x in self.basis.order() {
            let x = x as usize;
            let Some(up) = self.basis.parent(x) else { continue };
            let whole = (self.basis.flow(x) + half) >> room;
            if whole > 0 {
                let (i, j) = if x < ns { (x, up - ns) } else { (up, x - ns) };
                let mass = whole as f64 * unit;
                paths.push(Path { source: self.units.rows[i], target: self.units.columns[j], mass });
            }
        }
        paths.sort_unstable_by_key(|p| (p.source, p.target));
        let mut plan = Plan {
            paths,
            source_prices: vec![f64::NAN; sources],
            target_prices: vec![f64::NAN; targets],
            pivots,
        };
        for (i, &row) in self.units.rows.iter().enumerate() {
            plan.source_prices[row as usize] = self.potentials[i];
        }
        for (j, &column) in self.units.columns.iter().enumerate() {
            plan.target_prices[column as usize] = -self.potentials[ns + j];
        }
        price_empty_places(problem, &mut plan);
        plan
    }
}

/// The loops over costs, compiled for the widest registers of the machine as well.
struct Costing<'a> {
    table: &'a mut Table,
    costs: Costs<'a>,
    targets: usize,
    units: &'a Units,
}

impl WithSimd for Costing<'_> {
    type Output = Result<(), TransportError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        self.table.fill(self.costs, self.targets, &self.units.rows, &self.units.columns)
    }
}

struct Starting<'a> {
    start: &'a mut Start,
    table: &'a Table,
    units: &'a Units,
}

impl WithSimd for Starting<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.start.fill(self.table, &self.units.supply, &self.units.demand);
    }
}

struct Improving<'a> {
    solver: &'a mut Solver,
    before: usize,
}

impl WithSimd for Improving<'_> {
    type Output = Result<usize, TransportError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        self.solver.improve(self.before)
    }
}

/// Places without mass take the highest price that stays feasible: they prove nothing wrong and move nothing.
fn price_empty_places(problem: &Problem<'_>, plan: &mut Plan) {
    let targets = problem.demand.len();
    for i in 0..plan.source_prices.len() {
        if plan.source_prices[i].is_nan() {
            plan.source_prices[i] = (0..targets)
                .filter(|&j| !plan.target_prices[j].is_nan())
                .map(|j| problem.costs.one(i, j, targets) - plan.target_prices[j])
                .fold(f64::INFINITY, f64::min);
        }
    }
    for j in 0..targets {
        if plan.target_prices[j].is_nan() {
            plan.target_prices[j] = (0..plan.source_prices.len())
                .map(|i| problem.costs.one(i, j, targets) - plan.source_prices[i])
                .fold(f64::INFINITY, f64::min);
        }
    }
}

/// Plans of many problems, on all threads of the pool where `threads` is set, in their order.
///
/// # Errors
/// Of the first problem that has one.
pub fn solve_all(problems: &[Problem<'_>], threads: bool) -> Result<Vec<Plan>, TransportError> {
    if threads {
        problems.par_iter().map_init(Solver::new, |solver, p| solver.solve(p)).collect()
    } else {
        let mut solver = Solver::new();
        problems.iter().map(|p| solver.solve(p)).collect()
    }
}
