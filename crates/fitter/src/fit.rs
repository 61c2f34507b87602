//! The fit: search over the exponent (and r0), linear coefficients, what is known of them, and a status.

use gonio_brdf::{
    Model,
    models::{AshikhminShirley, AshikhminShirleySimplified, Lambert, LambertAshikhminShirley},
};

use crate::{
    ColourErrors, ModelChoice, Observations, Options, Weights,
    cache::{self, KNOTS},
    colour_error::Pair,
    linear::{Solution, Sums},
    problem::{At, Diffuse, Problem},
    search::minimise,
    uncertainty::{self, Equation, ILL_CONDITIONED},
};

/// How a fit ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// A minimum inside all bounds.
    Converged,
    /// The minimum lies on a bound of these parameters (cd, cs at 0; exponent or r0 at an end of its range).
    AtBound(Vec<&'static str>),
    /// The data do not tell some parameters apart; their uncertainties say which.
    IllConditioned,
    /// No measurement took part: nothing valid within the limit (or, with weights `sigma`, nothing with σ).
    NoData,
    /// The sum of squares is not a number: values too large to square.
    NonFinite,
}

impl Status {
    /// Name in files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::AtBound(_) => "at-bound",
            Self::IllConditioned => "ill-conditioned",
            Self::NoData => "no-data",
            Self::NonFinite => "non-finite",
        }
    }
}

/// A fitted parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// `exponent`, `r0`, `diffuse_r` … `specular_b`.
    pub name: &'static str,
    /// Best value.
    pub value: f64,
    /// Standard uncertainty (k = 1); `None` where the data leave it undetermined.
    pub sigma: Option<f64>,
}

/// Result of a fit. Always filled: without data the model is black.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The fitted model.
    pub model: Model,
    /// How it ended.
    pub status: Status,
    /// Parameters with their standard uncertainties, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// Covariance, row by row; NaN for undetermined parameters.
    pub covariance: Vec<Vec<f64>>,
    /// Condition number of the derivatives (columns scaled to length 1); infinite where a parameter has no influence.
    pub condition: f64,
    /// The weights used.
    pub weights: Weights,
    /// The weighted error by the weights' own definition, per channel mean: Ngan (3.5) and Sopp (4.25) in 1/sr, reduced χ for `sigma`,
    /// root mean square for `none`.
    pub weighted_error: f64,
    /// Root mean square of the residuals, 1/sr.
    pub unweighted_error: f64,
    /// Colour differences over the cells used.
    pub delta_e: ColourErrors,
    /// Cells or points that took part.
    pub cells_used: usize,
    /// Valid ones that did not: beyond the limit, filled, without σ.
    pub cells_left_out: usize,
    /// Measured − fitted per place of the table (or list), 1/sr; NaN where the cell did not take part.
    pub residuals: Vec<[f32; 3]>,
}

const COLOURS: [[&str; 3]; 2] =
    [["diffuse_r", "diffuse_g", "diffuse_b"], ["specular_r", "specular_g", "specular_b"]];

/// Range of r0 searched: below, cs·r0 alone is known; at 1 the full model has no diffuse term.
const R0: (f64, f64) = (0.002, 0.98);

/// A point of the search.
#[derive(Clone, Copy)]
struct Point {
    exponent: f64,
    r0: f64,
    channels: [Solution; 3],
}

impl Fit {
    /// A parameter by name.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// Interval of `k` standard uncertainties about a parameter. The exponent's is symmetric in its logarithm; cd and cs end at 0, r0 within 0…1.
    /// `None` for a name that is not there; without bounds where the parameter is undetermined.
    #[must_use]
    pub fn interval(&self, name: &str, k: f64) -> Option<(f64, f64)> {
        let p = self.parameter(name)?;
        let Some(s) = p.sigma else {
            return Some((0.0, if name == "r0" { 1.0 } else { f64::INFINITY }));
        };
        Some(match name {
            "exponent" => {
                let factor = (k * s / p.value.max(f64::MIN_POSITIVE)).exp();
                (p.value / factor, p.value * factor)
            }
            "r0" => ((p.value - k * s).max(0.0), (p.value + k * s).min(1.0)),
            _ => ((p.value - k * s).max(0.0), p.value + k * s),
        })
    }
}

/// Fits a model. Never panics on data and needs no starting value; see [`Fit::status`].
///
/// Called again with more rows of the same grid it pays for the new rows alone: the averaged lobes are kept.
#[must_use]
pub fn fit(obs: &Observations, options: &Options) -> Fit {
    match options.model {
        ModelChoice::Auto => {
            let simplified = Options { model: ModelChoice::AshikhminShirleySimplified, ..options.clone() };
            let with_lobe = fit(obs, &simplified);
            let seen = |name: &&str| {
                with_lobe.parameter(name).is_some_and(|p| p.sigma.is_some_and(|s| p.value > 2.0 * s))
            };
            if COLOURS[1].iter().any(seen) || with_lobe.status == Status::NoData {
                with_lobe
            } else {
                fit(obs, &Options { model: ModelChoice::Lambert, ..options.clone() })
            }
        }
        choice => fit_one(obs, options, choice),
    }
}

