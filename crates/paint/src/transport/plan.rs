//! The answer: paths, prices, and the proof that no plan is cheaper.

use super::Problem;

/// Mass moved from one source to one target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Place of the source.
    pub source: u32,
    /// Place of the target.
    pub target: u32,
    /// Mass moved, more than 0.
    pub mass: f64,
}

/// An optimal plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Paths that carry mass, at most ns + nt − 1, by source, then target.
    pub paths: Vec<Path>,
    /// Price u_i of a unit of mass at each source.
    pub source_prices: Vec<f64>,
    /// Price v_j of a unit of mass at each target; `u_i + v_j ≤ w_ij`, equal along a path.
    pub target_prices: Vec<f64>,
    /// Steps of the simplex.
    pub pivots: usize,
}

/// What holds of a plan, computed anew from the problem as it was given. Costs and prices are in the unit of the costs.
///
/// By weak duality no plan costs less than `prices`, so a plan whose `gap` is rounding is optimal whoever made it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proof {
    /// `Σ w_ij x_ij`.
    pub cost: f64,
    /// `Σ p_i u_i + Σ q_j v_j`: no plan costs less, up to `infeasible` times the mass.
    pub prices: f64,
    /// `cost − prices`.
    pub gap: f64,
    /// Largest `u_i + v_j − w_ij`, 0 where none is positive (dual feasibility).
    pub infeasible: f64,
    /// Largest `|u_i + v_j − w_ij|` along a path (complementary slackness).
    pub slack: f64,
    /// Largest difference of a row or column from its mass, relative to the total.
    pub mass: f64,
    /// Largest cost: what `gap`, `infeasible` and `slack` are measured by.
    pub scale: f64,
}

impl Proof {
    /// Whether all of it holds to rounding: 1e-11 of the largest cost (per unit of mass for the gap), 1e-12 of the total mass.
    #[must_use]
    pub fn holds(&self, total_mass: f64) -> bool {
        let rounding = 1e-11 * self.scale;
        self.infeasible <= rounding
            && self.slack <= rounding
            && self.gap.abs() <= rounding * total_mass
            && self.mass <= 1e-12
    }
}

impl Plan {
    /// Total cost `Σ w_ij x_ij`: the distance between the two distributions (Wasserstein 1) where costs are distances and the masses sum to 1.
    #[must_use]
    pub fn cost(&self, problem: &Problem<'_>) -> f64 {
        let targets = problem.demand.len();
        self.paths
            .iter()
            .map(|p| p.mass * problem.costs.one(p.source as usize, p.target as usize, targets))
            .sum()
    }

    /// Checks the plan against the problem, all pairs.
    ///
    /// # Panics
    /// Never on the problem that the plan was made for; on another of fewer places it may.
    #[must_use]
    pub fn proof(&self, problem: &Problem<'_>) -> Proof {
        let targets = problem.demand.len();
        let cost = self.cost(problem);
        let weighted =
            |masses: &[f64], prices: &[f64]| -> f64 { masses.iter().zip(prices).map(|(m, p)| m * p).sum() };
        let prices =
            weighted(problem.supply, &self.source_prices) + weighted(problem.demand, &self.target_prices);
        let (mut infeasible, mut scale) = (0.0_f64, 0.0_f64);
        for (i, u) in self.source_prices.iter().enumerate() {
            for (j, v) in self.target_prices.iter().enumerate() {
                let w = problem.costs.one(i, j, targets);
                infeasible = infeasible.max(u + v - w);
                scale = scale.max(w.abs());
            }
        }
        let mut slack = 0.0_f64;
        let (mut rows, mut columns) = (problem.supply.to_vec(), problem.demand.to_vec());
        for p in &self.paths {
            let (i, j) = (p.source as usize, p.target as usize);
            rows[i] -= p.mass;
            columns[j] -= p.mass;
            let w = problem.costs.one(i, j, targets);
            slack = slack.max((self.source_prices[i] + self.target_prices[j] - w).abs());
        }
        let total: f64 = problem.supply.iter().sum();
        let mass = rows.iter().chain(&columns).fold(0.0_f64, |m, d| m.max(d.abs())) / total;
        Proof { cost, prices, gap: cost - prices, infeasible, slack, mass, scale }
    }
}
