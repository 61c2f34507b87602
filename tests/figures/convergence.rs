//! Whether fits without starting values end at the global minimum: against a brute-force grid of exponents (and r0), over every row of Sopp's table.
//!
//! Truths: the 36 rows of `tests/golden/sopp2017_fits.csv` in the simplified form, and in the full form with four r0. Data: node values in double precision on a
//! thinned grid ([`grid`]), which keeps Sopp's range of angles and the mirror directions, without noise and with 1 and 5 % of the value (normal, seeded). With `sigma`
//! the same values carry σ = noise · value + 1e-3. Cases: three limits of angle, five weights.
//!
//! The brute force evaluates the models of `gonio_brdf` at [`EXPONENTS`] × [`R0S`] places, solves the colours there with formulas of this file (none below 0), and
//! sums the squares of the best place over the residuals themselves. The logarithmic form has no linear solution: there [`LOG_EXPONENTS`] × [`LOG_R0S`] places
//! are tried, each with Gauss–Newton steps on the two colours of a channel. A fit succeeds if its weighted squares are not above the brute force's.

use gonio_brdf::models::{AshikhminShirley, AshikhminShirleySimplified};
use gonio_brdf::{Brdf, Flag, Grid, Meaning, Scattered, ScatteredPoint};
use gonio_fitter::{Fit, ModelChoice, Observations, Options, Weights, fit};
use gonio_optics::{Angle, Vec3};
use rayon::prelude::*;

use crate::{Figure, noise::Noise};

const SEED: u64 = 20_170_711;
/// Exponents of the brute force, evenly spaced in the logarithm from 1 to 8,100, the range of the fit.
const EXPONENTS: usize = 121;
/// Values of r0 from 0.002 to 0.98, the range of the fit.
const R0S: usize = 32;
const LOG_EXPONENTS: usize = 31;
const LOG_R0S: usize = 8;
/// Gauss–Newton steps on the colours of the logarithmic form.
const LOG_STEPS: usize = 5;
const LIMITS: [f64; 3] = [45.0, 75.0, 85.0];
const NOISES: [f64; 3] = [0.0, 0.01, 0.05];
const RS: [f64; 4] = [0.02, 0.04, 0.1, 0.3];
const CHANNELS: [&str; 3] = ["r", "g", "b"];

/// 7 × 18 × 14 directions: every limit has nodes on it, the azimuths are denser towards the mirror direction.
fn grid() -> Grid {
    Grid {
        theta_i_deg: vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0],
        theta_o_deg: (0..18).map(|k| 5.0 * f64::from(k)).collect(),
        phi_deg: [0, 20, 40, 60, 80, 100, 120, 140, 150, 160, 165, 170, 175, 180].map(f64::from).to_vec(),
    }
}

/// A row of the table.
struct Paint {
    exponent: f64,
    diffuse: [f64; 3],
    specular: [f64; 3],
}

fn paints() -> Vec<Paint> {
    let text = std::fs::read_to_string(gonio_tests::golden("sopp2017_fits.csv")).expect("Sopp's fits");
    text.lines()
        .skip(1)
        .map(|line| {
            let x: Vec<f64> = line.split(',').skip(6).map(|x| x.parse().expect("a number")).collect();
            Paint { exponent: x[0], diffuse: [x[1], x[2], x[3]], specular: [x[4], x[5], x[6]] }
        })
        .collect()
}

/// A direction of the grid and the terms there at all exponents of the brute force.
struct Node {
    place: usize,
    l: Vec3,
    v: Vec3,
    theta: f64,
    cos: f64,
    area: f64,
    /// Schlick's (1 − h·v)^5.
    rise: f64,
    /// Diffuse term of the full form for r0 = 0.
    full: f64,
    lobes: Vec<f64>,
}

fn exponent(k: usize, of: usize) -> f64 {
    8100f64.powf(k as f64 / (of - 1) as f64)
}

fn nodes(grid: &Grid) -> Vec<Node> {
    (0..grid.len())
        .into_par_iter()
        .map(|place| {
            let [a, b, c] = grid.coordinates(place);
            let g = grid.geometry(a, b, c);
            let (l, v) = g.directions();
            Node {
                place,
                l,
                v,
                theta: g.theta_i.degrees().max(g.theta_o.degrees()),
                cos: g.theta_i.cos(),
                area: grid.solid_angle(b, c),
                rise: (1.0 - (l + v).norm() * 0.5).max(0.0).powi(5),
                full: AshikhminShirley::diffuse_term(0.0, l, v),
                lobes: (0..EXPONENTS)
                    .map(|k| AshikhminShirleySimplified::lobe(exponent(k, EXPONENTS), l, v))
                    .collect(),
            }
        })
        .collect()
}