fn fit_one(obs: &Observations, options: &Options, choice: ModelChoice) -> Fit {
    let diffuse = match choice {
        ModelChoice::AshikhminShirley => Diffuse::AshikhminShirley,
        _ => Diffuse::Lambert,
    };
    let problem = Problem::new(obs, options, diffuse);
    if problem.len() == 0 {
        return empty(obs, options, choice, Status::NoData);
    }
    let range = search_range(options);
    let best = match choice {
        ModelChoice::Lambert => lambert(&problem),
        _ => search(&problem, range, has_r0(choice)),
    };
    let finite =
        best.channels.iter().all(|c| c.squares.is_finite() && c.diffuse.is_finite() && c.lobe.is_finite());
    if !finite {
        return empty(obs, options, choice, Status::NonFinite);
    }
    finish(obs, options, choice, &problem, &best, range)
}

fn has_r0(choice: ModelChoice) -> bool {
    matches!(choice, ModelChoice::LambertAshikhminShirley | ModelChoice::AshikhminShirley)
}

/// The range of ln n, whatever the caller asks for.
fn search_range(options: &Options) -> (f64, f64) {
    let whole = (0.0, cache::knot(KNOTS - 1).ln());
    let end = |x: f64, other: f64| if x > 0.0 { x.ln().clamp(whole.0, whole.1) } else { other };
    let (low, high) = (end(options.exponent_range.0, whole.0), end(options.exponent_range.1, whole.1));
    if low < high { (low, high) } else { whole }
}

fn lambert(problem: &Problem) -> Point {
    let sums = problem.sums(At::Knot(0));
    let channels =
        sums.map(|s| Sums { dp: 0.0, dq: 0.0, pp: 0.0, pq: 0.0, qq: 0.0, py: 0.0, qy: 0.0, ..s }.solve(1.0));
    Point { exponent: 0.0, r0: 1.0, channels }
}

/// Global search over ln n: the coarse grid brackets, Brent refines the best two brackets.
fn search(problem: &Problem, range: (f64, f64), with_r0: bool) -> Point {
    let point = |exponent: f64, sums: &[Sums; 3]| {
        let r0 = if with_r0 { best_r0(sums) } else { 1.0 };
        Point { exponent, r0, channels: [0, 1, 2].map(|c| sums[c].solve(r0)) }
    };
    let squares = |p: &Point| p.channels.iter().map(|c| c.squares).sum::<f64>();
    let knots: Vec<(f64, f64)> = (0..KNOTS)
        .map(|k| (cache::knot(k).ln(), k))
        .filter(|&(x, _)| x >= range.0 - 1e-9 && x <= range.1 + 1e-9)
        .map(|(x, k)| (x, squares(&point(cache::knot(k), &problem.sums(At::Knot(k))))))
        .collect();
    let mut at: Vec<f64> = knots.iter().map(|k| k.0).collect();
    let mut values: Vec<f64> = knots.iter().map(|k| k.1).collect();
    // ends of a range that fall between knots
    for (end, front) in [(range.0, true), (range.1, false)] {
        if !at.iter().any(|x| (x - end).abs() < 1e-9) {
            let v = squares(&point(end.exp(), &problem.sums(At::Exponent(end.exp()))));
            let place = if front { 0 } else { at.len() };
            at.insert(place, end);
            values.insert(place, v);
        }
    }
    let last = at.len() - 1;
    let mut minima: Vec<usize> = (0..=last)
        .filter(|&k| (k == 0 || values[k] <= values[k - 1]) && (k == last || values[k] <= values[k + 1]))
        .collect();
    minima.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    // a minimum between knots can be deeper than its knot shows: a second one is refined, too, when it comes near
    let mut best: Option<(f64, Point)> = None;
    for &k in minima.iter().take(2) {
        let worth = best.as_ref().is_none_or(|(v, _)| values[k] < 1.5 * v);
        if !worth {
            continue;
        }
        let (a, b) = (at[k.saturating_sub(1)], at[(k + 1).min(last)]);
        let (x, v) = minimise(a, b, 1e-5, |x| squares(&point(x.exp(), &problem.sums(At::Exponent(x.exp())))));
        // a bracket at the end of the range: the end itself may be lowest
        let (x, v) = if values[k] < v { (at[k], values[k]) } else { (x, v) };
        if best.as_ref().is_none_or(|(w, _)| v < *w) {
            best = Some((v, point(x.exp(), &problem.sums(At::Exponent(x.exp())))));
        }
    }
    best.map_or_else(|| lambert(problem), |(_, p)| p)
}

