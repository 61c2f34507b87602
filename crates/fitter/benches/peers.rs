//! The simplified fit of node values on Sopp's grid to 75° (17,856 directions, three channels), one thread, against the crates `levenberg-marquardt` and
//! `varpro`; the full form with r0 against `levenberg-marquardt`; cell means against node values; three lobes of Cook–Torrance.
//!
//! The peers are given what does not depend on the parameters worked out (ln(n·h) and the denominators), analytic derivatives, and starting values; ours
//! has no starting value. Times are the smallest of rounds in which all take turns. `prepared` leaves out what does not depend on the values, as the peers' figures
//! do; `from directions` has all of it; `with verdict` is the whole [`fit`] with covariance, colour differences and residuals.
//!
//! `cargo bench -p gonio-fitter --bench peers`
#![allow(missing_docs, clippy::print_stdout)]

use std::cell::RefCell;
use std::hint::black_box;
use std::time::Instant;

use gonio_brdf::{
    Brdf, Grid, Meaning,
    average::adaptive_cell_mean,
    models::{AshikhminShirley, AshikhminShirleySimplified, CookTorrance, CookTorranceLobe},
};
use gonio_fitter::{ModelChoice, Observations, Options, Prepared, Weights, fit};
use gonio_optics::{Angle, Vec3};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra_of_peers::{DMatrix, DVector, Dyn, OVector, Owned, SVector, U1};
use varpro::prelude::SeparableNonlinearModel;
use varpro::problem::SeparableProblemBuilder;
use varpro::solvers::levmar::LevMarSolver;

const TRUTH: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.1, 0.2, 0.3], specular: [0.06, 0.05, 0.04], exponent: 410.0 };
const FULL: AshikhminShirley =
    AshikhminShirley { diffuse: [0.1, 0.2, 0.3], specular: [0.9, 0.8, 0.7], exponent: 410.0, r0: 0.06 };

/// What the peers know of a direction: ln(n·h), 1/(8π (h·v) max(n·l, n·v)), (1 − h·v)^5, the diffuse term of the full form, values.
#[derive(Clone, Copy)]
struct Node {
    log: f64,
    k: f64,
    rise: f64,
    diffuse: f64,
    y: [f64; 3],
}

fn geometry() -> Vec<(Vec3, Vec3)> {
    let grid = Grid::sopp();
    (0..grid.len())
        .filter_map(|i| {
            let [a, b, c] = grid.coordinates(i);
            let g = grid.geometry(a, b, c);
            (g.theta_i.degrees() <= 75.0 && g.theta_o.degrees() <= 75.0).then(|| g.directions())
        })
        .collect()
}

/// Values with 2 % of deterministic ripple.
fn rippled(i: usize, f: [f64; 3]) -> [f64; 3] {
    let ripple = 1.0 + 0.02 * (1.7 * i as f64).sin();
    f.map(|x| x * ripple)
}

fn nodes(truth: &dyn Brdf) -> Vec<Node> {
    geometry()
        .into_iter()
        .enumerate()
        .map(|(i, (l, v))| {
            let h = (l + v).normalized();
            let hv = h.dot(v);
            Node {
                log: h.z.ln(),
                k: (8.0 * std::f64::consts::PI * hv * l.z.max(v.z)).recip(),
                rise: (1.0 - hv).powi(5),
                diffuse: AshikhminShirley::diffuse_term(0.0, l, v),
                y: rippled(i, truth.eval(l, v)),
            }
        })
        .collect()
}

/// Seven (or with r0 eight) parameters: ln n, [r0,] cd, cs.
struct Whole<'a, const N: usize> {
    nodes: &'a [Node],
    x: SVector<f64, N>,
}

