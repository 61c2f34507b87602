//! What a fit says of itself and how long it takes: intervals that hold the truth, three lobes at once, speed.

use std::time::Instant;

use gonio_brdf::average::adaptive_cell_mean;
use gonio_brdf::models::{AshikhminShirleySimplified, CookTorrance, CookTorranceLobe};
use gonio_brdf::{Brdf, Flag, Grid, Meaning, Measured};
use gonio_fitter::{ModelChoice, Observations, Options, Prepared, Weights, fit};
use gonio_optics::Angle;
use rayon::prelude::*;

use crate::{Figure, noise::Noise};

const TRUTH: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.1, 0.2, 0.3], specular: [0.06, 0.05, 0.04], exponent: 120.0 };

const REPEATS: u64 = 1000;
const INTERVAL_SEED: u64 = 95;
/// Standard deviations to either side that hold 95 % of a normal distribution.
const NINETY_FIVE: f64 = 1.959_964;

/// Values of a model at the nodes of a grid.
fn node_values(grid: &Grid, brdf: &dyn Brdf) -> Vec<[f64; 3]> {
    (0..grid.len())
        .into_par_iter()
        .map(|i| {
            let [a, b, c] = grid.coordinates(i);
            let (l, v) = grid.geometry(a, b, c).directions();
            brdf.eval(l, v)
        })
        .collect()
}

/// Share of the 95 % intervals of the seven parameters that hold the truth: node values on every third angle of incidence of Sopp's grid, to 75°,
/// noise of 3 % of the value plus 1e-3 1/sr in every channel, σ stated.
pub fn intervals() -> Vec<Figure> {
    let grid = Grid { theta_i_deg: (0..6).map(|k| 15.0 * f64::from(k)).collect(), ..Grid::sopp() };
    let clean = node_values(&grid, &TRUTH);
    let truths: Vec<(String, f64)> = std::iter::once(("exponent".to_owned(), TRUTH.exponent))
        .chain(["r", "g", "b"].into_iter().enumerate().flat_map(|(c, n)| {
            [(format!("diffuse_{n}"), TRUTH.diffuse[c]), (format!("specular_{n}"), TRUTH.specular[c])]
        }))
        .collect();
    [Weights::Ngan, Weights::Sigma, Weights::None]
        .into_iter()
        .flat_map(|weights| {
            let o = Options { weights, ..Options::default() };
            // held by the interval of each parameter
            let held = (0..REPEATS)
                .into_par_iter()
                .map(|k| {
                    let mut rng = Noise::new(INTERVAL_SEED + 7919 * k);
                    let mut m = Measured::empty(grid.clone(), Meaning::Node);
                    for (i, f) in clean.iter().enumerate() {
                        for (c, f) in f.iter().enumerate() {
                            let sigma = (0.03 * f).hypot(1e-3);
                            m.values[i][c] = (f + sigma * rng.normal()) as f32;
                            m.sigma[i][c] = sigma as f32;
                        }
                        m.flag[i] = Flag::Measured;
                    }
                    let f = fit(&Observations::from_measured(&m), &o);
                    truths
                        .iter()
                        .map(|(n, t)| {
                            let inside = f.interval(n, NINETY_FIVE).is_some_and(|(a, b)| a <= *t && *t <= b);
                            usize::from(inside)
                        })
                        .collect::<Vec<_>>()
                })
                .reduce(|| vec![0; truths.len()], |a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect());
            let share = |n: usize, of: usize| 100.0 * n as f64 / of as f64;
            let all = share(held.iter().sum(), REPEATS as usize * truths.len());
            let each = held.iter().map(|&n| share(n, REPEATS as usize));
            let (low, high) = each.fold((f64::INFINITY, 0.0f64), |(a, b), x| (a.min(x), b.max(x)));
            let name = format!("{}: % of 95 % intervals that hold the truth", weights.name());
            [
                Figure::within(name, all, 93.0, 97.0, Some(INTERVAL_SEED)),
                Figure::said(
                    format!("{}: parameter held least and most", weights.name()),
                    format!("{low:.1} and {high:.1} %"),
                    "printed",
                    Some(INTERVAL_SEED),
                    true,
                ),
            ]
        })
        .collect()
}

