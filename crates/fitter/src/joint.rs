//! All parameters at once, from the residuals themselves: fitted values, derivatives, and the last steps of the refinement.
//!
//! The sums of [`crate::moments`] lose the digits that residuals below 1e-8 of the values need. Gauss–Newton steps over nonlinear parameters and colours
//! together, their right-hand side summed over explicit residuals, bring them back.

use nalgebra::{DMatrix, DVector};

use crate::{
    moments::{Layout, MAX_COLUMNS},
    rows::Rows,
    uncertainty::MOST,
};

/// Fitted values of a row.
pub(crate) fn fitted(z: &[f64; MAX_COLUMNS], layout: &Layout, colours: &[[f64; 3]]) -> [f64; 3] {
    let offset = layout.offset_column().map_or(0.0, |o| z[o]);
    std::array::from_fn(|c| {
        offset + colours.iter().zip(z).take(layout.terms).map(|(k, z)| k[c] * z).sum::<f64>()
    })
}

/// Derivatives of the fitted value of a channel by all parameters: (place, value), with how many there are. Nonlinear parameters come first, then
/// the colours term by term, R, G, B.
pub(crate) fn derivatives(
    z: &[f64; MAX_COLUMNS],
    layout: &Layout,
    colours: &[[f64; 3]],
    channel: usize,
) -> ([(usize, f64); MOST], usize) {
    let mut out = [(0, 0.0); MOST];
    let p = layout.parameters;
    for (k, o) in out.iter_mut().enumerate().take(p) {
        o.0 = k;
    }
    for (d, &(term, parameter)) in layout.derivatives.iter().enumerate() {
        out[parameter].1 += colours[term][channel] * z[layout.terms + d];
    }
    if let (Some(o), Some(Some(parameter))) = (layout.offset_column(), layout.offset) {
        out[parameter].1 += z[o + 1];
    }
    for term in 0..layout.terms {
        out[p + term] = (p + 3 * term + channel, z[term]);
    }
    (out, p + layout.terms)
}

/// Weighted squares of the residuals.
pub(crate) fn squares(
    rows: &Rows,
    columns: &[[f64; MAX_COLUMNS]],
    layout: &Layout,
    colours: &[[f64; 3]],
) -> f64 {
    rows.rows
        .iter()
        .zip(columns)
        .map(|(row, z)| {
            let f = fitted(z, layout, colours);
            (0..3).map(|c| row.weight[c] * (row.value[c] - f[c]).powi(2)).sum::<f64>()
        })
        .sum()
}

/// One Gauss–Newton step over everything that is free; `None` where there is none to take.
pub(crate) fn polished(
    rows: &Rows,
    columns: &[[f64; MAX_COLUMNS]],
    layout: &Layout,
    q: &[f64],
    colours: &[[f64; 3]],
    bounds: &[(f64, f64)],
) -> Option<(Vec<f64>, Vec<[f64; 3]>)> {
    let p = layout.parameters;
    let n = p + 3 * layout.terms;
    let mut h = DMatrix::<f64>::zeros(n, n);
    let mut g = DVector::<f64>::zeros(n);
    for (row, z) in rows.rows.iter().zip(columns) {
        let f = fitted(z, layout, colours);
        for (c, fitted) in f.into_iter().enumerate() {
            let (d, count) = derivatives(z, layout, colours, c);
            let (w, r) = (row.weight[c], row.value[c] - fitted);
            for &(i, a) in &d[..count] {
                g[i] += w * r * a;
                for &(j, b) in &d[..count] {
                    h[(i, j)] += w * a * b;
                }
            }
        }
    }
    let free: Vec<usize> = (0..n)
        .filter(|&i| h[(i, i)] > 0.0)
        .filter(|&i| {
            if i < p {
                bounds.get(i).is_none_or(|b| q[i] > b.0 && q[i] < b.1)
            } else {
                colours[(i - p) / 3][(i - p) % 3] > 0.0
            }
        })
        .collect();
    let m = free.len();
    let scale: Vec<f64> = free.iter().map(|&i| h[(i, i)].sqrt().recip()).collect();
    let part = DMatrix::from_fn(m, m, |a, b| h[(free[a], free[b])] * scale[a] * scale[b]);
    let right = DVector::from_fn(m, |a, _| g[free[a]] * scale[a]);
    let step = part.cholesky()?.solve(&right);
    let (mut next, mut next_colours) = (q.to_vec(), colours.to_vec());
    for (a, &i) in free.iter().enumerate() {
        let s = step[a] * scale[a];
        if !s.is_finite() {
            return None;
        }
        if i < p {
            next[i] = bounds.get(i).map_or(q[i] + s, |b| (q[i] + s).clamp(b.0, b.1));
        } else {
            let x = &mut next_colours[(i - p) / 3][(i - p) % 3];
            *x = (*x + s).max(0.0);
        }
    }
    Some((next, next_colours))
}
