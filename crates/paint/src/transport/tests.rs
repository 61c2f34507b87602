//! Plans against a linear programming library, and against their own proofs.

use microlp::{ComparisonOp, OptimizationDirection, SolveOutcome};

use super::*;

/// Numbers of a seed (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// How a problem is awkward.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Random,
    /// Colours on a coarse lattice: ties and duplicates.
    Lattice,
    /// Each place holds as much as every other.
    EqualMasses,
    /// Many places without mass.
    ZeroMasses,
    /// A few texels only: subset sums coincide.
    SmallCounts,
    /// All places alike.
    OneColour,
    /// The same places and masses on both sides.
    OntoItself,
    /// Masses over fifteen orders of magnitude.
    Spread,
}

const KINDS: [Kind; 8] = [
    Kind::Random,
    Kind::Lattice,
    Kind::EqualMasses,
    Kind::ZeroMasses,
    Kind::SmallCounts,
    Kind::OneColour,
    Kind::OntoItself,
    Kind::Spread,
];

struct Made {
    supply: Vec<f64>,
    demand: Vec<f64>,
    from: Vec<[f64; 3]>,
    to: Vec<[f64; 3]>,
}

fn colours(kind: Kind, n: usize, numbers: &mut Numbers) -> Vec<[f64; 3]> {
    (0..n)
        .map(|_| match kind {
            Kind::Lattice => [0; 3].map(|_| numbers.below(3) as f64 * 10.0),
            Kind::OneColour => [40.0, -3.0, 7.0],
            _ => [100.0 * numbers.unit(), 80.0 * numbers.unit() - 40.0, 80.0 * numbers.unit() - 40.0],
        })
        .collect()
}

fn masses(kind: Kind, n: usize, numbers: &mut Numbers) -> Vec<f64> {
    let mut masses: Vec<f64> = (0..n)
        .map(|_| match kind {
            Kind::EqualMasses => 1.0,
            Kind::ZeroMasses => {
                if numbers.below(2) == 0 {
                    0.0
                } else {
                    numbers.unit()
                }
            }
            Kind::SmallCounts | Kind::Lattice => numbers.below(4) as f64,
            Kind::Spread => 10_f64.powf(-15.0 * numbers.unit()),
            _ => numbers.unit(),
        })
        .collect();
    masses[0] += 1.0;
    let total: f64 = masses.iter().sum();
    for m in &mut masses {
        *m /= total;
    }
    masses
}

fn made(kind: Kind, largest: usize, numbers: &mut Numbers) -> Made {
    let (ns, nt) = (1 + numbers.below(largest), 1 + numbers.below(largest));
    if matches!(kind, Kind::OntoItself) {
        let (supply, from) = (masses(kind, ns, numbers), colours(kind, ns, numbers));
        return Made { demand: supply.clone(), to: from.clone(), supply, from };
    }
    Made {
        supply: masses(kind, ns, numbers),
        demand: masses(kind, nt, numbers),
        from: colours(kind, ns, numbers),
        to: colours(kind, nt, numbers),
    }
}

impl Made {
    fn problem(&self) -> Problem<'_> {
        Problem {
            supply: &self.supply,
            demand: &self.demand,
            costs: Costs::Distances { from: &self.from, to: &self.to },
        }
    }
}

fn sound(plan: &Plan, problem: &Problem<'_>, what: &str) -> Proof {
    let proof = plan.proof(problem);
    let total: f64 = problem.supply.iter().sum();
    assert!(proof.holds(total), "{what}: {proof:?}");
    assert!(plan.paths.len() < problem.supply.len() + problem.demand.len(), "{what}");
    assert!(plan.paths.iter().all(|p| p.mass > 0.0), "{what}");
    proof
}

/// Cost of the cheapest plan by the library, and how much mass its plan creates or loses: it keeps rows to its own tolerance only, and
/// its cost can be off by that mass times the dearest path.
fn by_library(problem: &Problem<'_>) -> (f64, f64) {
    let (ns, nt) = (problem.supply.len(), problem.demand.len());
    let mut lp = microlp::Problem::new(OptimizationDirection::Minimize);
    let variables: Vec<Vec<_>> = (0..ns)
        .map(|i| (0..nt).map(|j| lp.add_var(problem.costs.one(i, j, nt), (0.0, f64::INFINITY))).collect())
        .collect();
    for (row, mass) in variables.iter().zip(problem.supply) {
        lp.add_constraint(row.iter().map(|v| (*v, 1.0)), ComparisonOp::Eq, *mass);
    }
    // the last one follows from the others; rounding of the totals must not make it impossible
    for j in 0..nt - 1 {
        lp.add_constraint(variables.iter().map(|v| (v[j], 1.0)), ComparisonOp::Eq, problem.demand[j]);
    }
    match lp.solve().expect("solvable") {
        SolveOutcome::Solution(s) => {
            let x = |i: usize, j: usize| s.var_value(variables[i][j]);
            let rows = (0..ns).map(|i| (0..nt).map(|j| x(i, j)).sum::<f64>() - problem.supply[i]);
            let columns = (0..nt).map(|j| (0..ns).map(|i| x(i, j)).sum::<f64>() - problem.demand[j]);
            let negative = (0..ns * nt).map(|k| x(k / nt, k % nt).min(0.0));
            (s.objective(), rows.chain(columns).chain(negative).map(f64::abs).sum())
        }
        SolveOutcome::Interrupted(_) => panic!("no limit was set"),
    }
}