const LOBES_SEED: u64 = 1982;
const PAINTS: u64 = 100;

/// A paint of three lobes: widths evenly spread in the logarithm over 0.05 … 0.7, neighbours at least a factor of 1.5 apart, narrowest first;
/// r0 over 0.02 … 0.5, colours of the lobes over 0.02 … 0.5, all in the logarithm; diffuse colours 0.02 … 0.5.
fn three_lobed(seed: u64) -> CookTorrance {
    let mut rng = Noise::new(seed);
    let mut alphas = [0.0; 3];
    loop {
        alphas = alphas.map(|_| rng.log_uniform(0.05, 0.7));
        alphas.sort_by(f64::total_cmp);
        if alphas.windows(2).all(|w| w[1] >= 1.5 * w[0]) {
            break;
        }
    }
    let mut colour = || [0; 3].map(|_| rng.log_uniform(0.02, 0.5));
    let diffuse = colour();
    let specular = [colour(), colour(), colour()];
    let lobes = alphas
        .into_iter()
        .zip(specular)
        .map(|(alpha, specular)| CookTorranceLobe { specular, alpha, r0: rng.log_uniform(0.02, 0.5) })
        .collect();
    CookTorrance { diffuse, lobes }
}

/// The fitted parameters in the order of [`three_lobed`], or none where a lobe is missing.
fn lobes_of(m: &gonio_fitter::Minimum) -> Option<CookTorrance> {
    let value = |n: String| m.parameters.iter().find(|p| p.0 == n).map(|p| p.1);
    let mut lobes = (1..=3)
        .map(|k| {
            Some(CookTorranceLobe {
                specular: *m.colours.get(k)?,
                alpha: value(format!("lobe{k}_alpha"))?,
                r0: value(format!("lobe{k}_r0"))?,
            })
        })
        .collect::<Option<Vec<_>>>()?;
    lobes.sort_by(|a, b| a.alpha.total_cmp(&b.alpha));
    Some(CookTorrance { diffuse: *m.colours.first()?, lobes })
}

/// Largest relative error of widths, r0 and colours.
fn worst(got: &CookTorrance, want: &CookTorrance) -> f64 {
    let numbers = |m: &CookTorrance| -> Vec<f64> {
        let lobe = |l: &CookTorranceLobe| [l.alpha, l.r0, l.specular[0], l.specular[1], l.specular[2]];
        m.diffuse.into_iter().chain(m.lobes.iter().flat_map(lobe)).collect()
    };
    numbers(got).iter().zip(numbers(want)).map(|(g, w)| (g / w - 1.0).abs()).fold(0.0, f64::max)
}