impl<const N: usize> Whole<'_, N> {
    const FULL: bool = N == 8;

    fn colours(&self) -> usize {
        if Self::FULL { 2 } else { 1 }
    }

    /// Lobe with Schlick's factor, its derivatives by ln n and r0, the diffuse term and its derivative by r0.
    fn terms(&self, node: &Node) -> (f64, f64, f64, f64, f64) {
        let n = self.x[0].exp();
        let power = (n * node.log).exp() * node.k;
        let s = (n + 1.0) * power;
        let ds = n * power * (1.0 + (n + 1.0) * node.log);
        if Self::FULL {
            let r0 = self.x[1];
            let f = r0 + (1.0 - r0) * node.rise;
            (s * f, ds * f, s * (1.0 - node.rise), (1.0 - r0) * node.diffuse, -node.diffuse)
        } else {
            (s, ds, 0.0, std::f64::consts::FRAC_1_PI, 0.0)
        }
    }
}

impl<const N: usize> LeastSquaresProblem<f64, Dyn, nalgebra_of_peers::Const<N>> for Whole<'_, N> {
    type ParameterStorage = nalgebra_of_peers::ArrayStorage<f64, N, 1>;
    type ResidualStorage = Owned<f64, Dyn, U1>;
    type JacobianStorage = nalgebra_of_peers::VecStorage<f64, Dyn, nalgebra_of_peers::Const<N>>;

    fn set_params(&mut self, x: &SVector<f64, N>) {
        self.x = *x;
    }

    fn params(&self) -> SVector<f64, N> {
        self.x
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let m = self.nodes.len();
        let mut r = DVector::zeros(3 * m);
        let first = self.colours();
        for (i, node) in self.nodes.iter().enumerate() {
            let (s, _, _, d, _) = self.terms(node);
            for c in 0..3 {
                r[c * m + i] = self.x[first + c] * d + self.x[first + 3 + c] * s - node.y[c];
            }
        }
        Some(r)
    }

    fn jacobian(&self) -> Option<nalgebra_of_peers::OMatrix<f64, Dyn, nalgebra_of_peers::Const<N>>> {
        let m = self.nodes.len();
        let mut j = nalgebra_of_peers::OMatrix::<f64, Dyn, nalgebra_of_peers::Const<N>>::zeros(3 * m);
        let first = self.colours();
        for (i, node) in self.nodes.iter().enumerate() {
            let (s, by_n, by_r0, d, dd) = self.terms(node);
            for c in 0..3 {
                let row = c * m + i;
                let cs = self.x[first + 3 + c];
                j[(row, 0)] = cs * by_n;
                if Self::FULL {
                    j[(row, 1)] = cs * by_r0 + self.x[first + c] * dd;
                }
                j[(row, first + c)] = d;
                j[(row, first + 3 + c)] = s;
            }
        }
        Some(j)
    }
}

fn levenberg_marquardt_simplified(nodes: &[Node], start: f64) -> (f64, bool) {
    let x = SVector::<f64, 7>::from_row_slice(&[start.ln(), 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]);
    let (done, report) = LevenbergMarquardt::new().minimize(Whole { nodes, x });
    (done.x[0].exp(), report.termination.was_successful())
}

fn levenberg_marquardt_full(nodes: &[Node], start: f64) -> (f64, bool) {
    let x = SVector::<f64, 8>::from_row_slice(&[start.ln(), 0.1, 0.1, 0.1, 0.1, 0.5, 0.5, 0.5]);
    let (done, report) = LevenbergMarquardt::new().minimize(Whole { nodes, x });
    (done.x[0].exp(), report.termination.was_successful())
}

/// Two columns, 1/π and the lobe, three right-hand sides.
struct Separable<'a> {
    nodes: &'a [Node],
    log_n: f64,
}

