//! The columns of any family evaluated at the nodes of every row: the general way to the sums of [`crate::moments`].

use rayon::prelude::*;

use crate::{
    family::{Coated, Family, Nonlinear, Scale},
    moments::{Layout, MAX_COLUMNS, Moments},
    nodes::Nodes,
    number::{Dual, INDEX_SLOT, Number},
    ray::{Ray, reflectance},
    rows::Rows,
};

/// Rows of one piece of work; the sums are always merged in the same order.
const PIECE: usize = 512;

/// Evaluates the columns of a family.
pub(crate) struct Columns<'a> {
    pub family: &'a Family,
    pub layout: Layout,
    /// Derivative columns: (part, slot).
    slots: Vec<(usize, usize)>,
    index: Option<usize>,
}

/// The parameters of every part as numbers with derivatives by what the solver walks on.
struct At {
    parts: Vec<[Dual; 3]>,
    index: Option<Dual>,
}

impl<'a> Columns<'a> {
    /// The columns; `gloss`: whether a coat's gloss is part of the data.
    pub(crate) fn new(family: &'a Family, gloss: bool) -> Self {
        let mut slots = Vec::new();
        let mut derivatives = Vec::new();
        for (k, part) in family.parts.iter().enumerate() {
            for (slot, &u) in part.uses.iter().enumerate() {
                if u < family.parameters.len() {
                    slots.push((k, slot));
                    derivatives.push((k, u));
                }
            }
        }
        let index = match family.coated {
            Coated::Parameter(p) => Some(p),
            _ => None,
        };
        if let Some(p) = index {
            for k in 0..family.parts.len() {
                slots.push((k, INDEX_SLOT));
                derivatives.push((k, p));
            }
        }
        let offset = (gloss && family.coated != Coated::No).then_some(index);
        let layout =
            Layout { terms: family.parts.len(), derivatives, offset, parameters: family.parameters.len() };
        Self { family, layout, slots, index }
    }

    fn at(&self, q: &[f64]) -> At {
        let dual = |p: &Nonlinear, q: f64, slot: usize| {
            let walk = Dual::variable(q, slot);
            if p.scale == Scale::Log { walk.exp() } else { walk }
        };
        let of = |u: usize, slot: usize| match (self.family.parameters.get(u), q.get(u)) {
            (Some(p), Some(&q)) => dual(p, q, slot),
            _ => Dual::constant(0.0),
        };
        At {
            parts: self.family.parts.iter().map(|p| [0, 1, 2].map(|s| of(p.uses[s], s))).collect(),
            index: match self.family.coated {
                Coated::No => None,
                Coated::Known(n) => Some(Dual::constant(n)),
                Coated::Parameter(p) => Some(of(p, INDEX_SLOT)),
            },
        }
    }

    /// Columns of one row, derivatives included.
    fn row(&self, at: &At, nodes: &Nodes, row: usize, z: &mut [f64; MAX_COLUMNS]) {
        z.fill(0.0);
        let terms = self.layout.terms;
        let mut add = |weight: f64, ray: &Ray<Dual>| {
            let mut values = [Dual::default(); 4];
            for (k, part) in self.family.parts.iter().enumerate().take(4) {
                values[k] = part.term.value(&at.parts[k], ray);
                z[k] += weight * values[k].v;
            }
            for (d, &(k, slot)) in self.slots.iter().enumerate() {
                z[terms + d] += weight * values[k].d[slot];
            }
        };
        match (self.index, at.index) {
            (Some(_), Some(index)) => {
                for s in nodes.samples(row) {
                    add(s.weight, &s.ray(Some(index)));
                }
            }
            _ => {
                for (weight, ray) in nodes.rays(row) {
                    add(weight, &ray.lifted());
                }
            }
        }
        if let (Some(o), Some(index)) = (self.layout.offset_column(), at.index)
            && let Some(&(share, cos)) = nodes.gloss.get(row)
        {
            let f = reflectance(cos, index).times(share);
            z[o] = f.v;
            if self.index.is_some() {
                z[o + 1] = f.d[INDEX_SLOT];
            }
        }
    }

    /// The sums at a place of the walk.
    pub(crate) fn moments(&self, rows: &Rows, nodes: &Nodes, q: &[f64]) -> [Moments; 3] {
        let at = self.at(q);
        let columns = self.layout.columns().min(MAX_COLUMNS);
        let parts: Vec<[Moments; 3]> = rows
            .rows
            .par_chunks(PIECE)
            .enumerate()
            .map(|(piece, chunk)| {
                let mut sums: [Moments; 3] = Default::default();
                let mut z = [0.0; MAX_COLUMNS];
                for (i, row) in chunk.iter().enumerate() {
                    self.row(&at, nodes, piece * PIECE + i, &mut z);
                    for (c, m) in sums.iter_mut().enumerate() {
                        if c == 0 || !rows.shared {
                            m.add_gram(row.weight[c], &z[..columns]);
                        }
                        m.add_value(row.weight[c], &z[..columns], row.value[c]);
                    }
                }
                sums
            })
            .collect();
        let mut total: [Moments; 3] = Default::default();
        for part in &parts {
            for c in 0..3 {
                total[c].merge(&part[c]);
            }
        }
        if rows.shared {
            let gram = total[0].gram;
            total[1].gram = gram;
            total[2].gram = gram;
        }
        for m in &mut total {
            m.mirror();
        }
        total
    }

    /// Columns of every row at a place of the walk.
    pub(crate) fn rows(&self, nodes: &Nodes, q: &[f64]) -> Vec<[f64; MAX_COLUMNS]> {
        let at = self.at(q);
        (0..nodes.len())
            .into_par_iter()
            .map(|row| {
                let mut z = [0.0; MAX_COLUMNS];
                self.row(&at, nodes, row, &mut z);
                z
            })
            .collect()
    }
}
