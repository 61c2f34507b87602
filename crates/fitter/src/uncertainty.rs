//! Covariance of the parameters of a weighted fit, and how well conditioned it is.
//!
//! With J the derivatives, W the weights and H = Σ W J Jᵀ the covariance is the sandwich H⁻¹ M H⁻¹. M comes from the stated variances,
//! Σ W² σ² J Jᵀ, or from what the residuals show, Σ_g (Σ_{i∈g} W r J)(Σ_{i∈g} W r J)ᵀ over blocks g of neighbouring cells: the second
//! alone where a σ is missing, both together where the residuals show more than twice the stated variance. Weights that are no inverse variances, errors of the model and errors shared by neighbours are all covered by that.
//! An uncertainty u common to all values scales cd and cs together: u² g gᵀ is added, g holding cd and cs.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// One equation of the linearised problem.
pub(crate) struct Equation {
    /// Weight of the square.
    pub weight: f64,
    /// Measured − fitted.
    pub residual: f64,
    /// Standard uncertainty, where stated.
    pub sigma: Option<f64>,
    /// Derivatives by the parameters that are not zero: (place, value), the first `count` of them.
    pub derivatives: [(usize, f64); MOST],
    pub count: usize,
    /// Block of neighbours.
    pub block: u32,
}

/// Most derivatives of one value that are not zero: eight nonlinear parameters and four colours.
pub(crate) const MOST: usize = 12;

/// What is known of the parameters after a fit.
#[derive(Clone, Debug)]
pub(crate) struct Uncertainty {
    /// Row by row; NaN for a parameter that the data leave undetermined.
    pub covariance: Vec<Vec<f64>>,
    /// Ratio of the largest to the smallest singular value of the derivatives, columns scaled to length 1.
    pub condition: f64,
}

/// Beyond this condition the inverse is not worth its digits.
pub(crate) const ILL_CONDITIONED: f64 = 1e6;

/// Covariance of `n` parameters; `common` holds the vector g and u.
pub(crate) fn covariance(
    n: usize,
    equations: impl Iterator<Item = Equation>,
    (g, u): (&[f64], f64),
) -> Uncertainty {
    let mut h = DMatrix::<f64>::zeros(n, n);
    let mut stated = DMatrix::<f64>::zeros(n, n);
    let mut seen = DMatrix::<f64>::zeros(n, n);
    let mut all_stated = true;
    let mut score = DVector::<f64>::zeros(n);
    let (mut block, mut blocks) = (None, 0usize);
    for e in equations {
        if block != Some(e.block) {
            seen += &score * score.transpose();
            score.fill(0.0);
            block = Some(e.block);
            blocks += 1;
        }
        let derivatives = &e.derivatives[..e.count.min(MOST)];
        for &(i, a) in derivatives {
            score[i] += e.weight * e.residual * a;
            for &(j, b) in derivatives {
                h[(i, j)] += e.weight * a * b;
                if let Some(s) = e.sigma {
                    stated[(i, j)] += e.weight * e.weight * s * s * a * b;
                }
            }
        }
        all_stated &= e.sigma.is_some();
    }
    seen += &score * score.transpose();
    if blocks > n + 1 {
        seen *= blocks as f64 / (blocks - n) as f64;
    }
    // parameters without any influence stay out
    let active: Vec<usize> = (0..n).filter(|&i| h[(i, i)] > 0.0 && h[(i, i)].is_finite()).collect();
    let m = active.len();
    let mut out = Uncertainty { covariance: vec![vec![f64::NAN; n]; n], condition: f64::INFINITY };
    if m == 0 {
        return out;
    }
    let scale: Vec<f64> = active.iter().map(|&i| h[(i, i)].sqrt().recip()).collect();
    let part =
        |a: &DMatrix<f64>| DMatrix::from_fn(m, m, |i, j| a[(active[i], active[j])] * scale[i] * scale[j]);
    let eigen = SymmetricEigen::new(part(&h));
    let (low, high) =
        eigen.eigenvalues.iter().fold((f64::INFINITY, 0.0f64), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    if m == n && low > 0.0 {
        out.condition = (high / low).sqrt();
    }
    let usable = low > 0.0 && (high / low).sqrt() < ILL_CONDITIONED * 100.0;
    if !usable {
        return out;
    }
    let inverse = {
        let d = DMatrix::from_diagonal(&eigen.eigenvalues.map(f64::recip));
        &eigen.eigenvectors * d * eigen.eigenvectors.transpose()
    };
    let (a, b) = (part(&stated), part(&seen));
    // trace(H⁻¹ M): the size of M as the parameters feel it
    let size = |x: &DMatrix<f64>| (&inverse * x).trace();
    let meat = match (all_stated, size(&b) > 2.0 * size(&a)) {
        (true, false) => a,
        (true, true) => a + b,
        (false, _) => b,
    };
    let cov = &inverse * meat * &inverse;
    for i in 0..m {
        for j in 0..m {
            out.covariance[active[i]][active[j]] =
                cov[(i, j)] * scale[i] * scale[j] + u * u * g[active[i]] * g[active[j]];
        }
    }
    out
}
