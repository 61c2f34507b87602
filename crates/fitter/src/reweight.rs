//! Working values and weights: robust losses and logarithms as a row of least-squares fits.
//!
//! Robust losses multiply the weight by ψ(u)/u with u the weighted residual in units of its robust spread, 1.4826 × the median of |√w r| over the
//! channel (iteratively reweighted least squares; Huber 1981, Holland and Welsch 1977). Logarithms take the working value y* = f + f ln(y/f) with
//! the weight w/f²: where that stands still, the gradient of Σ w (ln f − ln y)² is 0, so it is the logarithmic fit itself and no approximation of it.

use crate::{
    Loss, Options, Weights, joint,
    moments::{Layout, MAX_COLUMNS},
    nonnegative::MOST,
    rows::Rows,
};

/// Fitted values below this share of the measured one count as this share in a logarithm.
const LEAST_SHARE: f64 = 1e-3;

impl Loss {
    /// ψ(u)/u of a residual in robust standard deviations; the constants give 95 % efficiency on normal noise.
    #[must_use]
    pub fn factor(self, u: f64) -> f64 {
        let u = u.abs();
        match self {
            Self::Squares => 1.0,
            Self::Huber => {
                if u <= 1.345 {
                    1.0
                } else {
                    1.345 / u
                }
            }
            Self::Cauchy => 1.0 / (1.0 + (u / 2.385).powi(2)),
            Self::Tukey => {
                if u < 4.685 {
                    (1.0 - (u / 4.685).powi(2)).powi(2)
                } else {
                    0.0
                }
            }
        }
    }
}

/// The rows as they count at a fit: `plain` with working values and weights.
pub(crate) fn reweighted(
    plain: &Rows,
    options: &Options,
    columns: &[[f64; MAX_COLUMNS]],
    layout: &Layout,
    colours: &[[f64; 3]; MOST],
) -> Rows {
    let mut out = plain.clone();
    for (row, z) in out.rows.iter_mut().zip(columns) {
        if options.weights == Weights::LogRelative {
            let f = joint::fitted(z, layout, colours);
            let w = if plain.solid_angle > 0.0 { row.datum.solid_angle } else { 1.0 };
            for (c, fitted) in f.into_iter().enumerate() {
                let y = row.datum.value[c];
                let at = fitted.max(LEAST_SHARE * y);
                row.value[c] = at + at * (y / at).ln();
                row.weight[c] = w / (at * at);
            }
        }
    }
    if options.loss == Loss::Squares {
        return out;
    }
    out.shared = false;
    for c in 0..3 {
        let scaled: Vec<f64> = out
            .rows
            .iter()
            .zip(columns)
            .map(|(row, z)| row.weight[c].sqrt() * (row.value[c] - joint::fitted(z, layout, colours)[c]))
            .collect();
        let mut sizes: Vec<f64> =
            scaled.iter().zip(&out.rows).filter(|(_, r)| r.weight[c] > 0.0).map(|(s, _)| s.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let spread = 1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        if spread <= 0.0 || !spread.is_finite() {
            continue;
        }
        for (row, s) in out.rows.iter_mut().zip(&scaled) {
            row.weight[c] *= options.loss.factor(s / spread);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_let_go_of_large_residuals_in_their_order() {
        for (_, loss) in Loss::ALL {
            assert_eq!(loss.factor(0.0), 1.0);
            assert!(loss.factor(-3.0) == loss.factor(3.0) && loss.factor(3.0) >= loss.factor(30.0));
        }
        assert_eq!(Loss::Tukey.factor(5.0), 0.0);
        assert!((Loss::Huber.factor(13.45) - 0.1).abs() < 1e-12 && Loss::Cauchy.factor(23.85) < 0.0100);
    }
}
