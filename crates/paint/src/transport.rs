//! The exact transport problem: move one distribution onto another at the least cost, and prove that nothing is cheaper
//! (Golla & Klein 2018, eqs. 8–13).
//!
//! Minimise `Σ w_ij x_ij` over `x_ij ≥ 0` with `Σ_j x_ij = p_i` and `Σ_i x_ij = q_j`. The solver is a primal network simplex for
//! dense bipartite problems. Masses become integers, so flows are exact and rows and columns keep their mass to the last unit. Each source
//! is given one unit more than its mass and one target all of these (Orden's perturbation): then no basis is degenerate, each pivot lowers
//! the cost, and ties, duplicates and equal masses cannot make it cycle; the trees are the strongly feasible ones of Cunningham. The
//! extra units are smaller than the last digit of a mass and are rounded away at the end.
//!
//! A [`Plan`] carries its paths, at most ns + nt − 1, the prices (dual variables) and a [`Proof`] computed from the costs as they were given.

mod basis;
mod costs;
mod masses;
mod plan;
mod pricing;
mod solve;
mod start;

#[cfg(test)]
mod tests;

pub use costs::Costs;
pub use plan::{Path, Plan, Proof};
pub use solve::{Problem, Solver, solve_all};

/// Why a transport problem has no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransportError {
    /// A side without places.
    #[error("a transport problem needs places on both sides, found {sources} sources and {targets} targets")]
    Empty {
        /// Sources.
        sources: usize,
        /// Targets.
        targets: usize,
    },
    /// A mass that is none.
    #[error(
        "mass {found} at {side} {place} is not a finite number of at least 0; mend or leave out that place"
    )]
    Mass {
        /// `source` or `target`.
        side: &'static str,
        /// From 0.
        place: usize,
        /// As given.
        found: f64,
    },
    /// Nothing to move.
    #[error("all masses of the {side}s are 0, expected some mass to move")]
    NoMass {
        /// `source` or `target`.
        side: &'static str,
    },
    /// Totals that differ.
    #[error(
        "the sources hold {supply} and the targets {demand} in all; both must be equal: scale one of them"
    )]
    Unbalanced {
        /// Total of the sources.
        supply: f64,
        /// Total of the targets.
        demand: f64,
    },
    /// Another number of costs than places.
    #[error("{expected} costs are expected for {sources} sources and {targets} targets, found {found}")]
    Size {
        /// Sources times targets.
        expected: usize,
        /// Sources.
        sources: usize,
        /// Targets.
        targets: usize,
        /// Given.
        found: usize,
    },
    /// A cost that is not a finite number.
    #[error(
        "the cost from source {source_place} to target {target_place} is {found}, expected a finite number"
    )]
    Cost {
        /// From 0.
        source_place: usize,
        /// From 0.
        target_place: usize,
        /// As given.
        found: f64,
    },
    /// Costs so unlike each other that rounding decides.
    #[error(
        "no optimum within {pivots} steps: the costs span too many orders of magnitude (largest {largest}); scale them"
    )]
    Stalled {
        /// Steps taken.
        pivots: usize,
        /// Largest cost.
        largest: f64,
    },
}
