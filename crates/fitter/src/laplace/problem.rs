//! A family of Laplace lobes on given rows: the sums that do not depend on widths, and from them those at any widths.

use std::sync::OnceLock;

use gonio_brdf::Meaning;
use rayon::prelude::*;

use super::{
    axis::{BINS, Exponential, LARGEST, ORDER, exponential},
    kernel,
    measure::{self, Entry},
};
use crate::{
    Observations, Options,
    family::{Coated, Family},
    moments::{Layout, MAX_COLUMNS, Moments},
    nodes::Nodes,
    observations::Source,
    rows::Rows,
    start::Table,
    term::Term,
};

type Vector = Vec<[f64; ORDER]>;
type Block = [[f64; ORDER]; ORDER];

/// What the data weigh, whatever their values.
#[derive(Debug, Default)]
struct Weighed {
    dd: f64,
    /// Σ w d P and Σ w d Q.
    dp: [Vector; 2],
    /// Σ w a aᵀ by pairs of bins, the first not above the second: PP, PQ, QP, QQ.
    pairs: Vec<((u32, u32), [Block; 4])>,
}

/// Sums of one channel with its values.
#[derive(Debug, Default)]
struct Valued {
    dy: f64,
    yy: f64,
    /// Σ w y P and Σ w y Q.
    ay: [Vector; 2],
}

/// The entries of one bin.
#[derive(Debug, Default)]
struct Segment {
    row: Vec<u32>,
    p: Vec<[f64; ORDER]>,
    q: Vec<[f64; ORDER]>,
}

/// A family on given rows, transformed.
#[derive(Debug)]
pub(crate) struct Transformed {
    family: Family,
    layout: Layout,
    term: Term,
    entries: Vec<Entry>,
    /// Entries of a row.
    start: Vec<u32>,
    /// The entries once more, bin after bin: (row, P) and Q.
    by_bin: Vec<Segment>,
    /// Diffuse term of a row for colour 1 and r0 = 0.
    diffuse: Vec<f64>,
    bins: usize,
    weighed: Vec<Weighed>,
    valued: [Valued; 3],
    knots: OnceLock<Vec<Knots>>,
}

/// The sums at the widths of the global search, per channel of weights.
#[derive(Debug)]
struct Knots {
    /// Widths, in q.
    q: Vec<f64>,
    /// e at each of them, times g.
    e: Vec<Vector>,
    /// Σ w d S: `[part][knot]`.
    dp: [Vec<f64>; 2],
    /// Σ w S S': `[part][part][knot · n + knot]`; with one lobe those of a knot with itself alone.
    pairs: [[Vec<f64>; 2]; 2],
}

/// Lobe k of a point of the search, in both parts P and Q.
struct Lobe {
    e: Exponential,
    g: f64,
    dg: f64,
    dx: f64,
    /// Share of P (r0, or 1) and of Q (1 − r0, or 0), and their derivatives by ln r0.
    share: [f64; 2],
    dshare: [f64; 2],
}

impl Transformed {
    /// The transformed problem; `None` where the family is not of this form.
    pub(crate) fn new(
        obs: &Observations,
        options: &Options,
        family: &Family,
        layout: &Layout,
        rows: &Rows,
    ) -> Option<Self> {
        let term = family.parts.get(1)?.term;
        let alike = family.parts.iter().skip(1).all(|p| p.term == term);
        let base = matches!(family.parts.first()?.term, Term::Lambert | Term::AshikhminDiffuse);
        if !kernel::serves(term) || !alike || !base || family.coated != Coated::No {
            return None;
        }
        // the bins resolve exponents up to this; sharper lobes of node values go the direct way
        if options.exponents().1 > LARGEST {
            return None;
        }
        let (entries, start) = gather(obs, options, term, rows);
        let bins = entries.iter().map(|e| e.bin as usize + 1).max().unwrap_or(1).min(BINS);
        let mut out = Self {
            family: family.clone(),
            layout: layout.clone(),
            term,
            by_bin: by_bin(&entries, &start, bins, kernel::has_fresnel(term)),
            entries,
            start,
            diffuse: diffuse(obs, family, rows),
            bins,
            weighed: Vec::new(),
            valued: Default::default(),
            knots: OnceLock::new(),
        };
        out.reweigh(rows);
        Some(out)
    }