/// The r0 that leaves the smallest squares at a given exponent: a coarse logarithmic grid, then Brent. Costs no look at the data.
fn best_r0(sums: &[Sums; 3]) -> f64 {
    const STEPS: usize = 16;
    let squares = |x: f64| sums.iter().map(|s| s.solve(x.exp()).squares).sum::<f64>();
    let (low, high) = (R0.0.ln(), R0.1.ln());
    let at = |k: usize| low + (high - low) * k as f64 / STEPS as f64;
    let best = (0..=STEPS).min_by(|&a, &b| squares(at(a)).total_cmp(&squares(at(b)))).unwrap_or(0);
    let (x, v) = minimise(at(best.saturating_sub(1)), at((best + 1).min(STEPS)), 1e-8, squares);
    if squares(at(best)) < v { at(best).exp() } else { x.exp() }
}

/// Names in the order of the covariance.
fn names(choice: ModelChoice) -> Vec<&'static str> {
    let mut out = Vec::new();
    if choice != ModelChoice::Lambert {
        out.push("exponent");
    }
    if has_r0(choice) {
        out.push("r0");
    }
    out.extend(COLOURS[0]);
    if choice != ModelChoice::Lambert {
        out.extend(COLOURS[1]);
    }
    out
}

/// cd of the file from the coefficient of the diffuse term.
fn diffuse_scale(choice: ModelChoice, r0: f64) -> f64 {
    if choice == ModelChoice::AshikhminShirley { (1.0 - r0).recip() } else { 1.0 }
}

fn model(choice: ModelChoice, p: &Point) -> Model {
    let k = diffuse_scale(choice, p.r0);
    let (diffuse, specular) = (p.channels.map(|c| c.diffuse * k), p.channels.map(|c| c.lobe));
    let (exponent, r0) = (p.exponent, p.r0);
    match choice {
        ModelChoice::Lambert => Model::Lambert(Lambert { diffuse }),
        ModelChoice::LambertAshikhminShirley => Model::LambertAshikhminShirley(LambertAshikhminShirley {
            diffuse,
            specular,
            exponent,
            r0: Some(r0),
        }),
        ModelChoice::AshikhminShirley => {
            Model::AshikhminShirley(AshikhminShirley { diffuse, specular, exponent, r0 })
        }
        ModelChoice::AshikhminShirleySimplified | ModelChoice::Auto => {
            Model::AshikhminShirleySimplified(AshikhminShirleySimplified { diffuse, specular, exponent })
        }
    }
}

/// The black result of a fit that could not be made.
fn empty(obs: &Observations, options: &Options, choice: ModelChoice, status: Status) -> Fit {
    let black = Point { exponent: 1.0, r0: R0.1, channels: [Solution::default(); 3] };
    let names = names(choice);
    Fit {
        model: model(choice, &black),
        status,
        covariance: vec![vec![f64::NAN; names.len()]; names.len()],
        parameters: names.into_iter().map(|name| Parameter { name, value: 0.0, sigma: None }).collect(),
        condition: f64::INFINITY,
        weights: options.weights,
        weighted_error: f64::NAN,
        unweighted_error: f64::NAN,
        delta_e: ColourErrors::default(),
        cells_used: 0,
        cells_left_out: obs.len(),
        residuals: vec![[f32::NAN; 3]; obs.places],
    }
}

