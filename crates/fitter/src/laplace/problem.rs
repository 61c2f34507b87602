//! A family of Laplace lobes on given rows: what every row holds, and the sums over the data that do not depend on widths.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::{
    axis::{BINS, LARGEST, ORDER},
    cells, kernel,
    measure::Entry,
    search::Knots,
};
use crate::{
    Observations, Options,
    family::{Coated, Family},
    moments::{Layout, MAX_COLUMNS},
    rows::Rows,
    term::Term,
};

pub(super) type Vector = Vec<[f64; ORDER]>;
pub(super) type Block = [[f64; ORDER]; ORDER];

/// What the data weigh, whatever their values.
#[derive(Debug, Default)]
pub(super) struct Weighed {
    pub dd: f64,
    /// Σ w d P and Σ w d Q.
    pub dp: [Vector; 2],
    /// Σ w a aᵀ by pairs of bins, the first not above the second: PP, PQ, QP, QQ.
    pub pairs: Vec<((u32, u32), [Block; 4])>,
}

/// Sums of one channel with its values.
#[derive(Debug, Default)]
pub(super) struct Valued {
    pub dy: f64,
    pub yy: f64,
    /// Σ w y P and Σ w y Q.
    pub ay: [Vector; 2],
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
    pub(super) family: Family,
    pub(super) layout: Layout,
    pub(super) term: Term,
    entries: Vec<Entry>,
    /// Entries of a row.
    start: Vec<u32>,
    /// The entries once more, bin after bin: (row, P) and Q.
    by_bin: Vec<Segment>,
    /// Diffuse term of a row for colour 1 and r0 = 0.
    diffuse: Vec<f64>,
    /// Gloss of the coat of a row, 1/sr; empty without.
    gloss: Vec<f64>,
    pub(super) bins: usize,
    pub(super) weighed: Vec<Weighed>,
    pub(super) valued: [Valued; 3],
    pub(super) knots: OnceLock<Vec<Knots>>,
}

impl Transformed {
    /// The transformed problem; `None` where the family is not of this form. What the cells hold is kept for the next fit on the same grid.
    pub(crate) fn new(
        obs: &Observations,
        options: &Options,
        family: &Family,
        layout: &Layout,
        rows: &Rows,
    ) -> Option<Self> {
        Self::of(obs, options, family, layout, (rows, true))
    }

    /// The same of some rows, nothing of which is kept.
    pub(crate) fn of_some(
        obs: &Observations,
        options: &Options,
        family: &Family,
        layout: &Layout,
        rows: &Rows,
    ) -> Option<Self> {
        Self::of(obs, options, family, layout, (rows, false))
    }

    fn of(
        obs: &Observations,
        options: &Options,
        family: &Family,
        layout: &Layout,
        (rows, kept): (&Rows, bool),
    ) -> Option<Self> {
        let term = family.parts.get(1)?.term;
        let alike = family.parts.iter().skip(1).all(|p| p.term == term);
        let base = matches!(family.parts.first()?.term, Term::Lambert | Term::AshikhminDiffuse);
        let index = match family.coated {
            Coated::No => None,
            Coated::Known(n) => Some(n),
            Coated::Parameter(_) => return None,
        };
        if !kernel::serves(term) || !alike || !base {
            return None;
        }
        // the bins resolve exponents up to this; sharper lobes of node values go the direct way
        if options.exponents().1 > LARGEST {
            return None;
        }
        let (entries, start) = cells::gather(obs, options, (term, index), rows, kept);
        let bins = entries.iter().map(|e| e.bin as usize + 1).max().unwrap_or(1).min(BINS);
        let mut out = Self {
            family: family.clone(),
            layout: layout.clone(),
            term,
            by_bin: by_bin(&entries, &start, bins, kernel::has_fresnel(term)),
            entries,
            start,
            diffuse: cells::diffuse(obs, family, index, rows),
            gloss: cells::gloss(obs, index, rows),
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

    fn gloss_of(&self, row: usize) -> f64 {
        self.gloss.get(row).copied().unwrap_or(0.0)
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
            .enumerate()
            .map(|(i, ((w, y), d))| {
                // gloss has no colour of its own to be found
                let gloss = self.gloss_of(i);
                let y = y.map(|y| y - gloss);
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
                if let Some(o) = self.layout.offset_column() {
                    z[o] = self.gloss_of(i);
                }
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
