//! The exact transport of 600 pairs of slices with 50 clusters each, against the fastest min-cost-flow solver of the registry.
//!
//! `cargo bench -p gonio-paint --bench transport`
//!
//! Centres are uniform in a box of Lab, masses uniform and normalised. Ours is timed from masses and centres to plans, costs included; the
//! peer (a network simplex, its graph built beforehand, memory kept, the best of its number types and pricing rules) from balances and
//! ready costs to the optimum. Rounds alternate in one process on one thread; the least times are compared.

#![allow(clippy::print_stdout)]

use std::time::Instant;

use gonio_paint::transport::{Costs, Plan, Problem, Solver, solve_all};
use rs_graph::mcf::NetworkSimplex;
use rs_graph::mcf::simplex::Pricing;
use rs_graph::traits::{FiniteGraph, IndexGraph};
use rs_graph::{Net, classes};

const SLICES: usize = 600;
const CLUSTERS: usize = 50;
const ROUNDS: usize = 15;

struct Slices {
    masses: Vec<[Vec<f64>; 2]>,
    centres: Vec<[Vec<[f64; 3]>; 2]>,
}

fn slices() -> Slices {
    let mut state = 7_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as f64 + 0.5) / (1_u64 << 31) as f64
    };
    let mut made = Slices { masses: Vec::new(), centres: Vec::new() };
    for _ in 0..SLICES {
        made.masses.push([0, 1].map(|_| {
            let m: Vec<f64> = (0..CLUSTERS).map(|_| unit()).collect();
            let total: f64 = m.iter().sum();
            m.into_iter().map(|m| m / total).collect()
        }));
        made.centres.push([0, 1].map(|_| {
            (0..CLUSTERS).map(|_| [100.0 * unit(), 80.0 * unit() - 40.0, 80.0 * unit() - 40.0]).collect()
        }));
    }
    made
}

fn problems(s: &Slices) -> Vec<Problem<'_>> {
    s.masses
        .iter()
        .zip(&s.centres)
        .map(|([supply, demand], [from, to])| Problem {
            supply,
            demand,
            costs: Costs::Distances { from, to },
        })
        .collect()
}

fn distance(p: [f64; 3], q: [f64; 3]) -> f64 {
    (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
}

/// The peer on floating-point numbers or on integers: costs and masses scaled by `cost` and `mass`.
fn peer<F>(s: &Slices, simplex: &mut NetworkSimplex<&Net, F>, number: impl Fn(f64) -> F) -> (f64, f64)
where
    F: num_traits::Bounded
        + num_traits::NumCast
        + num_traits::NumAssign
        + num_traits::FromPrimitive
        + num_traits::Signed
        + PartialOrd
        + Copy,
{
    let (mut seconds, mut total) = (0.0, 0.0);
    for (masses, centres) in s.masses.iter().zip(&s.centres) {
        let costs: Vec<F> =
            centres[0].iter().flat_map(|p| centres[1].iter().map(|q| number(distance(*p, *q)))).collect();
        let mut balances: Vec<F> = masses[0].iter().map(|m| number(*m)).collect();
        balances.extend(masses[1].iter().map(|m| number(-*m)));
        // integers must sum to nothing
        let sum = balances.iter().fold(F::zero(), |sum, b| sum + *b);
        balances[0] -= sum;
        let start = Instant::now();
        let graph = *simplex.as_graph();
        simplex.set_balances(|u| balances[graph.node_id(u)]);
        // this one makes it start anew; `set_balances` alone does not
        if let Some(u) = graph.nodes().next() {
            simplex.set_balance(u, balances[graph.node_id(u)]);
        }
        simplex.set_costs(|e| costs[graph.edge_id(e)]);
        simplex.solve();
        seconds += start.elapsed().as_secs_f64();
        total += simplex.value().to_f64().unwrap_or(f64::NAN);
    }
    (seconds, total)
}

fn ours(s: &Slices, threads: bool) -> (f64, Vec<Plan>) {
    let problems = problems(s);
    let start = Instant::now();
    let plans = solve_all(&problems, threads).expect("plans");
    (start.elapsed().as_secs_f64(), plans)
}

fn main() {
    let s = slices();
    let graph: Net = classes::complete_bipartite(CLUSTERS, CLUSTERS);
    assert_eq!(graph.num_edges(), CLUSTERS * CLUSTERS);
    let mut times: Vec<(&str, f64, f64)> = Vec::new();
    let mut least = |name: &'static str, seconds: f64, cost: f64| match times.iter_mut().find(|t| t.0 == name)
    {
        Some(t) => t.1 = t.1.min(seconds),
        None => times.push((name, seconds, cost)),
    };
    let scale = 1e6;
    let mut pivots = 0;
    for _ in 0..ROUNDS {
        let (t, plans) = ours(&s, false);
        pivots = plans.iter().map(|p| p.pivots).sum::<usize>() / plans.len();
        let cost = plans.iter().zip(problems(&s)).map(|(plan, p)| plan.cost(&p)).sum();
        least("gonio, one thread", t, cost);
        least("gonio, all threads", ours(&s, true).0, cost);
        let mut solver = Solver::new();
        let start = Instant::now();
        for p in problems(&s) {
            let plan = solver.solve(&p).expect("a plan");
            assert!(plan.proof(&p).holds(1.0));
        }
        least("gonio, one thread, with the proof checked", start.elapsed().as_secs_f64(), cost);
        let mut float = NetworkSimplex::new(&graph);
        float.zero = 1e-12;
        float.infinite = f64::INFINITY;
        float.set_uppers(|_| f64::INFINITY);
        for (name, pricing) in
            [("rs-graph f64, block", Pricing::Block), ("rs-graph f64, round robin", Pricing::RoundRobin)]
        {
            float.pricing = pricing;
            let (t, cost) = peer(&s, &mut float, |x| x);
            least(name, t, cost);
        }
        let mut whole = NetworkSimplex::new(&graph);
        whole.set_uppers(|_| i64::MAX);
        for (name, pricing) in
            [("rs-graph i64, block", Pricing::Block), ("rs-graph i64, round robin", Pricing::RoundRobin)]
        {
            whole.pricing = pricing;
            let (t, cost) = peer(&s, &mut whole, |x| (x * scale).round() as i64);
            least(name, t, cost / (scale * scale));
        }
    }
    let exact = times[0].2;
    let mut best_peer = f64::INFINITY;
    for (name, seconds, cost) in &times {
        let each = seconds / SLICES as f64 * 1e6;
        let optimal = (cost / exact - 1.0).abs() < 1e-5;
        let note = if optimal { "" } else { ", not optimal: out of the race" };
        println!(
            "{name:44} {:8.2} ms, {each:6.1} µs each, mean cost {:.9}{note}",
            seconds * 1e3,
            cost / SLICES as f64
        );
        assert!(*cost > exact * (1.0 - 1e-5), "{name} found a cheaper plan than ours");
        if optimal && name.starts_with("rs-graph") {
            best_peer = best_peer.min(*seconds);
        }
    }
    println!("pivots a problem: {pivots}");
    println!("ratio, one thread, to the best peer: {:.3} (wanted: at most 0.5)", times[0].1 / best_peer);
}
