//! Why the iteration of Sopp's thesis lost its footing: his method on its own family and on real shapes, beside ours on the same sums of squares.
//!
//! The comparison is his first stage, n, cd and cs on the mean of the channels, so both minimise the same number; a run fails where its sum of
//! squares ends more than 1 % above the global minimum. With `GONIO_PICTURES=DIR` the pictures of `docs/fitting.md` are drawn there.

use std::path::{Path, PathBuf};

use gonio_brdf::formats::{self, Loaded};
use gonio_brdf::models::{AshikhminShirley, AshikhminShirleySimplified};
use gonio_brdf::{Brdf, Grid, Measured};
use gonio_fitter::anneal::{AnnealOptions, fit_by_annealing};
use gonio_fitter::sopp::{Ended, SoppOptions, SoppRun, sopp};
use gonio_fitter::{ModelChoice, Observations, Options, Weights, colours_at, fit};
use gonio_optics::Angle;
use gonio_render::plots::Chart;
use gonio_tests::{RealData, golden, real_data};
use rayon::prelude::*;

use crate::Figure;

/// Start values of n that the thesis tried.
const STARTS: [f64; 3] = [25.0, 100.0, 250.0];
const LIMITS_DEG: [f64; 2] = [45.0, 75.0];
const WEIGHTS: [Weights; 2] = [Weights::None, Weights::Sopp];

/// Paints, wraps and plastics of every width of lobe.
const REAL: &[&str] = &[
    "mbsdf/carpaint_blue.mbsdf",
    "rgl/cc_ibiza_sunset_rgb.bsdf",
    "rgl/satin_rosaline_rgb.bsdf",
    "rgl/paper_white_rgb.bsdf",
    "nbrdf/merl_nbrdf.f32#blue-metallic-paint",
    "nbrdf/merl_nbrdf.f32#silver-metallic-paint",
    "nbrdf/merl_nbrdf.f32#red-metallic-paint",
    "nbrdf/merl_nbrdf.f32#gold-metallic-paint",
    "nbrdf/merl_nbrdf.f32#color-changing-paint1",
    "nbrdf/merl_nbrdf.f32#color-changing-paint3",
    "nbrdf/merl_nbrdf.f32#white-paint",
    "nbrdf/merl_nbrdf.f32#red-specular-plastic",
    "nbrdf/merl_nbrdf.f32#chrome",
    "nbrdf/merl_nbrdf.f32#blue-fabric",
];

/// One start on one set of data.
struct Trial {
    start: f64,
    weights: Weights,
    ended: Ended,
    /// His sum of squares over the global minimum.
    ratio: f64,
    /// Whether a colour or the exponent is below 0.
    negative: bool,
    /// Of a run that failed: whether it succeeds without an upper limit on λ, and with parameters kept within limits.
    cured: [bool; 2],
}

/// A table whose channels are the mean of the channels, node values on Sopp's grid.
fn grey(brdf: &dyn Brdf) -> Measured {
    let mut table = Measured::sampled(Grid::sopp(), brdf);
    for v in &mut table.values {
        *v = [v.iter().sum::<f32>() / 3.0; 3];
    }
    table
}

fn options(model: ModelChoice, weights: Weights, limit_deg: f64) -> Options {
    Options {
        model,
        weights,
        max_angle: Angle::from_degrees(limit_deg),
        exponent_range: (1.0, 1e6),
        ..Options::default()
    }
}

/// Sum of squares of one channel as his residuals have it, from the error of a fit.
fn his_squares(weighted_error: f64, unweighted_error: f64, weights: Weights, cells: usize) -> f64 {
    match weights {
        Weights::None => unweighted_error.powi(2) * cells as f64,
        _ => weighted_error.powi(2),
    }
}

/// How the first stage ended, its sum of squares over the minimum, and whether a parameter is below 0.
///
/// Where the minimum is rounding (data of the model itself) 1e-10 of what the start values left stands for it.
fn outcome(run: &SoppRun, best: f64) -> (Ended, f64, bool) {
    let negative = run.diffuse.iter().chain(&run.specular).any(|x| *x < -1e-9) || run.exponent < 0.0;
    let Some(stage) = run.stages.first() else { return (Ended::Broken, f64::INFINITY, negative) };
    let first = stage.squares.first().copied().unwrap_or(f64::INFINITY);
    let last = stage.squares.last().copied().unwrap_or(f64::INFINITY);
    let floor = 1e-10 * first;
    (stage.ended, last.max(floor) / best.max(floor), negative)
}