#[test]
fn thousands_of_problems_cost_what_a_linear_programming_library_finds() {
    let mut numbers = Numbers(11);
    for round in 0..320 {
        for kind in KINDS {
            let made = made(kind, 12, &mut numbers);
            let problem = made.problem();
            let plan = Solver::new().solve(&problem).expect("a plan");
            let proof = sound(&plan, &problem, &format!("{kind:?} {round}"));
            let (library, lost) = by_library(&problem);
            assert!(lost < 1e-5, "{kind:?} {round}: the library loses {lost}");
            assert!(
                (proof.cost - library).abs() <= 1e-9 * (1.0 + library.abs()) + lost * proof.scale,
                "{kind:?} {round}: {} against {library} ± {}",
                proof.cost,
                lost * proof.scale
            );
        }
    }
}

#[test]
fn one_solver_proves_thousands_of_larger_problems_one_after_the_other() {
    let mut numbers = Numbers(12);
    let mut solver = Solver::new();
    for round in 0..250 {
        for kind in KINDS {
            let made = made(kind, 70, &mut numbers);
            let plan = solver.solve(&made.problem()).expect("a plan");
            sound(&plan, &made.problem(), &format!("{kind:?} {round}"));
        }
    }
}

#[test]
fn any_costs_will_do_negative_ones_too() {
    let mut numbers = Numbers(13);
    for round in 0..300 {
        let (ns, nt) = (1 + numbers.below(9), 1 + numbers.below(9));
        let costs: Vec<f64> = (0..ns * nt).map(|_| (numbers.below(21) as f64 - 10.0) * 3.0).collect();
        let (supply, demand) =
            (masses(Kind::SmallCounts, ns, &mut numbers), masses(Kind::Random, nt, &mut numbers));
        let problem = Problem { supply: &supply, demand: &demand, costs: Costs::Matrix(&costs) };
        let plan = Solver::new().solve(&problem).expect("a plan");
        let proof = sound(&plan, &problem, &format!("matrix {round}"));
        let (library, lost) = by_library(&problem);
        let bound = 1e-9 * (1.0 + library.abs()) + lost * proof.scale;
        assert!((proof.cost - library).abs() <= bound, "{round}: {proof:?} {library} {bound}");
    }
}

#[test]
fn a_paint_onto_itself_costs_nothing_and_moves_nothing() {
    let mut numbers = Numbers(14);
    let made = made(Kind::OntoItself, 60, &mut numbers);
    let plan = Solver::new().solve(&made.problem()).expect("a plan");
    assert!(plan.cost(&made.problem()) < 1e-12);
    assert!(plan.paths.iter().all(|p| p.source == p.target));
}

#[test]
fn larger_problems_and_all_threads_give_the_same_plans() {
    let mut numbers = Numbers(15);
    let made: Vec<Made> = (0..6)
        .map(|_| Made {
            supply: masses(Kind::Random, 300, &mut numbers),
            demand: masses(Kind::Random, 210, &mut numbers),
            from: colours(Kind::Random, 300, &mut numbers),
            to: colours(Kind::Random, 210, &mut numbers),
        })
        .collect();
    let problems: Vec<Problem<'_>> = made.iter().map(Made::problem).collect();
    let plans = solve_all(&problems, false).expect("plans");
    assert_eq!(plans, solve_all(&problems, true).expect("plans"));
    for (plan, problem) in plans.iter().zip(&problems) {
        sound(plan, problem, "300 × 210");
    }
}

#[test]
fn a_wrong_plan_has_no_proof() {
    let (supply, demand) = ([0.5, 0.5], [0.5, 0.5]);
    let costs = [0.0, 1.0, 1.0, 0.0];
    let problem = Problem { supply: &supply, demand: &demand, costs: Costs::Matrix(&costs) };
    let mut plan = Solver::new().solve(&problem).expect("a plan");
    assert!(plan.proof(&problem).holds(1.0));
    // the dear diagonal
    plan.paths[0].target = 1;
    plan.paths[1].target = 0;
    assert!(!plan.proof(&problem).holds(1.0));
    // prices that promise too much
    let mut plan = Solver::new().solve(&problem).expect("a plan");
    plan.source_prices[0] += 0.5;
    assert!(!plan.proof(&problem).holds(1.0));
}

#[test]
fn what_cannot_be_solved_says_why() {
    let error = |supply: &[f64], demand: &[f64], costs: &[f64]| {
        Solver::new().solve(&Problem { supply, demand, costs: Costs::Matrix(costs) }).expect_err("unsound")
    };
    assert_eq!(error(&[], &[1.0], &[]), TransportError::Empty { sources: 0, targets: 1 });
    assert_eq!(
        error(&[1.0, -0.5], &[0.5], &[1.0; 2]),
        TransportError::Mass { side: "source", place: 1, found: -0.5 }
    );
    assert!(matches!(error(&[1.0], &[f64::NAN], &[1.0]), TransportError::Mass { side: "target", .. }));
    assert_eq!(error(&[0.0], &[0.0], &[1.0]), TransportError::NoMass { side: "source" });
    assert_eq!(error(&[1.0], &[2.0], &[1.0]), TransportError::Unbalanced { supply: 1.0, demand: 2.0 });
    assert!(matches!(error(&[1.0], &[1.0], &[1.0, 2.0]), TransportError::Size { found: 2, .. }));
    assert!(matches!(
        error(&[1.0], &[0.5, 0.5], &[1.0, f64::INFINITY]),
        TransportError::Cost { source_place: 0, target_place: 1, .. }
    ));
    assert!(matches!(error(&[f64::MAX, f64::MAX], &[1.0], &[1.0; 2]), TransportError::Mass { .. }));
}
