//! The fit: what was found, what is known of it, and how it ended.

use gonio_brdf::{Coat, Model};

use crate::{
    CoatChoice, ColourErrors, Loss, ModelChoice, Observations, Options, Reason, Status, Weights,
    colour_error::Pair,
    family::{Family, Scale},
    joint,
    rows::Rows,
    solve::{Solved, solve},
    uncertainty::{self, Equation, ILL_CONDITIONED},
};

/// A fitted parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// `exponent`, `alpha`, `r0` …, `diffuse_r` … `specular_b`; with several lobes `lobe1_alpha` … `lobe3_specular_b`.
    pub name: &'static str,
    /// Best value; not a number where it has no meaning (the width of a lobe without colour).
    pub value: f64,
    /// Standard uncertainty (k = 1); `None` where the data leave it undetermined.
    pub sigma: Option<f64>,
}

/// Result of a fit. Always filled: without data the model is black.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The fitted model.
    pub model: Model,
    /// Its coat, if one was asked for.
    pub coat: Option<Coat>,
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
    /// The loss used.
    pub loss: Loss,
    /// The weighted error by the weights' own definition, per channel mean: Ngan (3.5) and Sopp (4.25) in 1/sr, reduced χ for `sigma`,
    /// root mean square of ln f − ln y for `log-relative`, root mean square for `none`.
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
    /// What the model cannot follow, in plain words, by the rules of the module `notes`; empty where nothing stands out.
    pub notes: Vec<String>,
    /// Pairs of parameters that the data hardly tell apart, with their correlation (beyond ±0.98).
    pub inseparable: Vec<(&'static str, &'static str, f64)>,
    /// Nonlinear parameters whose interval is symmetric in the logarithm.
    pub(crate) logarithmic: Vec<&'static str>,
}

impl Fit {
    /// A parameter by name.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// Interval of `k` standard uncertainties about a parameter. That of an exponent or a width is symmetric in its logarithm; colours end at 0, r0
    /// within 0…1. `None` for a name that is not there; without bounds where the parameter is undetermined.
    #[must_use]
    pub fn interval(&self, name: &str, k: f64) -> Option<(f64, f64)> {
        let p = self.parameter(name)?;
        let r0 = name.ends_with("r0");
        let Some(s) = p.sigma else {
            return Some((0.0, if r0 { 1.0 } else { f64::INFINITY }));
        };
        Some(if r0 {
            ((p.value - k * s).max(0.0), (p.value + k * s).min(1.0))
        } else if self.logarithmic.contains(&name) {
            let factor = (k * s / p.value.max(f64::MIN_POSITIVE)).exp();
            (p.value / factor, p.value * factor)
        } else if name.ends_with("_deg") {
            (p.value - k * s, p.value + k * s)
        } else {
            ((p.value - k * s).max(0.0), p.value + k * s)
        })
    }
}

/// Fits a model. Never panics on data and needs no starting value; see [`Fit::status`].
#[must_use]
pub fn fit(obs: &Observations, options: &Options) -> Fit {
    if options.model != ModelChoice::Auto {
        return fit_one(obs, options, options.model);
    }
    let with_lobe = fit_one(obs, options, ModelChoice::AshikhminShirleySimplified);
    let seen = |name: &str| {
        with_lobe.parameter(name).is_some_and(|p| p.sigma.is_some_and(|s| p.value > 2.0 * s))
    };
    let lobe = ["specular_r", "specular_g", "specular_b"].into_iter().any(seen);
    // where nothing was fitted for want of data, the simpler model may still be
    let fewer = matches!(with_lobe.status, Status::TooFewData { .. });
    if lobe || (!with_lobe.status.is_fitted() && !fewer) {
        with_lobe
    } else {
        fit_one(obs, options, ModelChoice::Lambert)
    }
}

fn fit_one(obs: &Observations, options: &Options, choice: ModelChoice) -> Fit {
    fit_by(obs, options, choice, &|family| solve(obs, options, family))
}