    /// Takes new weights and values of the same rows.
    pub(crate) fn reweigh(&mut self, rows: &Rows) {
        let channels = if rows.shared { 1 } else { 3 };
        self.weighed = (0..channels).into_par_iter().map(|c| self.weigh(rows, c)).collect();
        self.knots = OnceLock::new();
        self.value(rows);
    }

    fn of_row(&self, row: usize) -> &[Entry] {
        match (self.start.get(row), self.start.get(row + 1)) {
            (Some(&a), Some(&b)) => &self.entries[a as usize..b as usize],
            _ => &[],
        }
    }

    fn weigh(&self, rows: &Rows, channel: usize) -> Weighed {
        let fresnel = kernel::has_fresnel(self.term);
        let zero = || vec![[0.0; ORDER]; self.bins];
        let mut out = Weighed { dp: [zero(), zero()], ..Weighed::default() };
        let mut slots = vec![usize::MAX; self.bins * self.bins];
        for (i, row) in rows.rows.iter().enumerate() {
            let (w, d) = (row.weight[channel], self.diffuse[i]);
            out.dd += w * d * d;
            let entries = self.of_row(i);
            for (n, a) in entries.iter().enumerate() {
                let bin = a.bin as usize;
                for j in 0..ORDER {
                    out.dp[0][bin][j] += w * d * a.p[j];
                    out.dp[1][bin][j] += w * d * a.q[j];
                }
                for b in &entries[n..] {
                    let slot = &mut slots[bin * self.bins + b.bin as usize];
                    if *slot == usize::MAX {
                        *slot = out.pairs.len();
                        out.pairs.push(((a.bin, b.bin), [[[0.0; ORDER]; ORDER]; 4]));
                    }
                    let pair = &mut out.pairs[*slot].1;
                    add_outer(&mut pair[0], w, &a.p, &b.p);
                    if fresnel {
                        add_outer(&mut pair[1], w, &a.p, &b.q);
                        add_outer(&mut pair[2], w, &a.q, &b.p);
                        add_outer(&mut pair[3], w, &a.q, &b.q);
                    }
                }
            }
        }
        out
    }

    /// Takes new values of the same rows.
    pub(crate) fn value(&mut self, rows: &Rows) {
        self.value_of(rows.rows.iter().map(|r| (r.weight, r.value)));
    }

    /// The one pass over the values: (weight, value) row by row.
    pub(crate) fn value_of(&mut self, data: impl Iterator<Item = ([f64; 3], [f64; 3])>) {
        let mut sums: [Valued; 3] = Default::default();
        let (mut dy, mut yy) = ([0.0; 3], [0.0; 3]);
        let weighted: Vec<[f64; 3]> = data
            .zip(&self.diffuse)
            .map(|((w, y), d)| {
                let wy: [f64; 3] = std::array::from_fn(|c| w[c] * y[c]);
                for c in 0..3 {
                    dy[c] += wy[c] * d;
                    yy[c] += wy[c] * y[c];
                }
                wy
            })
            .collect();
        for (c, s) in sums.iter_mut().enumerate() {
            (s.dy, s.yy) = (dy[c], yy[c]);
        }
        let zero = || vec![[0.0; ORDER]; self.bins];
        for s in &mut sums {
            s.ay = [zero(), zero()];
        }
        for (bin, segment) in self.by_bin.iter().enumerate() {
            for (side, a) in [&segment.p, &segment.q].into_iter().enumerate() {
                for (c, sum) in summed(&segment.row, a, &weighted).into_iter().enumerate() {
                    sums[c].ay[side][bin] = sum;
                }
            }
        }
        self.valued = sums;
    }