fn fails(ratio: f64, negative: bool) -> bool {
    ratio.is_nan() || ratio > 1.01 || negative
}

/// All starts, weights and limits on one material.
fn trials(obs: &Observations) -> Vec<Trial> {
    let mut out = Vec::new();
    for weights in WEIGHTS {
        for limit in LIMITS_DEG {
            let o = options(ModelChoice::AshikhminShirleySimplified, weights, limit);
            let best = fit(obs, &o);
            let best = his_squares(best.weighted_error, best.unweighted_error, weights, best.cells_used);
            for start in STARTS {
                let values = SoppOptions { exponent: start, mean_only: true, ..SoppOptions::default() };
                let (ended, ratio, negative) = outcome(&sopp(obs, &o, &values), best);
                let cured = if fails(ratio, negative) {
                    let free = SoppOptions { lambda_max: 1e12, ..values };
                    let limited = SoppOptions { limited: true, ..values };
                    [free, limited].map(|v| {
                        let (_, ratio, negative) = outcome(&sopp(obs, &o, &v), best);
                        !fails(ratio, negative)
                    })
                } else {
                    [false; 2]
                };
                out.push(Trial { start, weights, ended, ratio, negative, cured });
            }
        }
    }
    out
}

fn failed(t: &Trial) -> bool {
    fails(t.ratio, t.negative)
}

/// His fits of table A.8 as truths, without noise.
fn family() -> Vec<Observations> {
    let text = std::fs::read_to_string(golden("sopp2017_fits.csv")).expect("golden table");
    let mut seen: Vec<String> = Vec::new();
    text.lines()
        .skip(1)
        .filter_map(|line| {
            let f: Vec<&str> = line.split(',').collect();
            let x = |k: usize| f.get(k).and_then(|s| s.parse::<f64>().ok());
            // one truth a material: its first fit
            let name = (*f.first()?).to_owned();
            if seen.contains(&name) {
                return None;
            }
            seen.push(name);
            let truth = AshikhminShirleySimplified {
                exponent: x(6)?,
                diffuse: [x(7)?, x(8)?, x(9)?],
                specular: [x(10)?, x(11)?, x(12)?],
            };
            Some(Observations::from_measured(&grey(&truth)))
        })
        .collect()
}

fn real(data: &RealData) -> Vec<(String, Observations)> {
    REAL.iter()
        .map(|name| {
            let (file, material) = name.split_once('#').map_or((*name, None), |(f, m)| (f, Some(m)));
            let mut path = data.file(file).display().to_string();
            if let Some(m) = material {
                path += &format!("#{m}");
            }
            let loaded: Loaded = formats::open(Path::new(&path)).unwrap_or_else(|e| panic!("{name}: {e}"));
            let brdf = loaded.as_brdf().unwrap_or_else(|| panic!("{name} is no function"));
            let short = material.unwrap_or(file).rsplit('/').next().unwrap_or(name).to_owned();
            (short, Observations::from_measured(&grey(brdf)))
        })
        .collect()
}

fn share(trials: &[Trial], of: impl Fn(&Trial) -> bool) -> String {
    format!("{} of {}", trials.iter().filter(|t| of(t)).count(), trials.len())
}

pub fn figures() -> Vec<Figure> {
    let clean: Vec<Trial> = family().par_iter().flat_map_iter(trials).collect();
    let mut out = vec![Figure::said(
        "his family, no noise: runs that fail",
        share(&clean, failed),
        "few",
        None,
        clean.iter().filter(|t| failed(t)).count() * 5 <= clean.len(),
    )];
    out.extend(conditions());
    match real_data("Sopp's method on real shapes") {
        None => out.push(Figure::said("real shapes", "GONIO_DATA is unset: did not run", "-", None, true)),
        Some(data) => out.extend(on_real_shapes(&real(&data))),
    }
    out
}

fn said(name: impl Into<String>, value: impl Into<String>) -> Figure {
    Figure::said(name, value, "as measured", None, true)
}