/// Three lobes of Cook–Torrance on Sopp's whole grid (75,924 values, Ngan's weights, no starting values, one thread), 100 seeded paints, the grid prepared once. Without
/// noise a fit succeeds if every parameter is right within 0.1 %; with 1 % of noise if its squares are not above those of the truth.
pub fn three_lobes() -> Vec<Figure> {
    let grid = Grid::sopp();
    let o = Options {
        model: ModelChoice::CookTorrance(3),
        weights: Weights::Ngan,
        max_angle: Angle::from_degrees(90.0),
        ..Options::default()
    };
    let nothing = vec![[0.0; 3]; grid.len()];
    let obs = Observations::from_grid_values(&grid, Meaning::Node, &nothing);
    let Some(mut ready) = Prepared::new(&obs, &o) else {
        return vec![Figure::said("three lobes can be prepared", "no", "yes", None, false)];
    };
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let area_cos2: Vec<f64> = (0..grid.len())
        .map(|i| {
            let [a, b, c] = grid.coordinates(i);
            grid.solid_angle(b, c) * grid.geometry(a, b, c).theta_i.cos().powi(2)
        })
        .collect();
    let (mut right, mut low) = (0, 0);
    let (mut errors, mut times) = (Vec::new(), Vec::new());
    for k in 0..PAINTS {
        let truth = three_lobed(LOBES_SEED + 104_729 * k);
        let clean = node_values(&grid, &truth);
        let start = Instant::now();
        let found = single.install(|| ready.fit(&clean));
        times.push(1e3 * start.elapsed().as_secs_f64());
        let error = lobes_of(&found).map_or(f64::INFINITY, |f| worst(&f, &truth));
        right += usize::from(error <= 1e-3);
        errors.push(error);
        let mut rng = Noise::new(LOBES_SEED + 104_729 * k + 1);
        let noisy: Vec<[f64; 3]> = clean.iter().map(|f| f.map(|x| x * (1.0 + 0.01 * rng.normal()))).collect();
        let found = single.install(|| ready.fit(&noisy));
        let of_truth: f64 = (0..grid.len())
            .map(|i| (0..3).map(|c| area_cos2[i] * (noisy[i][c] - clean[i][c]).powi(2)).sum::<f64>())
            .sum();
        low += usize::from(found.squares <= of_truth);
    }
    errors.sort_by(f64::total_cmp);
    times.sort_by(f64::total_cmp);
    let seed = Some(LOBES_SEED);
    let all = PAINTS as usize;
    vec![
        Figure::said(
            "three lobes, no noise: all parameters within 0.1 %",
            format!("{right} of {all}"),
            "all",
            seed,
            right == all,
        ),
        Figure::said(
            "three lobes, no noise: median and largest relative error",
            format!("{:.1e}, {:.1e}", errors[all / 2], errors[all - 1]),
            "printed",
            seed,
            true,
        ),
        Figure::said(
            "three lobes, 1 % noise: squares not above the truth's",
            format!("{low} of {all}"),
            "all",
            seed,
            low == all,
        ),
        Figure::said(
            "three lobes: median and longest time, one thread",
            format!("{:.1} ms, {:.1} ms", times[all / 2], times[all - 1]),
            "printed",
            seed,
            true,
        ),
    ]
}

/// Shortest of `rounds` runs of two that take turns, in milliseconds.
fn shortest(rounds: usize, mut a: impl FnMut(), mut b: impl FnMut()) -> (f64, f64) {
    let time = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        1e3 * start.elapsed().as_secs_f64()
    };
    (0..rounds)
        .fold((f64::INFINITY, f64::INFINITY), |best, _| (best.0.min(time(&mut a)), best.1.min(time(&mut b))))
}

/// The simplified fit of Sopp's grid to 75°, prepared, one thread. The comparison with the crates `levenberg-marquardt` and `varpro`, on the same problem and taking
/// turns, is a benchmark of its own; its command is printed.
pub fn speed() -> Vec<Figure> {
    let grid = Grid::sopp();
    let o = Options { weights: Weights::None, ..Options::default() };
    let rippled = |i: usize, f: [f64; 3]| f.map(|x| x * (1.0 + 0.02 * (1.7 * i as f64).sin()));
    let prepared = |meaning: Meaning| {
        let values: Vec<[f64; 3]> = (0..grid.len())
            .into_par_iter()
            .map(|i| rippled(i, adaptive_cell_mean(&TRUTH, &grid, meaning, grid.coordinates(i))))
            .collect();
        Prepared::new(&Observations::from_grid_values(&grid, meaning, &values), &o).map(|p| (p, values))
    };
    let lamp = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let (Some((mut node, node_values)), Some((mut cell, cell_values))) =
        (prepared(Meaning::Node), prepared(lamp))
    else {
        return vec![Figure::said("the simplified fit can be prepared", "no", "yes", None, false)];
    };
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let (a, b) = single.install(|| {
        shortest(
            60,
            || drop(std::hint::black_box(node.fit(&node_values))),
            || drop(std::hint::black_box(cell.fit(&cell_values))),
        )
    });
    vec![
        Figure::said(
            format!("node values, {} directions, shortest of 60", node.cells()),
            format!("{a:.3} ms"),
            "printed",
            None,
            true,
        ),
        Figure::at_most("cell means, time over that of node values", b / a, 3.0, None),
        Figure::said(
            "against levenberg-marquardt and varpro",
            "cargo bench -p gonio-fitter --bench peers",
            "printed",
            None,
            true,
        ),
    ]
}