/// A fit whose place is found by `method`.
pub(crate) fn fit_by(
    obs: &Observations,
    options: &Options,
    choice: ModelChoice,
    method: &dyn Fn(&Family) -> Solved,
) -> Fit {
    let family = Family::new(options, choice);
    if let Some(reason) = inapplicable(obs, options, choice) {
        return empty(obs, options, &family, Status::NotApplicable(reason), 0);
    }
    let taking_part = Rows::new(obs, options).len();
    if taking_part == 0 {
        return empty(obs, options, &family, Status::NoData, 0);
    }
    let parameters = family.parameters.len() + family.parts.len();
    if taking_part < parameters {
        let status = Status::TooFewData { values: taking_part, parameters };
        return empty(obs, options, &family, status, taking_part);
    }
    let solved = method(&family);
    if !solved.finite {
        return empty(obs, options, &family, Status::NonFinite, 0);
    }
    finish(obs, options, &family, &solved)
}

fn inapplicable(obs: &Observations, options: &Options, choice: ModelChoice) -> Option<Reason> {
    if matches!(options.coat, CoatChoice::Index(n) if !(n.is_finite() && n > 1.0)) {
        return Some(Reason::CoatIndex);
    }
    let anisotropic = choice == ModelChoice::AshikhminShirleyAnisotropic;
    (anisotropic && !obs.full_azimuths).then_some(Reason::NoAzimuths)
}

/// Names in the order of the covariance.
fn names(family: &Family) -> Vec<&'static str> {
    let nonlinear = family.parameters.iter().map(|p| p.name);
    nonlinear.chain((0..family.parts.len()).flat_map(|k| family.colour_names(k))).collect()
}

/// The black result of a fit that could not be made.
fn empty(obs: &Observations, options: &Options, family: &Family, status: Status, used: usize) -> Fit {
    let names = names(family);
    let values: Vec<f64> = family.parameters.iter().map(|p| p.bounds.1).collect();
    let file = family.model(&values, &vec![[0.0; 3]; family.parts.len()]);
    Fit {
        model: file.model,
        coat: file.coat.filter(|c| c.index.is_finite() && c.index > 1.0),
        status,
        covariance: vec![vec![f64::NAN; names.len()]; names.len()],
        parameters: names.into_iter().map(|name| Parameter { name, value: f64::NAN, sigma: None }).collect(),
        condition: f64::INFINITY,
        weights: options.weights,
        loss: options.loss,
        weighted_error: f64::NAN,
        unweighted_error: f64::NAN,
        delta_e: ColourErrors::default(),
        cells_used: used,
        cells_left_out: obs.len() - used,
        residuals: vec![[f32::NAN; 3]; obs.places],
        notes: Vec::new(),
        inseparable: Vec::new(),
        logarithmic: Vec::new(),
    }
}

