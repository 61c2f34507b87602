//! Fits of many sets of values on the same cells: what does not depend on the values is worked out once.

use crate::{
    Loss, Observations, Options, Weights,
    direct::Columns,
    family::{Family, Nonlinear},
    laplace::Transformed,
    moments::reduce,
    rows::Rows,
    solve::lowest,
    start::{self, Seen},
};

/// Cells, weights and model, ready for values. For lobes that are exponentials of their exponent or of 1/α² (all but GGX, Lafortune, Oren–Nayar,
/// anisotropic and coated ones) and for weights that do not depend on the values.
#[derive(Debug)]
pub struct Prepared {
    family: Family,
    columns: crate::moments::Layout,
    /// Per row: place in the table, weight, last value.
    cells: Vec<(u32, f64, [f64; 3])>,
    fast: Transformed,
    bounds: Vec<(f64, f64)>,
}

/// A minimum without its verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimum {
    /// Nonlinear parameters by name.
    pub parameters: Vec<(&'static str, f64)>,
    /// Colours: diffuse, then lobe by lobe.
    pub colours: Vec<[f64; 3]>,
    /// Weighted squares left, all channels.
    pub squares: f64,
    /// Whether the search came to rest.
    pub converged: bool,
}

impl Prepared {
    /// Prepares the cells of `obs` that take part. `None` where the model has no fast form, or weights or loss depend on the values, or nothing takes part.
    #[must_use]
    pub fn new(obs: &Observations, options: &Options) -> Option<Self> {
        if options.loss != Loss::Squares || matches!(options.weights, Weights::Sigma | Weights::LogRelative) {
            return None;
        }
        let family = Family::new(options, options.model);
        let rows = Rows::new(obs, options);
        if rows.len() == 0 {
            return None;
        }
        let columns = Columns::new(&family, false).layout;
        let fast = Transformed::new(obs, options, &family, &columns, &rows)?;
        let bounds = family.parameters.iter().map(Nonlinear::walked).collect();
        let cells = rows.rows.iter().map(|r| (r.datum.place, r.weight[0], r.value)).collect();
        Some(Self { family, columns, cells, fast, bounds })
    }

    /// Number of cells that take part.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    /// Fits values, one per place of the table or list that was prepared; places without a value keep the last one.
    pub fn fit(&mut self, values: &[[f64; 3]]) -> Minimum {
        for (place, _, y) in &mut self.cells {
            if let Some(v) = values.get(*place as usize) {
                *y = *v;
            }
        }
        self.fast.value_of(self.cells.iter().map(|&(_, w, y)| ([w; 3], y)));
        let starts = start::starts(Seen::Transformed(&self.fast), &self.family, 8);
        let best = lowest(&starts, &self.bounds, |q| reduce(&self.fast.moments(q), &self.columns));
        Minimum {
            parameters: self.family.parameters.iter().zip(&best.q).map(|(p, &q)| (p.name, p.value(q))).collect(),
            colours: best.at.colours.iter().take(self.family.parts.len()).copied().collect(),
            squares: best.at.squares,
            converged: best.converged,
        }
    }
}