/// Everything that is said of a minimum once it is found.
fn finish(
    obs: &Observations,
    options: &Options,
    choice: ModelChoice,
    problem: &Problem,
    best: &Point,
    range: (f64, f64),
) -> Fit {
    let has_lobe = choice != ModelChoice::Lambert;
    let lobes = if has_lobe { problem.lobe(best.exponent) } else { Vec::new() };
    let s = 1.0 - best.r0;
    let lobe_at = |i: usize| lobes.get(i).copied().unwrap_or_default();
    let mut residuals = vec![[f32::NAN; 3]; obs.places];
    let mut pairs: Vec<Pair> = Vec::with_capacity(problem.len());
    let (mut weighted, mut squares) = (0.0, 0.0);
    for (i, item) in problem.items().enumerate() {
        let l = lobe_at(i);
        let lobe = best.r0 * l.p + s * l.q;
        let fitted =
            [0, 1, 2].map(|c| best.channels[c].diffuse * item.diffuse + best.channels[c].lobe * lobe);
        let r = [0, 1, 2].map(|c| item.datum.value[c] - fitted[c]);
        for (w, x) in item.weight.iter().zip(r) {
            weighted += w * x * x;
            squares += x * x;
        }
        if let Some(out) = residuals.get_mut(item.datum.place as usize) {
            *out = r.map(|x| x as f32);
        }
        pairs.push((item.datum.geometry.from_mirror().degrees(), item.datum.value, fitted));
    }
    let names = names(choice);
    let scale = diffuse_scale(choice, best.r0);
    let (first_d, first_s) = (names.len() - if has_lobe { 6 } else { 3 }, names.len() - 3);
    let equations = problem.items().enumerate().flat_map(|(i, item)| {
        let l = lobe_at(i);
        (0..3).map(move |c| {
            let (cd, cs) = (best.channels[c].diffuse, best.channels[c].lobe);
            let lobe = best.r0 * l.p + s * l.q;
            let by_exponent = cs * (best.r0 * l.dp + s * l.dq) / best.exponent;
            // the full model's diffuse coefficient is (1 − r0) cd
            let by_r0 = cs * (l.p - l.q)
                - if choice == ModelChoice::AshikhminShirley { cd * scale * item.diffuse } else { 0.0 };
            let d = (first_d + c, item.diffuse / scale);
            let none = (first_d + c, 0.0);
            Equation {
                weight: item.weight[c],
                residual: item.datum.value[c] - cd * item.diffuse - cs * lobe,
                sigma: item.datum.sigma.map(|s| s[c]),
                derivatives: match (has_lobe, has_r0(choice)) {
                    (false, _) => [d, none, none, none],
                    (true, false) => [(0, by_exponent), d, (first_s + c, lobe), none],
                    (true, true) => [(0, by_exponent), (1, by_r0), d, (first_s + c, lobe)],
                },
                block: i as u32 / 24,
            }
        })
    });
    let fitted = model(choice, best);
    let values: Vec<f64> = names
        .iter()
        .map(|&n| match n {
            "exponent" => best.exponent,
            "r0" => best.r0,
            n => {
                let pick = |k: usize| COLOURS[k].iter().position(|c| *c == n);
                pick(0).map_or_else(
                    || pick(1).map_or(0.0, |c| best.channels[c].lobe),
                    |c| best.channels[c].diffuse * scale,
                )
            }
        })
        .collect();
    let common = options.common_relative_uncertainty.unwrap_or(obs.common_relative_uncertainty);
    let g: Vec<f64> = names
        .iter()
        .zip(&values)
        .map(|(n, v)| if matches!(*n, "exponent" | "r0") { 0.0 } else { *v })
        .collect();
    let known =
        uncertainty::covariance(names.len(), equations, (&g, if common.is_finite() { common } else { 0.0 }));
    let parameters: Vec<Parameter> = names
        .iter()
        .zip(&values)
        .enumerate()
        .map(|(i, (&name, &value))| {
            let variance = known.covariance[i][i];
            Parameter {
                name,
                value,
                sigma: (variance.is_finite() && variance >= 0.0).then(|| variance.sqrt()),
            }
        })
        .collect();
    let status = status(&parameters, known.condition, range);
    let count = (3 * problem.len()) as f64;
    let weighted_error = match options.weights {
        Weights::Ngan => (weighted / (3.0 * problem.solid_angle)).sqrt(),
        Weights::Sopp => (weighted / 3.0).sqrt() / problem.solid_angle,
        Weights::Sigma => (weighted / (count - names.len() as f64).max(1.0)).sqrt(),
        Weights::None => (weighted / count).sqrt(),
    };
    Fit {
        model: fitted,
        status,
        parameters,
        covariance: known.covariance,
        condition: known.condition,
        weights: options.weights,
        weighted_error,
        unweighted_error: (squares / count).sqrt(),
        delta_e: ColourErrors::of(&pairs),
        cells_used: problem.len(),
        cells_left_out: obs.len() - problem.len(),
        residuals,
    }
}

fn status(parameters: &[Parameter], condition: f64, range: (f64, f64)) -> Status {
    let at_end = |x: f64, (low, high): (f64, f64)| x <= low + 1e-4 || x >= high - 1e-4;
    let bound: Vec<&'static str> = parameters
        .iter()
        .filter(|p| match p.name {
            "exponent" => at_end(p.value.max(f64::MIN_POSITIVE).ln(), range),
            "r0" => at_end(p.value.ln(), (R0.0.ln(), R0.1.ln())),
            _ => p.value <= 0.0,
        })
        .map(|p| p.name)
        .collect();
    if !bound.is_empty() {
        Status::AtBound(bound)
    } else if condition < ILL_CONDITIONED {
        Status::Converged
    } else {
        Status::IllConditioned
    }
}
