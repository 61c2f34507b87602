//! The sums at any widths, from those that do not depend on them.

use super::{
    axis::{Exponential, ORDER, exponential},
    kernel,
    problem::{Transformed, Vector, Weighed},
};
use crate::{
    moments::{MAX_COLUMNS, Moments},
    term::Term,
};

/// Lobe k of a point of the search, in both parts P and Q.
pub(super) struct Lobe {
    e: Exponential,
    g: f64,
    dg: f64,
    dx: f64,
    /// Share of P (r0, or 1) and of Q (1 − r0, or 0), and their derivatives by ln r0.
    share: [f64; 2],
    dshare: [f64; 2],
}

impl Transformed {
    pub(super) fn lobes(&self, q: &[f64]) -> Vec<Lobe> {
        let at = |u: usize| q.get(u).copied().unwrap_or(0.0);
        self.family
            .parts
            .iter()
            .skip(1)
            .map(|part| {
                let (x, dx, g, dg) = kernel::rate(self.term, at(part.uses[0]));
                let (share, dshare) = if kernel::has_fresnel(self.term) {
                    let r0 = at(part.uses[1]).exp();
                    ([r0, 1.0 - r0], [r0, -r0])
                } else {
                    ([1.0, 0.0], [0.0, 0.0])
                };
                Lobe { e: exponential(x, self.bins), g, dg, dx, share, dshare }
            })
            .collect()
    }

    /// Coefficients of all lobe columns over the bins: `(P part, Q part)` each; values first, then derivatives in the layout's order.
    pub(super) fn combinations(&self, lobes: &[Lobe]) -> Vec<[Vector; 2]> {
        let scaled = |v: &Vector, k: f64| -> Vector { v.iter().map(|b| b.map(|x| k * x)).collect() };
        let mut out: Vec<[Vector; 2]> =
            lobes.iter().map(|l| [0, 1].map(|s| scaled(&l.e.value, l.g * l.share[s]))).collect();
        for &(term, parameter) in &self.layout.derivatives {
            let Some(l) = term.checked_sub(1).and_then(|k| lobes.get(k)) else { continue };
            let part = &self.family.parts[term];
            out.push(if part.uses[0] == parameter {
                // d(g e)/dq = g' e + g x' e'
                [0, 1].map(|s| {
                    let (a, b) = (l.dg * l.share[s], l.g * l.dx * l.share[s]);
                    let pair = l.e.value.iter().zip(&l.e.slope);
                    pair.map(|(v, d)| std::array::from_fn(|j| a * v[j] + b * d[j])).collect()
                })
            } else {
                [0, 1].map(|s| scaled(&l.e.value, l.g * l.dshare[s]))
            });
        }
        out
    }

    /// The diffuse column's factor and its derivative by ln r0: 1 − r0 in the full Ashikhmin–Shirley form.
    pub(super) fn diffuse_factor(&self, q: &[f64]) -> (f64, f64) {
        let part = &self.family.parts[0];
        if part.term == Term::AshikhminDiffuse {
            let r0 = q.get(part.uses[0]).copied().unwrap_or(0.0).exp();
            (1.0 - r0, -r0)
        } else {
            (1.0, 0.0)
        }
    }

    /// Places of the lobe columns, in the order of [`Transformed::combinations`], and of the diffuse derivative.
    pub(super) fn places(&self) -> (Vec<usize>, Option<usize>) {
        let terms = self.layout.terms;
        let mut columns: Vec<usize> = (1..terms).collect();
        let mut diffuse = None;
        for (d, &(term, _)) in self.layout.derivatives.iter().enumerate() {
            if term == 0 {
                diffuse = Some(terms + d);
            } else {
                columns.push(terms + d);
            }
        }
        (columns, diffuse)
    }

    /// The sums at a place of the walk.
    pub(crate) fn moments(&self, q: &[f64]) -> [Moments; 3] {
        let lobes = self.lobes(q);
        let combinations = self.combinations(&lobes);
        let (columns, derived) = self.places();
        let (factor, slope) = self.diffuse_factor(q);
        let diffuse: Vec<(usize, f64)> =
            std::iter::once((0, factor)).chain(derived.map(|d| (d, slope))).collect();
        let mut out: [Moments; 3] = Default::default();
        for (c, m) in out.iter_mut().enumerate() {
            let v = &self.valued[c];
            m.yy = v.yy;
            for &(d, k) in &diffuse {
                m.by[d] = k * v.dy;
            }
            for (&column, a) in columns.iter().zip(&combinations) {
                m.by[column] = dot(&a[0], &v.ay[0]) + dot(&a[1], &v.ay[1]);
            }
        }
        for (c, w) in self.weighed.iter().enumerate() {
            let g = &mut out[c].gram;
            let mut put = |i: usize, j: usize, x: f64| {
                g[i * MAX_COLUMNS + j] = x;
                g[j * MAX_COLUMNS + i] = x;
            };
            for &(d, k) in &diffuse {
                for &(e, l) in &diffuse {
                    put(d, e, k * l * w.dd);
                }
                for (&column, a) in columns.iter().zip(&combinations) {
                    put(d, column, k * (dot(&a[0], &w.dp[0]) + dot(&a[1], &w.dp[1])));
                }
            }
            for (n, a) in combinations.iter().enumerate() {
                let image = self.image(w, a);
                for (m, b) in combinations.iter().enumerate().skip(n) {
                    put(columns[n], columns[m], dot(&b[0], &image[0]) + dot(&b[1], &image[1]));
                }
            }
        }
        if self.weighed.len() == 1 {
            let gram = out[0].gram;
            out[1].gram = gram;
            out[2].gram = gram;
        }
        out
    }

    /// AᵀWA times a combination.
    pub(super) fn image(&self, w: &Weighed, a: &[Vector; 2]) -> [Vector; 2] {
        let mut out = [vec![[0.0; ORDER]; self.bins], vec![[0.0; ORDER]; self.bins]];
        let fresnel = kernel::has_fresnel(self.term);
        let parts: &[(usize, usize, usize)] =
            if fresnel { &[(0, 0, 0), (0, 1, 1), (1, 0, 2), (1, 1, 3)] } else { &[(0, 0, 0)] };
        for ((i, j), blocks) in &w.pairs {
            let (i, j) = (*i as usize, *j as usize);
            for &(s, t, block) in parts {
                for row in 0..ORDER {
                    let b = &blocks[block][row];
                    let other = &a[t][j];
                    out[s][i][row] += b.iter().zip(other).map(|(x, y)| x * y).sum::<f64>();
                }
                if i != j {
                    for row in 0..ORDER {
                        let x = a[s][i][row];
                        for (o, b) in out[t][j].iter_mut().zip(&blocks[block][row]) {
                            *o += x * b;
                        }
                    }
                }
            }
        }
        out
    }
}

pub(super) fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>()).sum()
}
