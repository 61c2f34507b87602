//! All parameters at once, from the residuals themselves: fitted values, derivatives, and the last steps of the refinement.
//!
//! The sums of [`crate::moments`] lose the digits that residuals below 1e-8 of the values need. Gauss–Newton steps over nonlinear parameters and colours
//! together, their right-hand side summed over explicit residuals, bring them back.

use nalgebra::DMatrix;

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

/// Equations triangularised at a time.
const BLOCK: usize = 384;

/// One Gauss–Newton step over everything that is free; `None` where there is none to take.
///
/// By orthogonal transformations of the derivatives themselves: products of them would square the condition number, and near-degenerate data (r0 within 45°)
/// would lose the digits that this step is here for.
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
    let inside = |i: usize| {
        if i < p {
            bounds.get(i).is_none_or(|b| q[i] > b.0 && q[i] < b.1)
        } else {
            colours[(i - p) / 3][(i - p) % 3] > 0.0
        }
    };
    // place of a parameter among the free ones
    let mut at = vec![None; n];
    let mut m = 0;
    for (_, at) in at.iter_mut().enumerate().filter(|(i, _)| inside(*i)) {
        *at = Some(m);
        m += 1;
    }
    let mut triangle = Triangle::new(m);
    for (row, z) in rows.rows.iter().zip(columns) {
        let f = fitted(z, layout, colours);
        for (c, fitted) in f.into_iter().enumerate() {
            let (d, count) = derivatives(z, layout, colours, c);
            let w = row.weight[c].sqrt();
            triangle.add(
                d[..count].iter().filter_map(|&(i, a)| at[i].map(|k| (k, w * a))),
                w * (row.value[c] - fitted),
            );
        }
    }
    let step = triangle.solve()?;
    let (mut next, mut next_colours) = (q.to_vec(), colours.to_vec());
    for (i, k) in at.iter().enumerate().filter_map(|(i, k)| k.map(|k| (i, k))) {
        let s = step[k];
        if i < p {
            next[i] = bounds.get(i).map_or(q[i] + s, |b| (q[i] + s).clamp(b.0, b.1));
        } else {
            let x = &mut next_colours[(i - p) / 3][(i - p) % 3];
            *x = (*x + s).max(0.0);
        }
    }
    Some((next, next_colours))
}

/// Rows of a least-squares problem, kept as the upper triangle of their QR factorisation: block by block, by Householder reflections.
struct Triangle {
    unknowns: usize,
    /// The triangle on top (`unknowns + 1` rows), new equations underneath; the right-hand side is the last column.
    work: DMatrix<f64>,
    filled: usize,
}

impl Triangle {
    fn new(unknowns: usize) -> Self {
        let k = unknowns + 1;
        Self { unknowns, work: DMatrix::zeros(k + BLOCK, k), filled: 0 }
    }

    fn add(&mut self, entries: impl Iterator<Item = (usize, f64)>, right: f64) {
        let (k, row) = (self.unknowns + 1, self.unknowns + 1 + self.filled);
        for (column, a) in entries {
            self.work[(row, column)] += a;
        }
        self.work[(row, k - 1)] = right;
        self.filled += 1;
        if self.filled == BLOCK {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let k = self.unknowns + 1;
        let r = self.work.clone().qr().unpack_r();
        self.work.fill(0.0);
        self.work.view_mut((0, 0), (k, k)).copy_from(&r.view((0, 0), (k, k)));
        self.filled = 0;
    }

    /// The unknowns, 0 where one has no influence at all; `None` where they cannot be told apart or numbers do not exist.
    fn solve(mut self) -> Option<Vec<f64>> {
        self.fold();
        let n = self.unknowns;
        let mut x = vec![0.0; n];
        for i in (0..n).rev() {
            let length = self.work.view((0, i), (i + 1, 1)).norm();
            if length == 0.0 {
                continue;
            }
            let pivot = self.work[(i, i)];
            if pivot.is_nan() || pivot.abs() <= 1e-13 * length {
                return None;
            }
            let rest: f64 = (i + 1..n).map(|j| self.work[(i, j)] * x[j]).sum();
            x[i] = (self.work[(i, n)] - rest) / pivot;
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearly_dependent_columns_keep_their_digits() {
        // columns 1, t, t + 1e-7 t²: products of them would leave no digit of the last two
        let mut triangle = Triangle::new(3);
        for k in 0..1000 {
            let t = f64::from(k) / 1000.0;
            let a = [1.0, t, t + 1e-7 * t * t];
            let right = 2.0 * a[0] - 3.0 * a[1] + 4.0 * a[2];
            triangle.add(a.into_iter().enumerate(), right);
        }
        let x = triangle.solve().expect("independent");
        assert!(
            (x[0] - 2.0).abs() < 1e-12 && (x[1] + 3.0).abs() < 1e-6 && (x[2] - 4.0).abs() < 1e-6,
            "{x:?}"
        );
    }

    #[test]
    fn dependent_columns_are_no_step_and_one_without_influence_stays() {
        let mut triangle = Triangle::new(2);
        let mut alone = Triangle::new(2);
        for k in 0..10 {
            let t = f64::from(k);
            triangle.add([(0, t), (1, 2.0 * t)].into_iter(), 1.0);
            alone.add([(0, t)].into_iter(), 3.0 * t);
        }
        assert!(triangle.solve().is_none());
        let x = alone.solve().expect("one unknown");
        assert!((x[0] - 3.0).abs() < 1e-14 && x[1] == 0.0);
    }
}
