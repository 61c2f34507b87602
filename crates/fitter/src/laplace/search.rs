//! The table of the global search: all widths and values of r0 that are tried.

use super::{
    axis::{ORDER, exponential},
    kernel,
    problem::{Transformed, Vector, Weighed},
    sums::dot,
};
use crate::{start::Table, term::Term};

/// The sums at the widths of the global search, per channel of weights.
#[derive(Debug)]
pub(super) struct Knots {
    /// Widths, in q.
    q: Vec<f64>,
    /// e at each of them, times g.
    e: Vec<Vector>,
    /// Σ w d S: `[part][knot]`.
    dp: [Vec<f64>; 2],
    /// Σ w S S': `[part][part][knot · n + knot]`; with one lobe those of a knot with itself alone.
    pairs: [[Vec<f64>; 2]; 2],
}

impl Transformed {
    fn knots(&self) -> &[Knots] {
        self.knots.get_or_init(|| {
            let part = &self.family.parts[1];
            let q = self
                .family
                .parameters
                .get(part.uses[0])
                .map_or_else(Vec::new, crate::family::Nonlinear::grid);
            let e: Vec<Vector> = q
                .iter()
                .map(|&q| {
                    let (x, _, g, _) = kernel::rate(self.term, q);
                    exponential(x, self.bins).value.iter().map(|b| b.map(|v| g * v)).collect()
                })
                .collect();
            self.weighed.iter().map(|w| self.knots_of(w, &q, &e)).collect()
        })
    }

    fn knots_of(&self, w: &Weighed, q: &[f64], e: &[Vector]) -> Knots {
        let n = q.len();
        let nothing = vec![[0.0; ORDER]; self.bins];
        let several = self.family.parts.len() > 2;
        let sides = if kernel::has_fresnel(self.term) { 2 } else { 1 };
        let mut pairs: [[Vec<f64>; 2]; 2] = std::array::from_fn(|_| [vec![0.0; n * n], vec![0.0; n * n]]);
        for a in 0..n {
            for (s, pairs) in pairs.iter_mut().enumerate().take(sides) {
                let own =
                    if s == 0 { [e[a].clone(), nothing.clone()] } else { [nothing.clone(), e[a].clone()] };
                let image = self.image(w, &own);
                for b in 0..n {
                    if several || a == b {
                        for (t, image) in image.iter().enumerate().take(sides) {
                            pairs[t][a * n + b] = dot(&e[b], image);
                        }
                    }
                }
            }
        }
        let dp = [0, 1].map(|s| e.iter().map(|e| dot(e, &w.dp[s])).collect());
        Knots { q: q.to_vec(), e: e.to_vec(), dp, pairs }
    }

    /// The table of the global search over atoms (knots of the width times values of r0) with the diffuse column first; `fixed_r0` where r0 is shared with
    /// the diffuse term.
    pub(crate) fn table(&self, fixed_r0: Option<f64>) -> (Vec<Vec<f64>>, Table) {
        let part = &self.family.parts[1];
        let knots = self.knots();
        let widths = knots.first().map_or(&[][..], |k| &k.q);
        let r0s: Vec<f64> = match (kernel::has_fresnel(self.term), fixed_r0) {
            (false, _) => vec![f64::NAN],
            (true, Some(q)) => vec![q],
            (true, None) => {
                self.family.parameters.get(part.uses[1]).map_or_else(Vec::new, crate::family::Nonlinear::grid)
            }
        };
        let share = |q: f64| if q.is_nan() { [1.0, 0.0] } else { [q.exp(), 1.0 - q.exp()] };
        let mut atoms: Vec<Vec<f64>> = Vec::new();
        let mut of: Vec<(usize, [f64; 2])> = Vec::new();
        for (a, &width) in widths.iter().enumerate() {
            for &r0 in &r0s {
                let q = if r0.is_nan() || fixed_r0.is_some() { vec![width] } else { vec![width, r0] };
                atoms.push(q);
                of.push((a, share(r0)));
            }
        }
        let factor = fixed_r0
            .filter(|_| self.family.parts[0].term == Term::AshikhminDiffuse)
            .map_or(1.0, |q| 1.0 - q.exp());
        let n = atoms.len() + 1;
        let several = self.family.parts.len() > 2;
        let gram = self
            .weighed
            .iter()
            .zip(knots)
            .map(|(w, k)| {
                let m = k.q.len();
                let mut g = vec![0.0; n * n];
                g[0] = factor * factor * w.dd;
                for (i, (a, s)) in of.iter().enumerate() {
                    g[i + 1] = factor * (s[0] * k.dp[0][*a] + s[1] * k.dp[1][*a]);
                    let others = if several { i..of.len() } else { i..i + 1 };
                    for j in others {
                        let (b, t) = of[j];
                        let at = a * m + b;
                        g[(i + 1) * n + j + 1] = s[0] * (t[0] * k.pairs[0][0][at] + t[1] * k.pairs[0][1][at])
                            + s[1] * (t[0] * k.pairs[1][0][at] + t[1] * k.pairs[1][1][at]);
                    }
                }
                g
            })
            .collect();
        let by = self
            .valued
            .iter()
            .map(|v| {
                let sides: Vec<[f64; 2]> = knots
                    .first()
                    .map_or(&[][..], |k| &k.e)
                    .iter()
                    .map(|e| [dot(e, &v.ay[0]), dot(e, &v.ay[1])])
                    .collect();
                std::iter::once(factor * v.dy)
                    .chain(of.iter().map(|(a, s)| s[0] * sides[*a][0] + s[1] * sides[*a][1]))
                    .collect()
            })
            .collect();
        let yy = [0, 1, 2].map(|c| self.valued[c].yy);
        (atoms, Table { n, gram, by, yy })
    }
}