fn on_real_shapes(materials: &[(String, Observations)]) -> Vec<Figure> {
    let all: Vec<(usize, Vec<Trial>)> =
        materials.par_iter().enumerate().map(|(i, (_, obs))| (i, trials(obs))).collect();
    let mut out = Vec::new();
    let flat: Vec<&Trial> = all.iter().flat_map(|(_, t)| t).collect();
    let count = |of: &dyn Fn(&Trial) -> bool| flat.iter().filter(|t| of(t)).count();
    let n = flat.len();
    let bad = count(&failed);
    out.push(Figure::said("real shapes: runs that fail", format!("{bad} of {n}"), "some", None, bad > 0));
    for weights in WEIGHTS {
        let (b, m) = (count(&|t| failed(t) && t.weights == weights), count(&|t| t.weights == weights));
        out.push(said(format!("  with weights {}", weights.name()), format!("{b} of {m}")));
    }
    for start in STARTS {
        let (b, m) = (count(&|t| failed(t) && t.start == start), count(&|t| t.start == start));
        out.push(said(format!("  started at n = {start}"), format!("{b} of {m}")));
    }
    for (word, ended) in [
        ("stuck at the limit of λ", Ended::Stuck),
        ("out of iterations", Ended::Unfinished),
        ("equations broken", Ended::Broken),
    ] {
        out.push(said(
            format!("  of the failed: {word}"),
            count(&|t| failed(t) && t.ended == ended).to_string(),
        ));
    }
    out.push(said(
        "  of the failed: settled, but elsewhere than the global minimum",
        count(&|t| failed(t) && t.ended == Ended::Settled && !t.negative).to_string(),
    ));
    out.push(said(
        "  of the failed: a negative colour or exponent",
        count(&|t| failed(t) && t.negative).to_string(),
    ));
    for (k, cure) in ["without the upper limit of λ", "with parameters kept within limits"].iter().enumerate()
    {
        out.push(said(format!("  of the failed: cured {cure}"), count(&|t| t.cured[k]).to_string()));
    }
    for (i, trials) in &all {
        let bad = trials.iter().filter(|t| failed(t)).count();
        let worst = trials.iter().map(|t| t.ratio).fold(0.0, f64::max);
        out.push(said(
            format!("  {}: fail, worst squares over the minimum", materials[*i].0),
            format!("{bad} of {}, {worst:.3}", trials.len()),
        ));
    }
    out.push(annealing(materials));
    if let Some(folder) = pictures() {
        draw(&folder, materials);
    }
    out
}

/// Annealing on the same data: how often it comes within 1 % of our minimum.
fn annealing(materials: &[(String, Observations)]) -> Figure {
    let runs: Vec<bool> = materials
        .par_iter()
        .flat_map_iter(|(_, obs)| {
            let o = options(ModelChoice::AshikhminShirleySimplified, Weights::Ngan, 75.0);
            let best = fit(obs, &o).weighted_error;
            (1..=3u64).map(move |seed| {
                let how = AnnealOptions { iterations: 400, seed, ..AnnealOptions::default() };
                fit_by_annealing(obs, &o, how).weighted_error.powi(2) <= 1.01 * best.powi(2)
            })
        })
        .collect();
    let met = runs.iter().filter(|r| **r).count();
    said("annealing, 400 evaluations, 3 seeds: within 1 %", format!("{met} of {}", runs.len()))
}

