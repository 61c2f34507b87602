//! A whole fit of Sopp's grid (17,856 directions up to 75°, three channels) against the named baseline `node-levenberg-marquardt`: the same seven
//! parameters by plain Levenberg–Marquardt (Sopp 4.8, analytic derivatives 4.29) on node values, from his usual start n = 25.
//! The baseline averages nothing over cells and gives parameters only; the fit also gives covariance and colour differences.
//!
//! `cargo bench -p gonio-fitter` prints criterion's times and then the ratio of medians.
#![allow(missing_docs, clippy::print_stdout)]

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group};
use gonio_brdf::{
    Brdf, Flag, Grid, Meaning, Measured, average::lobe::LobeCells, models::AshikhminShirleySimplified,
};
use gonio_fitter::{Observations, Options, Weights, fit};
use gonio_optics::{Angle, Vec3};
use nalgebra::{SMatrix, SVector};

const TRUTH: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.1, 0.2, 0.3], specular: [0.06, 0.05, 0.04], exponent: 410.0 };
const LAMP: Meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };

/// Cell means of the truth with 2 % of deterministic ripple.
fn cell_means() -> Measured {
    let grid = Grid::sopp();
    let lobes = LobeCells::new(grid.clone(), LAMP, Angle::RIGHT);
    let mut m = Measured::empty(grid, LAMP);
    for i in 0..m.grid.len() {
        let [ti, to, phi] = m.grid.coordinates(i);
        let (p, _) = lobes.row(ti, TRUTH.exponent).value(to * 36 + phi, TRUTH.exponent);
        let ripple = 1.0 + 0.02 * (1.7 * i as f64).sin();
        m.values[i] = std::array::from_fn(|c| {
            (ripple * (TRUTH.diffuse[c] * std::f64::consts::FRAC_1_PI + TRUTH.specular[c] * p)) as f32
        });
        m.flag[i] = Flag::Measured;
    }
    m
}

/// One datum of the baseline: light, view, values.
type Node = (Vec3, Vec3, [f64; 3]);

fn nodes() -> Vec<Node> {
    let grid = Grid::sopp();
    (0..grid.len())
        .filter_map(|i| {
            let [ti, to, phi] = grid.coordinates(i);
            let g = grid.geometry(ti, to, phi);
            let (l, v) = g.directions();
            let ripple = 1.0 + 0.02 * (1.7 * i as f64).sin();
            (g.theta_i.degrees() <= 75.0 && g.theta_o.degrees() <= 75.0)
                .then(|| (l, v, TRUTH.eval(l, v).map(|f| f * ripple)))
        })
        .collect()
}

/// Parameters: ln n, cd, cs.
fn levenberg_marquardt(data: &[Node]) -> ([f64; 7], usize) {
    let mut x = [25f64.ln(), 0.1, 0.1, 0.1, 0.1, 0.1, 0.1];
    let squares = |x: &[f64; 7]| {
        let mut s = 0.0;
        for (l, v, y) in data {
            let lobe = AshikhminShirleySimplified::lobe(x[0].exp(), *l, *v);
            for c in 0..3 {
                s += (y[c] - x[1 + c] * std::f64::consts::FRAC_1_PI - x[4 + c] * lobe).powi(2);
            }
        }
        s
    };
    let (mut best, mut lambda, mut iterations) = (squares(&x), 1e-3, 0);
    while iterations < 500 {
        iterations += 1;
        let mut a = SMatrix::<f64, 7, 7>::zeros();
        let mut b = SVector::<f64, 7>::zeros();
        let n = x[0].exp();
        for (l, v, y) in data {
            let lobe = AshikhminShirleySimplified::lobe(n, *l, *v);
            let nh = (*l + *v).normalized().z.max(1e-4);
            for c in 0..3 {
                let r = y[c] - x[1 + c] * std::f64::consts::FRAC_1_PI - x[4 + c] * lobe;
                let mut j = SVector::<f64, 7>::zeros();
                j[0] = n * x[4 + c] * lobe * (1.0 / (n + 1.0) + nh.ln());
                j[1 + c] = std::f64::consts::FRAC_1_PI;
                j[4 + c] = lobe;
                a += j * j.transpose();
                b += j * r;
            }
        }
        let mut damped = a;
        for i in 0..7 {
            damped[(i, i)] *= 1.0 + lambda;
        }
        let Some(step) = damped.lu().solve(&b) else { break };
        let trial: [f64; 7] = std::array::from_fn(|i| x[i] + step[i]);
        let s = squares(&trial);
        if s < best {
            let gain = (best - s) / best;
            (x, best) = (trial, s);
            lambda = (lambda * 0.5f64).max(1e-4);
            if gain < 1e-9 {
                break;
            }
        } else {
            lambda *= 2.0;
            if lambda > 1.0 {
                break;
            }
        }
    }
    (x, iterations)
}

fn options() -> Options {
    Options { weights: Weights::None, ..Options::default() }
}

fn benches(c: &mut Criterion) {
    let (table, nodes) = (cell_means(), nodes());
    let mut group = c.benchmark_group("fit");
    group.sample_size(10);
    group.bench_function("variable-projection-on-cell-means", |b| {
        b.iter(|| fit(&Observations::from_measured(black_box(&table)), &options()));
    });
    group.bench_function("node-levenberg-marquardt", |b| b.iter(|| levenberg_marquardt(black_box(&nodes))));
    group.finish();
}

fn median(mut f: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..9)
        .map(|_| {
            let start = Instant::now();
            f();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[4]
}

fn ratio() {
    let (table, nodes) = (cell_means(), nodes());
    let start = Instant::now();
    let first = fit(&Observations::from_measured(&table), &options());
    let cold = start.elapsed().as_secs_f64();
    let ours = median(|| {
        black_box(fit(&Observations::from_measured(&table), &options()));
    });
    let mut found = ([0.0; 7], 0);
    let baseline = median(|| found = levenberg_marquardt(&nodes));
    println!(
        "cells {}, exponent {:.3} ± {:.3} (truth 410)",
        first.cells_used,
        first.parameters[0].value,
        first.parameters[0].sigma.unwrap_or(f64::NAN)
    );
    println!("baseline exponent {:.3} after {} iterations", found.0[0].exp(), found.1);
    println!(
        "fit on cell means {:.2} ms (first of a grid {:.0} ms), node-levenberg-marquardt {:.2} ms: ratio {:.2}",
        1e3 * ours,
        1e3 * cold,
        1e3 * baseline,
        baseline / ours
    );
}

criterion_group!(all, benches);

fn main() {
    ratio();
    all();
    Criterion::default().configure_from_args().final_summary();
}