impl SeparableNonlinearModel for Separable<'_> {
    type ScalarType = f64;
    type Error = std::fmt::Error;

    fn parameter_count(&self) -> usize {
        1
    }
    fn base_function_count(&self) -> usize {
        2
    }
    fn output_len(&self) -> usize {
        self.nodes.len()
    }
    fn set_params(&mut self, p: OVector<f64, Dyn>) -> Result<(), Self::Error> {
        self.log_n = p[0];
        Ok(())
    }
    fn params(&self) -> OVector<f64, Dyn> {
        DVector::from_element(1, self.log_n)
    }
    fn eval(&self) -> Result<DMatrix<f64>, Self::Error> {
        let n = self.log_n.exp();
        let m = self.nodes.len();
        Ok(DMatrix::from_iterator(
            m,
            2,
            std::iter::repeat_n(std::f64::consts::FRAC_1_PI, m)
                .chain(self.nodes.iter().map(|node| (n + 1.0) * node.k * (n * node.log).exp())),
        ))
    }
    fn eval_partial_deriv(&self, _: usize) -> Result<DMatrix<f64>, Self::Error> {
        let n = self.log_n.exp();
        let m = self.nodes.len();
        let by = |node: &Node| n * node.k * (n * node.log).exp() * (1.0 + (n + 1.0) * node.log);
        Ok(DMatrix::from_iterator(m, 2, std::iter::repeat_n(0.0, m).chain(self.nodes.iter().map(by))))
    }
}

fn varpro_simplified(nodes: &[Node], y: &DMatrix<f64>, start: f64) -> (f64, bool) {
    let model = Separable { nodes, log_n: start.ln() };
    let Ok(problem) = SeparableProblemBuilder::mrhs(model).observations(y.clone()).build() else {
        return (f64::NAN, false);
    };
    match LevMarSolver::default().solve(problem) {
        Ok(done) => (done.nonlinear_parameters()[0].exp(), true),
        Err(_) => (f64::NAN, false),
    }
}

fn options(model: ModelChoice, limit: f64) -> Options {
    Options { model, weights: Weights::None, max_angle: Angle::from_degrees(limit), ..Options::default() }
}