/// Everything that is said of a minimum once it is found.
fn finish(obs: &Observations, options: &Options, family: &Family, solved: &Solved) -> Fit {
    let layout = &solved.layout;
    let mut residuals = vec![[f32::NAN; 3]; obs.places];
    let mut pairs: Vec<Pair> = Vec::with_capacity(solved.rows.len());
    let (mut weighted, mut squares) = (0.0, 0.0);
    for (row, z) in solved.rows.rows.iter().zip(&solved.columns) {
        let d = &row.datum;
        let fitted = joint::fitted(z, layout, &solved.colours);
        let r = [0, 1, 2].map(|c| d.value[c] - fitted[c]);
        let plain = crate::rows::weight(d, options.weights, solved.rows.solid_angle);
        for c in 0..3 {
            squares += r[c] * r[c];
            weighted += if options.weights == Weights::LogRelative {
                let w = plain[c] * d.value[c] * d.value[c];
                w * (d.value[c] / fitted[c].max(1e-12 * d.value[c])).ln().powi(2)
            } else {
                plain[c] * r[c] * r[c]
            };
        }
        if let Some(out) = residuals.get_mut(d.place as usize) {
            *out = r.map(|x| x as f32);
        }
        pairs.push((d.geometry.from_mirror().degrees(), d.value, fitted));
    }
    let p = family.parameters.len();
    let names = names(family);
    // derivatives are by what the solver walks on: times this they are by the parameter
    let unwalked: Vec<f64> =
        family.parameters.iter().zip(&solved.q).map(|(p, &q)| p.slope(q).recip()).collect();
    let equations = solved.rows.rows.iter().zip(&solved.columns).enumerate().flat_map(|(i, (row, z))| {
        let unwalked = &unwalked;
        (0..3).map(move |c| {
            let (mut derivatives, count) = joint::derivatives(z, layout, &solved.colours, c);
            for (d, k) in derivatives.iter_mut().zip(unwalked) {
                d.1 *= k;
            }
            Equation {
                weight: row.weight[c],
                residual: row.value[c] - joint::fitted(z, layout, &solved.colours)[c],
                sigma: row.datum.sigma.map(|s| s[c]),
                derivatives,
                count,
                block: i as u32 / 24,
            }
        })
    });
    let walked_values = family.values(&solved.q);
    let values: Vec<f64> = walked_values.iter().copied().chain(solved.colours.iter().flatten().copied()).collect();
    let common = options.common_relative_uncertainty.unwrap_or(obs.common_relative_uncertainty);
    let g: Vec<f64> = values.iter().enumerate().map(|(i, v)| if i < p { 0.0 } else { *v }).collect();
    let known =
        uncertainty::covariance(names.len(), equations, (&g, if common.is_finite() { common } else { 0.0 }));
    let meaningless = meaningless(family, solved);
    let parameters: Vec<Parameter> = names
        .iter()
        .zip(&values)
        .enumerate()
        .map(|(i, (&name, &value))| {
            let variance = known.covariance[i][i];
            if meaningless.contains(&i) {
                return Parameter { name, value: f64::NAN, sigma: None };
            }
            Parameter { name, value, sigma: (variance.is_finite() && variance >= 0.0).then(|| variance.sqrt()) }
        })
        .collect();
    let status = status(family, solved, &parameters, known.condition);
    let count = (3 * solved.rows.len()) as f64;
    let total = if solved.rows.solid_angle > 0.0 { solved.rows.solid_angle } else { count / 3.0 };
    let weighted_error = match options.weights {
        Weights::Ngan | Weights::LogRelative => (weighted / (3.0 * total)).sqrt(),
        Weights::Sopp => (weighted / 3.0).sqrt() / total,
        Weights::Sigma => (weighted / (count - names.len() as f64).max(1.0)).sqrt(),
        Weights::None => (weighted / count).sqrt(),
    };
    let mut notes = crate::notes::of_residuals(&solved.rows, &pairs);
    if solved.rows.without_logarithm > 0 {
        notes.push(format!(
            "{} cells with a value at or below 0 took no part: they have no logarithm",
            solved.rows.without_logarithm
        ));
    }
    let inseparable = crate::notes::inseparable(&names, &known.covariance);
    let file = family.model(&walked_values, &solved.colours);
    Fit {
        model: file.model,
        coat: file.coat,
        status,
        parameters,
        covariance: known.covariance,
        condition: known.condition,
        weights: options.weights,
        loss: options.loss,
        weighted_error,
        unweighted_error: (squares / count).sqrt(),
        delta_e: ColourErrors::of(&pairs),
        cells_used: solved.rows.len(),
        cells_left_out: obs.len() - solved.rows.len(),
        residuals,
        notes,
        inseparable,
        logarithmic: family
            .parameters
            .iter()
            .filter(|p| p.scale == Scale::Log)
            .map(|p| p.name)
            .collect(),
    }
}

/// Nonlinear parameters that only colourless terms depend on.
fn meaningless(family: &Family, solved: &Solved) -> Vec<usize> {
    let dark = |k: usize| solved.colours.get(k).is_none_or(|c| c.iter().all(|x| *x == 0.0));
    (0..family.parameters.len())
        .filter(|p| {
            let coat = family.coated == crate::family::Coated::Parameter(*p);
            !coat && family.parts.iter().enumerate().all(|(k, part)| !part.uses.contains(p) || dark(k))
        })
        .collect()
}

fn status(family: &Family, solved: &Solved, parameters: &[Parameter], condition: f64) -> Status {
    let walking = family.parameters.iter().zip(&solved.q).zip(parameters).filter_map(|((f, &q), p)| {
        let (low, high) = f.walked();
        let margin = 1e-4 * (high - low).min(1.0);
        (!p.value.is_nan() && (q <= low + margin || q >= high - margin)).then_some(f.name)
    });
    let colours = parameters.iter().skip(family.parameters.len()).filter(|p| p.value <= 0.0).map(|p| p.name);
    let bound: Vec<&'static str> = walking.chain(colours).collect();
    if !bound.is_empty() {
        Status::AtBound(bound)
    } else if condition >= ILL_CONDITIONED || condition.is_nan() {
        Status::IllConditioned
    } else if solved.converged {
        Status::Converged
    } else {
        Status::Stalled
    }
}
