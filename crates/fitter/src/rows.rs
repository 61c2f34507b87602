//! The data that take part in a fit and how they count.

use gonio_brdf::Flag;

use crate::{Observations, Options, Weights, observations::Datum};

/// One datum in the fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub datum: Datum,
    /// What is fitted: the value, or a working value of a robust or logarithmic fit.
    pub value: [f64; 3],
    /// Weight of the square, per channel.
    pub weight: [f64; 3],
}

/// What takes part.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    pub rows: Vec<Row>,
    /// Whether the weights of the three channels are the same.
    pub shared: bool,
    /// Σ solid angle, the denominator of (3.5) and (4.25).
    pub solid_angle: f64,
    /// Left out because the logarithm of a value ≤ 0 does not exist.
    pub without_logarithm: usize,
}

/// Values below this share of the mean have no logarithm worth fitting.
const LEAST_FOR_LOGARITHM: f64 = 1e-6;

impl Rows {
    pub(crate) fn new(obs: &Observations, options: &Options) -> Self {
        let limit = options.max_angle.degrees() + 1e-9;
        let mut chosen: Vec<Datum> = obs
            .data
            .iter()
            .filter(|d| d.geometry.theta_i.degrees() <= limit && d.geometry.theta_o.degrees() <= limit)
            .filter(|d| d.flag == Flag::Measured || (options.include_filled && d.flag != Flag::Invalid))
            .filter(|d| options.weights != Weights::Sigma || d.sigma.is_some())
            .copied()
            .collect();
        let before = chosen.len();
        if options.weights == Weights::LogRelative {
            let mean =
                chosen.iter().flat_map(|d| d.value).map(f64::abs).sum::<f64>() / (3 * before).max(1) as f64;
            chosen.retain(|d| d.value.iter().all(|v| *v > LEAST_FOR_LOGARITHM * mean));
        }
        let solid_angle: f64 = chosen.iter().map(|d| d.solid_angle).sum();
        let without_logarithm = before - chosen.len();
        let rows = chosen
            .into_iter()
            .map(|datum| Row {
                datum,
                value: datum.value,
                weight: weight(&datum, options.weights, solid_angle),
            })
            .collect();
        let shared = !matches!(options.weights, Weights::Sigma | Weights::LogRelative);
        Self { rows, shared, solid_angle, without_logarithm }
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Some of the rows, each counting `times` as much.
    pub(crate) fn some(&self, chosen: &[(usize, f64)]) -> Self {
        let rows = chosen
            .iter()
            .filter_map(|&(i, times)| {
                self.rows.get(i).map(|r| Row { weight: r.weight.map(|w| w * times), ..*r })
            })
            .collect();
        Self { rows, ..*self }
    }
}

/// Weight of the square of a residual, per channel.
pub(crate) fn weight(d: &Datum, weights: Weights, total: f64) -> [f64; 3] {
    let cos = d.geometry.theta_i.cos().max(0.0);
    // all areas 0 (a grid of one node): every cell alike
    let w = if total > 0.0 { d.solid_angle } else { 1.0 };
    match weights {
        Weights::Sopp => [(w * cos).powi(2); 3],
        Weights::Ngan => [w * cos * cos; 3],
        Weights::Sigma => d.sigma.map_or([0.0; 3], |s| s.map(|s| 1.0 / (s * s))),
        // of the logarithm near the value: a first step towards it
        Weights::LogRelative => d.value.map(|v| w / (v * v)),
        Weights::None => [1.0; 3],
    }
}
