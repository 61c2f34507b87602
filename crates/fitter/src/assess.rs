//! How well a given function follows data: the errors of [`crate::fit`] without a fit. For published parameters, other methods, held-out data.

use gonio_brdf::{Brdf, ModelFile, average};
use rayon::prelude::*;

use crate::{
    ColourErrors, Fit, Observations, Options, Weights,
    colour_error::Pair,
    fit::fit_by,
    observations::Source,
    rows::{Row, Rows},
    solve,
};

/// Errors of a given function on data.
#[derive(Clone, Debug)]
pub struct Assessment {
    /// As [`crate::Fit::weighted_error`]; with weights `sigma` the root mean square of residual over σ (nothing was fitted, so no degree of freedom is lost).
    pub weighted_error: f64,
    /// Root mean square of the residuals, 1/sr.
    pub unweighted_error: f64,
    /// Colour differences.
    pub delta_e: ColourErrors,
    /// Cells or points compared.
    pub cells: usize,
}

/// The best colours at given nonlinear parameters, in the order in which [`crate::fit`] names them (`exponent`, `r0`, `alpha` …), with all that is said of a fit.
///
/// Values outside the range searched are taken as they are; missing ones are the middle of their range.
#[must_use]
pub fn colours_at(obs: &Observations, options: &Options, values: &[(&str, f64)]) -> Fit {
    fit_by(obs, options, options.model, &|family| {
        let q: Vec<f64> = family
            .parameters
            .iter()
            .map(|p| {
                let (low, high) = p.walked();
                let given = values.iter().find(|v| v.0 == p.name).map(|v| v.1);
                given.map_or(0.5 * (low + high), |x| p.place(x))
            })
            .collect();
        solve::at(obs, options, family, &q, None, true)
    })
}

/// Errors of a model with its coat, averaged over cells and lamp as the data say.
#[must_use]
pub fn assess(obs: &Observations, options: &Options, model: &ModelFile) -> Assessment {
    judged(obs, options, &|row| match &obs.source {
        Source::Grid(grid, meaning) => {
            average::model_cell_mean(model, grid, *meaning, grid.coordinates(row.datum.place as usize))
        }
        Source::Points(points) => at_point(points, row, model),
    })
}

/// Errors of any BRDF.
#[must_use]
pub fn assess_brdf(obs: &Observations, options: &Options, brdf: &dyn Brdf) -> Assessment {
    judged(obs, options, &|row| match &obs.source {
        Source::Grid(grid, meaning) => {
            average::adaptive_cell_mean(brdf, grid, *meaning, grid.coordinates(row.datum.place as usize))
        }
        Source::Points(points) => at_point(points, row, brdf),
    })
}

fn at_point(points: &[(gonio_optics::Vec3, gonio_optics::Vec3)], row: &Row, brdf: &dyn Brdf) -> [f64; 3] {
    points.get(row.datum.cell as usize).map_or([0.0; 3], |(l, v)| brdf.eval(*l, *v))
}

/// Measured and given values with their distance from the mirror direction, of the rows that take part.
pub(crate) fn pairs(obs: &Observations, options: &Options, model: &ModelFile) -> Vec<Pair> {
    let value = |row: &Row| match &obs.source {
        Source::Grid(grid, meaning) => {
            average::model_cell_mean(model, grid, *meaning, grid.coordinates(row.datum.place as usize))
        }
        Source::Points(points) => at_point(points, row, model),
    };
    let rows = Rows::new(obs, options);
    rows.rows
        .par_iter()
        .map(|r| (r.datum.geometry.from_mirror().degrees(), r.datum.value, value(r)))
        .collect()
}

fn judged(obs: &Observations, options: &Options, value: &(dyn Fn(&Row) -> [f64; 3] + Sync)) -> Assessment {
    let rows = Rows::new(obs, options);
    let given: Vec<[f64; 3]> = rows.rows.par_iter().map(value).collect();
    let (mut weighted, mut squares) = (0.0, 0.0);
    let mut pairs: Vec<Pair> = Vec::with_capacity(rows.len());
    for (row, f) in rows.rows.iter().zip(&given) {
        for ((&f, y), weight) in f.iter().zip(row.datum.value).zip(row.weight) {
            let r = y - f;
            squares += r * r;
            weighted += if options.weights == Weights::LogRelative {
                weight * y * y * (y / f.max(1e-12 * y)).ln().powi(2)
            } else {
                weight * r * r
            };
        }
        pairs.push((row.datum.geometry.from_mirror().degrees(), row.datum.value, *f));
    }
    let count = (3 * rows.len()) as f64;
    let total = if rows.solid_angle > 0.0 { rows.solid_angle } else { count / 3.0 };
    let weighted_error = match options.weights {
        Weights::Ngan | Weights::LogRelative => (weighted / (3.0 * total)).sqrt(),
        Weights::Sopp => (weighted / 3.0).sqrt() / total,
        Weights::Sigma | Weights::None => (weighted / count).sqrt(),
    };
    Assessment {
        weighted_error,
        unweighted_error: (squares / count).sqrt(),
        delta_e: ColourErrors::of(&pairs),
        cells: rows.len(),
    }
}