/// What is fitted: values by place of the grid, as seen with every weighting.
struct Data {
    values: Vec<[f64; 3]>,
    noise: f64,
    plain: Observations,
    with_sigma: Observations,
}

fn sigma(value: f64, noise: f64) -> f64 {
    noise * value + 1e-3
}

fn data(grid: &Grid, nodes: &[Node], truth: &dyn Brdf, noise: f64, seed: u64) -> Data {
    let mut rng = Noise::new(seed);
    let values: Vec<[f64; 3]> =
        nodes.iter().map(|n| truth.eval(n.l, n.v).map(|f| f * (1.0 + noise * rng.normal()))).collect();
    let points = nodes
        .iter()
        .zip(&values)
        .map(|(n, &value)| {
            let [a, b, c] = grid.coordinates(n.place);
            let sigma = Some(value.map(|y| sigma(y, noise)));
            ScatteredPoint { geometry: grid.geometry(a, b, c), value, sigma, flag: Flag::Measured }
        })
        .collect();
    Data {
        plain: Observations::from_grid_values(grid, Meaning::Node, &values),
        with_sigma: Observations::from_scattered(&Scattered { points }),
        values,
        noise,
    }
}

/// A node that takes part, its values and weights.
struct Row<'a> {
    node: &'a Node,
    y: [f64; 3],
    w: [f64; 3],
}

fn rows<'a>(nodes: &'a [Node], data: &Data, weights: Weights, limit: f64) -> Vec<Row<'a>> {
    nodes
        .iter()
        .zip(&data.values)
        .filter(|(n, _)| n.theta <= limit + 1e-9)
        .map(|(node, &y)| {
            let w = match weights {
                Weights::Sopp => [(node.area * node.cos).powi(2); 3],
                Weights::Ngan => [node.area * node.cos * node.cos; 3],
                Weights::Sigma => y.map(|y| sigma(y, data.noise).powi(-2)),
                Weights::LogRelative => [node.area; 3],
                Weights::None => [1.0; 3],
            };
            Row { node, y, w }
        })
        .collect()
}

/// A place of the brute force.
#[derive(Clone, Copy)]
struct Place {
    exponent: f64,
    r0: f64,
    colours: [[f64; 2]; 3],
}

/// Colours (cd, cs), neither below 0, of y = cd d + cs s: what they leave of Σ w y² is Σ w y² less the second number.
fn colours(dd: f64, ds: f64, ss: f64, dy: f64, sy: f64) -> ([f64; 2], f64) {
    let det = dd * ss - ds * ds;
    let both = [(ss * dy - ds * sy) / det, (dd * sy - ds * dy) / det];
    if both[0] >= 0.0 && both[1] >= 0.0 {
        return (both, both[0] * dy + both[1] * sy);
    }
    let (d, s) = (dy.max(0.0), sy.max(0.0));
    if d * d / dd >= s * s / ss { ([d / dd, 0.0], d * d / dd) } else { ([0.0, s / ss], s * s / ss) }
}

fn r0s(full: bool, count: usize) -> Vec<f64> {
    if full {
        (0..count).map(|k| 0.002 * 490f64.powf(k as f64 / (count - 1) as f64)).collect()
    } else {
        // Schlick's term is not there: 1 + 0 · rise
        vec![1.0]
    }
}

fn diffuse(full: bool, r0: f64, node: &Node) -> f64 {
    if full { (1.0 - r0) * node.full } else { std::f64::consts::FRAC_1_PI }
}