/// Condition numbers of DᵀD (columns of length 1) at the truth: simplified against full, by width of the lobe and limit.
fn conditions() -> Vec<Figure> {
    let mut out = Vec::new();
    let none = |o: f64| options(ModelChoice::AshikhminShirleySimplified, Weights::None, o);
    for (n, r0) in [(30.0, 0.04), (300.0, 0.04), (300.0, 0.3)] {
        let truth = AshikhminShirley { diffuse: [0.2; 3], specular: [0.5; 3], exponent: n, r0 };
        let obs = Observations::from_measured(&grey(&truth));
        for limit in [45.0, 75.0, 85.0] {
            let start = SoppOptions {
                exponent: n,
                diffuse: 0.2,
                specular: 0.5,
                r0: Some(r0),
                iterations: 0,
                mean_only: true,
                ..SoppOptions::default()
            };
            let run = sopp(&obs, &none(limit), &start);
            let of = |k: usize| run.stages.get(k).map_or(f64::NAN, |s| s.condition_scaled);
            out.push(said(
                format!("condition of DᵀD at n = {n}, Rs = {r0}, to {limit}°: simplified, full"),
                format!("{:.1e}, {:.1e}", of(0), of(1)),
            ));
        }
    }
    // lobes narrower than the grid: n and cs act on the few nodes at the mirror direction alike
    for n in [25.0, 250.0, 2500.0, 25_000.0] {
        let truth = AshikhminShirleySimplified { diffuse: [0.2; 3], specular: [0.1; 3], exponent: n };
        let obs = Observations::from_measured(&grey(&truth));
        for weights in WEIGHTS {
            let start = SoppOptions {
                exponent: n,
                diffuse: 0.2,
                specular: 0.1,
                iterations: 0,
                mean_only: true,
                ..SoppOptions::default()
            };
            let o = options(ModelChoice::AshikhminShirleySimplified, weights, 75.0);
            let run = sopp(&obs, &o, &start);
            let s = run.stages.first();
            out.push(said(
                format!("n = {n}, weights {}: condition scaled, as solved, smallest pivot", weights.name()),
                format!(
                    "{:.1e}, {:.1e}, {:.1e}",
                    s.map_or(f64::NAN, |s| s.condition_scaled),
                    s.map_or(f64::NAN, |s| s.condition),
                    s.map_or(f64::NAN, |s| s.smallest_pivot)
                ),
            ));
        }
    }
    out
}

fn pictures() -> Option<PathBuf> {
    std::env::var_os("GONIO_PICTURES").map(PathBuf::from)
}

/// The error along n for a few materials, and the course of runs that fail.
fn draw(folder: &Path, materials: &[(String, Observations)]) {
    let chosen = [
        "carpaint_blue.mbsdf",
        "cc_ibiza_sunset_rgb.bsdf",
        "blue-metallic-paint",
        "chrome",
        "red-specular-plastic",
    ];
    let o = options(ModelChoice::AshikhminShirleySimplified, Weights::None, 75.0);
    let profile = |obs: &Observations| -> Vec<(f64, f64)> {
        let best = fit(obs, &o).unweighted_error;
        (0..=60)
            .map(|k| (f64::from(k) / 60.0 * 1e5f64.ln()).exp())
            .map(|n| (n, (colours_at(obs, &o, &[("exponent", n)]).unweighted_error / best).powi(2)))
            .collect()
    };
    let picked: Vec<&(String, Observations)> =
        materials.iter().filter(|m| chosen.contains(&m.0.as_str())).collect();
    let chart = Chart {
        x_label: "exponent n".to_owned(),
        y_label: "sum of squares over its minimum, best colours at each n".to_owned(),
        logarithmic: [true, true],
        lines: picked.iter().map(|(name, obs)| (name.clone(), profile(obs))).collect(),
        ..Chart::default()
    };
    chart.draw().save_png(&folder.join("fitting-error-along-n.png")).expect("a picture");
    let mut lines = Vec::new();
    let failing =
        ["color-changing-paint1", "color-changing-paint3", "white-paint", "red-specular-plastic", "chrome"];
    for (name, obs) in materials.iter().filter(|m| failing.contains(&m.0.as_str())) {
        let best = fit(obs, &o);
        let best = his_squares(best.weighted_error, best.unweighted_error, Weights::None, best.cells_used);
        let run = sopp(obs, &o, &SoppOptions { mean_only: true, ..SoppOptions::default() });
        if let Some(stage) = run.stages.first() {
            let course = stage.squares.iter().take(200).enumerate();
            lines.push((
                format!("{name}: {}", stage.ended.name()),
                course.map(|(i, s)| (i as f64 + 1.0, s / best)).collect(),
            ));
        }
    }
    let chart = Chart {
        x_label: "iteration of Sopp's first stage from n = 25".to_owned(),
        y_label: "sum of squares over the global minimum".to_owned(),
        logarithmic: [true, true],
        lines,
        ..Chart::default()
    };
    chart.draw().save_png(&folder.join("fitting-sopp-course.png")).expect("a picture");
}