/// Smallest times of contestants that take turns.
fn race(rounds: usize, contestants: &mut [(&str, &mut dyn FnMut())]) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; contestants.len()];
    for _ in 0..rounds {
        for ((_, run), best) in contestants.iter_mut().zip(&mut best) {
            let start = Instant::now();
            run();
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    for ((name, _), t) in contestants.iter().zip(&best) {
        println!("  {name:<44} {:>9.3} ms", 1e3 * t);
    }
    best
}

fn prepared(obs: &Observations, o: &Options) -> Prepared {
    Prepared::new(obs, o).expect("a model of this form")
}

fn main() {
    // one thread, whatever the machine has
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("one thread");
    simplified();
    full();
    cells();
    three_lobes();
}

fn simplified() {
    println!("simplified form, node values, 17,856 directions");
    let data = nodes(&TRUTH);
    let points: Vec<(Vec3, Vec3, [f64; 3])> =
        geometry().into_iter().zip(&data).map(|((l, v), n)| (l, v, n.y)).collect();
    let values: Vec<[f64; 3]> = data.iter().map(|n| n.y).collect();
    let y = DMatrix::from_fn(data.len(), 3, |i, c| data[i].y[c]);
    let o = options(ModelChoice::AshikhminShirleySimplified, 75.0);
    let obs = Observations::from_directions(&points);
    let ready = RefCell::new(prepared(&obs, &o));
    println!(
        "  exponents: ours {:.6}, levenberg-marquardt from 100 {:?} and from 25 {:?}, varpro from 100 {:?} and from 25 {:?}",
        ready.borrow_mut().fit(&values).parameters[0].1,
        levenberg_marquardt_simplified(&data, 100.0),
        levenberg_marquardt_simplified(&data, 25.0),
        varpro_simplified(&data, &y, 100.0),
        varpro_simplified(&data, &y, 25.0)
    );
    let t = race(
        30,
        &mut [
            ("ours, prepared", &mut || drop(black_box(ready.borrow_mut().fit(black_box(&values))))),
            ("ours, preparation included", &mut || drop(black_box(prepared(&obs, &o).fit(&values)))),
            ("ours, with verdict", &mut || drop(black_box(fit(&obs, &o)))),
            ("levenberg-marquardt 0.15, started at 100", &mut || drop(black_box(levenberg_marquardt_simplified(&data, 100.0)))),
            ("varpro 0.14, started at 100", &mut || drop(black_box(varpro_simplified(&data, &y, 100.0)))),
        ],
    );
    println!(
        "  ratios to ours, prepared: levenberg-marquardt {:.1}, varpro {:.1}; preparation included: {:.1}, {:.1}",
        t[3] / t[0],
        t[4] / t[0],
        t[3] / t[1],
        t[4] / t[1]
    );
}

fn full() {
    println!("full form with r0, node values");
    let data = nodes(&FULL);
    let points: Vec<(Vec3, Vec3, [f64; 3])> =
        geometry().into_iter().zip(&data).map(|((l, v), n)| (l, v, n.y)).collect();
    let values: Vec<[f64; 3]> = data.iter().map(|n| n.y).collect();
    let o = options(ModelChoice::AshikhminShirley, 75.0);
    let ready = RefCell::new(prepared(&Observations::from_directions(&points), &o));
    println!(
        "  exponents: ours {:.6}, levenberg-marquardt from 100 {:?}",
        ready.borrow_mut().fit(&values).parameters[1].1,
        levenberg_marquardt_full(&data, 100.0)
    );
    let t = race(
        20,
        &mut [
            ("ours, prepared", &mut || drop(black_box(ready.borrow_mut().fit(black_box(&values))))),
            ("levenberg-marquardt 0.15, started at 100", &mut || drop(black_box(levenberg_marquardt_full(&data, 100.0)))),
        ],
    );
    println!("  ratio {:.1}", t[1] / t[0]);
}

fn cells() {
    println!("cell means against node values, simplified form");
    let grid = Grid::sopp();
    let lamp = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let o = options(ModelChoice::AshikhminShirleySimplified, 75.0);
    let of = |meaning: Meaning| -> (Prepared, Vec<[f64; 3]>) {
        let values: Vec<[f64; 3]> = (0..grid.len())
            .map(|i| rippled(i, adaptive_cell_mean(&TRUTH, &grid, meaning, grid.coordinates(i))))
            .collect();
        let start = Instant::now();
        let ready = prepared(&Observations::from_grid_values(&grid, meaning, &values), &o);
        println!("  preparation of a new grid {:.0} ms", 1e3 * start.elapsed().as_secs_f64());
        (ready, values)
    };
    let (mut node, node_values) = of(Meaning::Node);
    let (mut cell, cell_values) = of(lamp);
    let t = race(
        30,
        &mut [
            ("node values", &mut || drop(black_box(node.fit(black_box(&node_values))))),
            ("cell means", &mut || drop(black_box(cell.fit(black_box(&cell_values))))),
        ],
    );
    println!("  ratio {:.2}", t[1] / t[0]);
}

fn three_lobes() {
    println!("three lobes of Cook–Torrance, node values, 75,924 values");
    let lobe = |s: [f64; 3], alpha, r0| CookTorranceLobe { specular: s, alpha, r0 };
    let truth = CookTorrance {
        diffuse: [0.02, 0.05, 0.1],
        lobes: vec![lobe([0.2, 0.3, 0.4], 0.55, 0.3), lobe([0.3, 0.1, 0.02], 0.22, 0.1), lobe([0.1; 3], 0.06, 0.05)],
    };
    // cosines of 0 at θ = 90° make some values huge: weighted as Ngan does, with cos² θi
    let grid = Grid::sopp();
    let values: Vec<[f64; 3]> = (0..grid.len())
        .map(|i| {
            let [a, b, c] = grid.coordinates(i);
            let (l, v) = grid.geometry(a, b, c).directions();
            truth.eval(l, v)
        })
        .collect();
    let o = Options { weights: Weights::Ngan, ..options(ModelChoice::CookTorrance(3), 90.0) };
    let obs = Observations::from_grid_values(&grid, Meaning::Node, &values);
    let ready = RefCell::new(prepared(&obs, &o));
    println!("  {:?}", ready.borrow_mut().fit(&values).parameters);
    race(
        5,
        &mut [
            ("ours, prepared", &mut || drop(black_box(ready.borrow_mut().fit(&values)))),
            ("ours, with verdict", &mut || drop(black_box(fit(&obs, &o)))),
        ],
    );
}
