//! Sums over the data of the products of all columns (terms and their derivatives), and what follows from them: the best colours, the
//! squares that are left, their gradient and curvature by the nonlinear parameters.
//!
//! For columns φ_k with colours c_k and derivative columns φ_k,p the residual is r = y − o − Σ c_k φ_k (o: the gloss of a coat, if any).
//! With the colours at their best, ∂r/∂x_p projected on the complement of the columns is Kaufman's Jacobian (BIT 15, 1975), which gives the
//! exact gradient and the curvature of Gauss and Newton; columns held at 0 take no part.

use crate::nonnegative::{self, MOST};

/// Most columns a family has.
pub(crate) const MAX_COLUMNS: usize = 18;

/// What the columns are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layout {
    /// Terms: the first columns.
    pub terms: usize,
    /// Derivative columns that follow: (term, parameter).
    pub derivatives: Vec<(usize, usize)>,
    /// A part with coefficient 1 (gloss) and the parameter its derivative belongs to, if any: the last columns.
    pub offset: Option<Option<usize>>,
    /// Number of nonlinear parameters.
    pub parameters: usize,
}

impl Layout {
    /// Number of columns.
    pub(crate) fn columns(&self) -> usize {
        let offset = self.offset.map_or(0, |p| 1 + usize::from(p.is_some()));
        self.terms + self.derivatives.len() + offset
    }

    /// Place of the offset's column.
    pub(crate) fn offset_column(&self) -> Option<usize> {
        self.offset.map(|_| self.terms + self.derivatives.len())
    }
}

/// The sums of one channel.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    /// Σ w z zᵀ, upper triangle filled in both ways by [`Moments::mirrored`]; [`MAX_COLUMNS`] per row.
    pub gram: [f64; MAX_COLUMNS * MAX_COLUMNS],
    /// Σ w z y.
    pub by: [f64; MAX_COLUMNS],
    /// Σ w y².
    pub yy: f64,
}

impl Default for Moments {
    fn default() -> Self {
        Self { gram: [0.0; MAX_COLUMNS * MAX_COLUMNS], by: [0.0; MAX_COLUMNS], yy: 0.0 }
    }
}

impl Moments {
    /// Adds products of columns (upper triangle).
    #[inline]
    pub(crate) fn add_gram(&mut self, w: f64, z: &[f64]) {
        for (i, &a) in z.iter().enumerate() {
            let wa = w * a;
            let row = &mut self.gram[i * MAX_COLUMNS + i..i * MAX_COLUMNS + z.len()];
            for (g, &b) in row.iter_mut().zip(&z[i..]) {
                *g += wa * b;
            }
        }
    }

    /// Adds products with the value.
    #[inline]
    pub(crate) fn add_value(&mut self, w: f64, z: &[f64], y: f64) {
        let wy = w * y;
        for (b, &a) in self.by.iter_mut().zip(z) {
            *b += wy * a;
        }
        self.yy += wy * y;
    }

    pub(crate) fn merge(&mut self, o: &Self) {
        for (a, b) in self.gram.iter_mut().zip(&o.gram) {
            *a += b;
        }
        for (a, b) in self.by.iter_mut().zip(&o.by) {
            *a += b;
        }
        self.yy += o.yy;
    }

    /// Copies the upper triangle into the lower.
    pub(crate) fn mirror(&mut self) {
        for i in 0..MAX_COLUMNS {
            for j in 0..i {
                self.gram[i * MAX_COLUMNS + j] = self.gram[j * MAX_COLUMNS + i];
            }
        }
    }

    fn g(&self, i: usize, j: usize) -> f64 {
        self.gram[i * MAX_COLUMNS + j]
    }
}

/// Most nonlinear parameters a family has.
pub(crate) const MAX_PARAMETERS: usize = 8;

/// A point of the reduced problem: everything at its best for given nonlinear parameters.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reduced {
    /// Weighted squares left, all channels.
    pub squares: f64,
    /// Colours: `[term][channel]`.
    pub colours: [[f64; 3]; MOST],
    /// Half the gradient of the squares by the parameters.
    pub gradient: [f64; MAX_PARAMETERS],
    /// Half the curvature (Gauss–Newton, Kaufman).
    pub curvature: [[f64; MAX_PARAMETERS]; MAX_PARAMETERS],
}