    fn lobes(&self, q: &[f64]) -> Vec<Lobe> {
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
    fn combinations(&self, lobes: &[Lobe]) -> Vec<[Vector; 2]> {
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
    fn diffuse_factor(&self, q: &[f64]) -> (f64, f64) {
        let part = &self.family.parts[0];
        if part.term == Term::AshikhminDiffuse {
            let r0 = q.get(part.uses[0]).copied().unwrap_or(0.0).exp();
            (1.0 - r0, -r0)
        } else {
            (1.0, 0.0)
        }
    }

    /// Places of the lobe columns, in the order of [`Transformed::combinations`], and of the diffuse derivative.
    fn places(&self) -> (Vec<usize>, Option<usize>) {
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
    fn image(&self, w: &Weighed, a: &[Vector; 2]) -> [Vector; 2] {
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

    /// Columns of every row at a place of the walk.
    pub(crate) fn rows(&self, q: &[f64]) -> Vec<[f64; MAX_COLUMNS]> {
        let lobes = self.lobes(q);
        let combinations = self.combinations(&lobes);
        let (columns, derived) = self.places();
        let (factor, slope) = self.diffuse_factor(q);
        (0..self.diffuse.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let mut z = [0.0; MAX_COLUMNS];
                z[0] = factor * self.diffuse[i];
                if let Some(d) = derived {
                    z[d] = slope * self.diffuse[i];
                }
                for e in self.of_row(i) {
                    let bin = e.bin as usize;
                    for (&column, a) in columns.iter().zip(&combinations) {
                        z[column] +=
                            (0..ORDER).map(|j| a[0][bin][j] * e.p[j] + a[1][bin][j] * e.q[j]).sum::<f64>();
                    }
                }
                z
            })
            .collect()
    }
}

/// Σ w y a of one bin for the three channels.
fn summed(rows: &[u32], a: &[[f64; ORDER]], weighted: &[[f64; 3]]) -> [[f64; ORDER]; 3] {
    let mut sums = [[0.0; ORDER]; 3];
    for (&row, a) in rows.iter().zip(a) {
        let wy = weighted[row as usize];
        for (sum, y) in sums.iter_mut().zip(wy) {
            for (s, x) in sum.iter_mut().zip(a) {
                *s += y * x;
            }
        }
    }
    sums
}

fn by_bin(entries: &[Entry], start: &[u32], bins: usize, fresnel: bool) -> Vec<Segment> {
    let mut out: Vec<Segment> = (0..bins).map(|_| Segment::default()).collect();
    for (row, ends) in start.windows(2).enumerate() {
        for e in &entries[ends[0] as usize..ends[1] as usize] {
            let segment = &mut out[e.bin as usize];
            segment.row.push(row as u32);
            segment.p.push(e.p);
            if fresnel {
                segment.q.push(e.q);
            }
        }
    }
    out
}

fn add_outer(to: &mut Block, w: f64, a: &[f64; ORDER], b: &[f64; ORDER]) {
    for (row, &x) in to.iter_mut().zip(a) {
        let wx = w * x;
        for (t, &y) in row.iter_mut().zip(b) {
            *t += wx * y;
        }
    }
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>()).sum()
}

/// The entries of the rows, in their order.
fn gather(obs: &Observations, options: &Options, term: Term, rows: &Rows) -> (Vec<Entry>, Vec<u32>) {
    let mut entries = Vec::with_capacity(rows.len());
    let mut start = Vec::with_capacity(rows.len() + 1);
    start.push(0);
    let mut take = |all: &[Entry], cell: u32, at: &mut usize| {
        // entries and rows run in the same order
        while all.get(*at).is_some_and(|e| e.cell < cell) {
            *at += 1;
        }
        while let Some(e) = all.get(*at).filter(|e| e.cell == cell) {
            entries.push(*e);
            *at += 1;
        }
        start.push(entries.len() as u32);
    };
    match &obs.source {
        Source::Grid(grid, meaning) => {
            let made = measure::of_grid(grid, *meaning, term, options.max_angle);
            let (mut incidence, mut at) = (u32::MAX, 0);
            let mut all: &[Entry] = &[];
            for row in &rows.rows {
                if row.datum.row != incidence {
                    (incidence, at) = (row.datum.row, 0);
                    all = made.row(incidence as usize);
                }
                take(all, row.datum.cell, &mut at);
            }
        }
        Source::Points(points) => {
            let all = measure::of_points(points, term);
            let mut at = 0;
            for row in &rows.rows {
                take(&all, row.datum.cell, &mut at);
            }
        }
    }
    (entries, start)
}

/// The diffuse term of every row.
fn diffuse(obs: &Observations, family: &Family, rows: &Rows) -> Vec<f64> {
    let term = family.parts[0].term;
    if term == Term::Lambert {
        return vec![std::f64::consts::FRAC_1_PI; rows.len()];
    }
    let smooth = matches!(obs.source, Source::Grid(_, Meaning::CellMean { .. }));
    let nodes = Nodes::new(obs, rows, if smooth { 1.0 } else { 0.0 }, None, false);
    (0..rows.len()).map(|r| nodes.rays(r).map(|(w, ray)| w * term.value(&[0.0; 3], ray)).sum()).collect()
}