/// The best place of the grid of exponents and r0.
fn best_place(rows: &[Row<'_>], full: bool, shared: bool) -> Place {
    let r0s = r0s(full, R0S);
    let mut best = (f64::NEG_INFINITY, Place { exponent: 1.0, r0: 1.0, colours: [[0.0; 2]; 3] });
    for k in 0..EXPONENTS {
        // per channel: dd, dp, dq, pp, pq, qq, dy, py, qy for the lobe p and its rise q
        let mut sums = [[0.0; 9]; 3];
        for row in rows {
            let p = row.node.lobes[k];
            let (q, d) = (p * row.node.rise, diffuse(full, 0.0, row.node));
            for (c, s) in sums.iter_mut().enumerate() {
                let w = row.w[c];
                if c == 0 || !shared {
                    let (wd, wp, wq) = (w * d, w * p, w * q);
                    s[0] += wd * d;
                    s[1] += wd * p;
                    s[2] += wd * q;
                    s[3] += wp * p;
                    s[4] += wp * q;
                    s[5] += wq * q;
                }
                let wy = w * row.y[c];
                s[6] += wy * d;
                s[7] += wy * p;
                s[8] += wy * q;
            }
        }
        if shared {
            let gram = sums[0];
            for s in &mut sums[1..] {
                s[..6].copy_from_slice(&gram[..6]);
            }
        }
        for &r0 in &r0s {
            let (u, t) = (if full { 1.0 - r0 } else { 1.0 }, 1.0 - r0);
            let (mut gain, mut found) = (0.0, [[0.0; 2]; 3]);
            for (s, found) in sums.iter().zip(&mut found) {
                let ss = r0 * r0 * s[3] + 2.0 * r0 * t * s[4] + t * t * s[5];
                let ds = u * (r0 * s[1] + t * s[2]);
                let (x, g) = colours(u * u * s[0], ds, ss, u * s[6], r0 * s[7] + t * s[8]);
                *found = x;
                gain += g;
            }
            if gain > best.0 {
                best = (gain, Place { exponent: exponent(k, EXPONENTS), r0, colours: found });
            }
        }
    }
    best.1
}

/// Weighted squares of a place, summed over the residuals.
fn squares_of_place(rows: &[Row<'_>], full: bool, p: &Place) -> f64 {
    rows.iter()
        .map(|row| {
            let lobe = AshikhminShirleySimplified::lobe(p.exponent, row.node.l, row.node.v);
            let (d, s) = (diffuse(full, p.r0, row.node), lobe * (p.r0 + (1.0 - p.r0) * row.node.rise));
            (0..3)
                .map(|c| row.w[c] * (row.y[c] - p.colours[c][0] * d - p.colours[c][1] * s).powi(2))
                .sum::<f64>()
        })
        .sum()
}

/// The least Σ w (ln f − ln y)² that the brute force meets.
fn brute_force_of_logarithms(rows: &[Row<'_>], full: bool) -> f64 {
    let step = (EXPONENTS - 1) / (LOG_EXPONENTS - 1);
    let mut best = f64::INFINITY;
    for k in (0..LOG_EXPONENTS).map(|k| k * step) {
        for r0 in r0s(full, LOG_R0S) {
            let terms: Vec<(f64, f64)> = rows
                .iter()
                .map(|row| {
                    let rise = r0 + (1.0 - r0) * row.node.rise;
                    (diffuse(full, r0, row.node), row.node.lobes[k] * rise)
                })
                .collect();
            best = best.min((0..3).map(|c| logarithms_of_channel(rows, &terms, c)).sum());
        }
    }
    best
}

/// Gauss–Newton on the colours of one channel, from relative least squares; the least value met on the way.
fn logarithms_of_channel(rows: &[Row<'_>], terms: &[(f64, f64)], c: usize) -> f64 {
    let mut fitted: Vec<f64> = rows.iter().map(|row| row.y[c]).collect();
    let mut best = f64::INFINITY;
    for _ in 0..=LOG_STEPS {
        let mut m = [0.0; 5];
        for ((row, &(d, s)), &f) in rows.iter().zip(terms).zip(&fitted) {
            let (w, y) = (row.w[c] / (f * f), f + f * (row.y[c] / f).ln());
            for (m, x) in m.iter_mut().zip([d * d, d * s, s * s, d * y, s * y]) {
                *m += w * x;
            }
        }
        let ([a, b], _) = colours(m[0], m[1], m[2], m[3], m[4]);
        let mut squares = 0.0;
        for ((row, &(d, s)), f) in rows.iter().zip(terms).zip(&mut fitted) {
            *f = (a * d + b * s).max(1e-12 * row.y[c]);
            squares += row.w[c] * (*f / row.y[c]).ln().powi(2);
        }
        best = best.min(squares);
    }
    best
}

/// What a fit minimises, at what it found.
fn squares_of_fit(rows: &[Row<'_>], f: &Fit) -> f64 {
    let brdf = f.model.brdf();
    rows.iter()
        .map(|row| {
            let m = brdf.eval(row.node.l, row.node.v);
            (0..3)
                .map(|c| {
                    let r = if f.weights == Weights::LogRelative {
                        (m[c] / row.y[c]).ln()
                    } else {
                        row.y[c] - m[c]
                    };
                    row.w[c] * r * r
                })
                .sum::<f64>()
        })
        .sum()
}

/// Largest relative error of the parameters.
fn off(f: &Fit, paint: &Paint, r0: Option<f64>) -> f64 {
    let value = |n: &str| f.parameter(n).map_or(f64::NAN, |p| p.value);
    let mut worst = 0.0f64;
    let mut also = |got: f64, want: f64| {
        let e = (got / want - 1.0).abs();
        worst = if e.is_nan() { f64::INFINITY } else { worst.max(e) };
    };
    also(value("exponent"), paint.exponent);
    if let Some(r0) = r0 {
        also(value("r0"), r0);
    }
    for (c, channel) in CHANNELS.iter().enumerate() {
        also(value(&format!("diffuse_{channel}")), paint.diffuse[c]);
        also(value(&format!("specular_{channel}")), paint.specular[c]);
    }
    worst
}

/// How a case ended.
struct Outcome {
    weights: Weights,
    met: bool,
    /// Largest relative error, of data without noise.
    off: Option<f64>,
    told: String,
}

fn cases_of(grid: &Grid, nodes: &[Node], k: usize, paint: &Paint, r0: Option<f64>) -> Vec<Outcome> {
    let (diffuse, specular, exponent) = (paint.diffuse, paint.specular, paint.exponent);
    let full = r0.is_some();
    let truth: Box<dyn Brdf> = match r0 {
        Some(r0) => Box::new(AshikhminShirley { diffuse, specular, exponent, r0 }),
        None => Box::new(AshikhminShirleySimplified { diffuse, specular, exponent }),
    };
    let model = if full { ModelChoice::AshikhminShirley } else { ModelChoice::AshikhminShirleySimplified };
    let mut out = Vec::new();
    for noise in NOISES {
        let seed = SEED + 1000 * k as u64 + (1000.0 * noise) as u64 + (1e5 * r0.unwrap_or(0.0)) as u64;
        let data = data(grid, nodes, truth.as_ref(), noise, seed);
        for limit in LIMITS {
            for (name, weights) in Weights::ALL {
                let o =
                    Options { model, weights, max_angle: Angle::from_degrees(limit), ..Options::default() };
                let f = fit(if weights == Weights::Sigma { &data.with_sigma } else { &data.plain }, &o);
                let rows = rows(nodes, &data, weights, limit);
                let ours = squares_of_fit(&rows, &f);
                let least = if weights == Weights::LogRelative {
                    brute_force_of_logarithms(&rows, full)
                } else {
                    squares_of_place(&rows, full, &best_place(&rows, full, weights != Weights::Sigma))
                };
                let off = (noise == 0.0).then(|| off(&f, paint, r0));
                // the last digits of two sums in different orders
                let met = ours <= least * (1.0 + 1e-9);
                let told = format!(
                    "row {} r0 {r0:?} noise {noise} limit {limit} {name}: {ours:.9e}, brute force {least:.9e}, off {off:?}, {}",
                    k + 1,
                    f.status.name()
                );
                out.push(Outcome { weights, met, off, told });
            }
        }
    }
    out
}

fn of_form(grid: &Grid, nodes: &[Node], form: &str, r0s: &[Option<f64>]) -> Vec<Figure> {
    let paints = paints();
    let jobs: Vec<(usize, Option<f64>)> =
        (0..paints.len()).flat_map(|k| r0s.iter().map(move |&r0| (k, r0))).collect();
    let outcomes: Vec<Outcome> =
        jobs.par_iter().flat_map_iter(|&(k, r0)| cases_of(grid, nodes, k, &paints[k], r0)).collect();
    for o in outcomes.iter().filter(|o| !o.met || o.off.is_some_and(|x| x > 1e-6)).take(40) {
        eprintln!("    {form}: {}", o.told);
    }
    let mut figures = Vec::new();
    for (name, weights) in Weights::ALL {
        let of: Vec<&Outcome> = outcomes.iter().filter(|o| o.weights == weights).collect();
        let met = of.iter().filter(|o| o.met).count();
        figures.push(Figure::said(
            format!("{form}, {name}: fits at the global minimum"),
            format!("{met} of {}", of.len()),
            "all",
            Some(SEED),
            met == of.len() && met > 0,
        ));
        let worst = of.iter().filter_map(|o| o.off).fold(0.0, f64::max);
        figures.push(Figure::at_most(
            format!("{form}, {name}: without noise, largest relative error"),
            worst,
            1e-6,
            Some(SEED),
        ));
    }
    figures
}

/// The figures.
pub fn figures() -> Vec<Figure> {
    let grid = grid();
    let nodes = nodes(&grid);
    let mut out = vec![Figure::said(
        "directions, exponents × r0 of the brute force",
        format!("{}, {EXPONENTS} × {R0S}", grid.len()),
        "printed",
        None,
        true,
    )];
    out.extend(of_form(&grid, &nodes, "simplified", &[None]));
    out.extend(of_form(&grid, &nodes, "full", &RS.map(Some)));
    out
}