/// The best colours and what is left at them. `channels`: the sums of R, G, B.
pub(crate) fn reduce(channels: &[Moments; 3], layout: &Layout) -> Reduced {
    let mut out = Reduced::default();
    for (c, m) in channels.iter().enumerate() {
        reduce_channel(m, layout, c, &mut out);
    }
    out
}

fn reduce_channel(m: &Moments, layout: &Layout, channel: usize, out: &mut Reduced) {
    let (k, n) = (layout.terms, layout.columns());
    let offset = layout.offset_column();
    // the offset is taken from the values
    let by: [f64; MAX_COLUMNS] = match offset {
        Some(o) => std::array::from_fn(|i| m.by[i] - m.g(i, o)),
        None => m.by,
    };
    let yy = offset.map_or(m.yy, |o| m.yy - 2.0 * m.by[o] + m.g(o, o));
    let linear = nonnegative::Sums { gram: &m.gram, stride: MAX_COLUMNS, by: &by, columns: k };
    let (x, gain) = linear.solve();
    let left = yy - gain;
    // rounding below 0 is nothing; not-a-number must stay
    out.squares += if left < 0.0 { 0.0 } else { left };
    for (term, &value) in x.iter().enumerate().take(k) {
        out.colours[term][channel] = value;
    }
    let p = layout.parameters.min(MAX_PARAMETERS);
    if p == 0 {
        return;
    }
    // model's derivative by each parameter as a combination of columns
    let mut j = [[0.0; MAX_COLUMNS]; MAX_PARAMETERS];
    for (d, &(term, parameter)) in layout.derivatives.iter().enumerate() {
        j[parameter][k + d] += x[term];
    }
    if let (Some(o), Some(Some(parameter))) = (offset, layout.offset) {
        j[parameter][o + 1] += 1.0;
    }
    let image: [[f64; MAX_COLUMNS]; MAX_PARAMETERS] = std::array::from_fn(|a| {
        std::array::from_fn(|i| if a < p && i < n { (k..n).map(|l| j[a][l] * m.g(l, i)).sum() } else { 0.0 })
    });
    let active: Vec<usize> = (0..k).filter(|&i| x[i] > 0.0).collect();
    let basis = orthogonal(m, &active);
    // projections of the Jacobian on the columns
    let share: [[f64; MOST]; MAX_PARAMETERS] = std::array::from_fn(|a| {
        std::array::from_fn(|b| {
            basis.get(b).map_or(0.0, |q| active.iter().enumerate().map(|(s, &i)| q[s] * image[a][i]).sum())
        })
    });
    for a in 0..p {
        let along = (k..n).map(|l| j[a][l] * by[l]).sum::<f64>();
        let fitted = (0..k).map(|i| x[i] * image[a][i]).sum::<f64>();
        out.gradient[a] -= along - fitted;
        for b in 0..p {
            let whole = (k..n).map(|l| image[a][l] * j[b][l]).sum::<f64>();
            let taken = (0..MOST).map(|s| share[a][s] * share[b][s]).sum::<f64>();
            out.curvature[a][b] += whole - taken;
        }
    }
}

/// Combinations of the active columns that are orthonormal under the sums (rows of the inverse Cholesky factor).
fn orthogonal(m: &Moments, active: &[usize]) -> Vec<[f64; MOST]> {
    let mut rows: Vec<[f64; MOST]> = Vec::with_capacity(active.len());
    let inner = |a: &[f64; MOST], b: &[f64; MOST]| {
        let mut s = 0.0;
        for (i, &ci) in active.iter().enumerate() {
            for (l, &cl) in active.iter().enumerate() {
                s += a[i] * b[l] * m.g(ci, cl);
            }
        }
        s
    };
    for s in 0..active.len().min(MOST) {
        let mut v = [0.0; MOST];
        v[s] = 1.0;
        // twice is enough (Kahan)
        for _ in 0..2 {
            for q in &rows {
                let t = inner(&v, q);
                for i in 0..MOST {
                    v[i] -= t * q[i];
                }
            }
        }
        let norm2 = inner(&v, &v);
        if norm2 > 0.0 {
            let r = norm2.sqrt().recip();
            rows.push(v.map(|x| x * r));
        }
    }
    rows
}
