//! Simulated annealing over a box (Kirkpatrick et al. 1983; the crate `argmin`), to compare with: it needs no start values either, but
//! thousands of evaluations, and finds the minimum to a few digits with a probability, not for certain.

use std::sync::{Mutex, PoisonError};

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::simulatedannealing::{Anneal, SATempFunc, SimulatedAnnealing};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{RngCore, SeedableRng};

use crate::{Fit, Observations, Options, fit::fit_by, solve};

/// How long and how hot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnnealOptions {
    /// Evaluations of the objective.
    pub iterations: u64,
    /// Of the moves and of their acceptance: the same seed gives the same result.
    pub seed: u64,
    /// Times it is heated up again.
    pub reheats: u64,
}

impl Default for AnnealOptions {
    fn default() -> Self {
        Self { iterations: 2000, seed: 1, reheats: 3 }
    }
}

/// What annealing found.
#[derive(Clone, Debug, PartialEq)]
pub struct Annealed {
    /// Place of the lowest value met.
    pub at: Vec<f64>,
    /// That value.
    pub value: f64,
    /// Evaluations.
    pub evaluations: u64,
}

/// Fits `options.model` by annealing over its nonlinear parameters, the colours solved for inside as [`crate::fit`] does; no refinement follows.
///
/// Robust losses are not iterated here: the squares count. `ModelChoice::Auto` is the simplified Ashikhmin–Shirley model.
#[must_use]
pub fn fit_by_annealing(obs: &Observations, options: &Options, how: AnnealOptions) -> Fit {
    fit_by(obs, options, options.model, &|family| {
        let (bounds, objective) = solve::objective(obs, options, family);
        // a model without nonlinear parameters has nothing to search
        let q = anneal(&bounds, how, &objective)
            .map_or_else(|| bounds.iter().map(|b| 0.5 * (b.0 + b.1)).collect(), |found| found.at);
        solve::at(obs, options, family, &q, None, true)
    })
}

/// An objective on the unit box; its value scaled so that 1 is what the middle has.
struct Boxed<'a, F> {
    objective: &'a F,
    bounds: &'a [(f64, f64)],
    unit: f64,
    random: Mutex<Xoshiro256PlusPlus>,
}

fn place(bounds: &[(f64, f64)], x: &[f64]) -> Vec<f64> {
    bounds.iter().zip(x).map(|((low, high), t)| low + (high - low) * t).collect()
}

impl<F: Fn(&[f64]) -> f64> CostFunction for Boxed<'_, F> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let value = (self.objective)(&place(self.bounds, x)) / self.unit;
        // the logarithm: a fall by a factor weighs the same anywhere, so one temperature serves all data
        Ok(if value.is_finite() { value.max(1e-300).ln() } else { f64::MAX })
    }
}

impl<F: Fn(&[f64]) -> f64> Anneal for Boxed<'_, F> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;
    type Float = f64;
    /// A step of up to half the box at temperature 1, smaller as it cools, reflected at the walls.
    fn anneal(&self, x: &Vec<f64>, temperature: f64) -> Result<Vec<f64>, Error> {
        let mut random = self.random.lock().unwrap_or_else(PoisonError::into_inner);
        let reach = 0.5 * temperature.clamp(1e-6, 1.0);
        Ok(x.iter()
            .map(|t| {
                let u = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
                let y = (t + reach * (2.0 * u - 1.0)).abs();
                if y > 1.0 { 2.0 - y } else { y }
            })
            .collect())
    }
}

/// Looks for the minimum of `objective` (not below 0) within `bounds`, from their middle. Values that are not finite are never accepted as best.
///
/// `None` where there is no dimension, a bound is not finite, or no finite value was met.
pub fn anneal<F: Fn(&[f64]) -> f64>(
    bounds: &[(f64, f64)],
    options: AnnealOptions,
    objective: &F,
) -> Option<Annealed> {
    let usable = bounds.iter().all(|(a, b)| a.is_finite() && b.is_finite() && a <= b);
    if bounds.is_empty() || !usable {
        return None;
    }
    let middle = vec![0.5; bounds.len()];
    let first = objective(&place(bounds, &middle));
    let unit = if first.is_finite() && first > 0.0 { first } else { 1.0 };
    let random = Mutex::new(Xoshiro256PlusPlus::seed_from_u64(options.seed ^ 0x5bd1_e995));
    let problem = Boxed { objective, bounds, unit, random };
    let period = (options.iterations / (options.reheats + 1)).max(1);
    let solver = SimulatedAnnealing::new_with_rng(1.0, Xoshiro256PlusPlus::seed_from_u64(options.seed))
        .ok()?
        // cold (1e-5) at the end of each period
        .with_temp_func(SATempFunc::Exponential(1e-5f64.powf(1.0 / period as f64)))
        .with_reannealing_fixed(period);
    let run = Executor::new(problem, solver)
        .configure(|state| state.param(middle).max_iters(options.iterations))
        .run()
        .ok()?;
    let best = run.state.best_param?;
    let value = objective(&place(bounds, &best));
    value.is_finite().then(|| Annealed {
        at: place(bounds, &best),
        value,
        evaluations: options.iterations + 2,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deeper_of_two_valleys_is_found_and_the_same_seed_gives_the_same() {
        // deep at (2, −1), wide and shallow at (−3, 3), which the middle of the box is on the slope of
        let f = |x: &[f64]| {
            let (a, b) = (x[0] - 2.0, x[1] + 1.0);
            let (c, d) = (x[0] + 3.0, x[1] - 3.0);
            2.0 - (-(a * a + b * b)).exp() * 1.9 - (-0.2 * (c * c + d * d)).exp()
        };
        let bounds = [(-5.0, 5.0), (-5.0, 5.0)];
        let found = anneal(&bounds, AnnealOptions::default(), &f).unwrap();
        assert!((found.at[0] - 2.0).abs() < 0.05 && (found.at[1] + 1.0).abs() < 0.05, "{found:?}");
        assert_eq!(anneal(&bounds, AnnealOptions::default(), &f).unwrap(), found);
    }

    #[test]
    fn nothing_to_find_is_no_result() {
        assert!(anneal(&[], AnnealOptions::default(), &|_: &[f64]| 1.0).is_none());
        assert!(anneal(&[(0.0, f64::NAN)], AnnealOptions::default(), &|_: &[f64]| 1.0).is_none());
        assert!(anneal(&[(0.0, 1.0)], AnnealOptions::default(), &|_: &[f64]| f64::NAN).is_none());
        let flat = anneal(&[(0.0, 1.0)], AnnealOptions::default(), &|_: &[f64]| 0.0).unwrap();
        assert!((0.0..=1.0).contains(&flat.at[0]));
    }
}
