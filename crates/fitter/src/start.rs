//! Where to start: nobody gives starting values, so every nonlinear parameter is tried at a row of values over its whole range.
//!
//! The terms at all these values (atoms) and the sums of their products are worked out once, on all rows near the mirror direction and some of
//! the rest; then every combination costs a solution of at most four equations. One lobe: all combinations. More: the best of one lobe less, each
//! extended by every atom (a beam), which keeps what two lobes explain together. The best places, no two of them neighbours, are refined.

use std::sync::OnceLock;

use rayon::prelude::*;

use crate::{
    Observations,
    family::{Coated, Family},
    laplace::Transformed,
    nodes::Nodes,
    nonnegative::{MOST, Sums},
    ray::reflectance,
    rows::Rows,
};

/// Combinations kept per number of lobes.
const BEAM: usize = 48;
/// Rows the search looks at, about.
const ENOUGH: usize = 2400;

/// All rows where a lobe can be narrow and some of the others, each with how often it counts.
pub(crate) fn representative(rows: &Rows) -> Vec<(usize, f64)> {
    let n = rows.len();
    let near = |i: usize| {
        let (l, v) = rows.rows[i].datum.geometry.directions();
        let s = l + v;
        // half vector within 5° of the normal
        s.x.hypot(s.y) <= 0.0875 * s.z
    };
    let far = (0..n).filter(|&i| !near(i)).count();
    let stride = far.div_ceil(ENOUGH).max(1);
    // a stride that shares no factor with the azimuths of common grids walks over all of them
    let stride = if stride > 1 { (stride..).find(|s| s % 2 == 1 && s % 3 != 0).unwrap_or(stride) } else { 1 };
    let mut seen = 0usize;
    (0..n)
        .filter_map(|i| {
            if near(i) {
                return Some((i, 1.0));
            }
            seen += 1;
            ((seen - 1) % stride == stride / 2).then_some((i, stride as f64))
        })
        .collect()
}

/// What the search looks at: rows, or the sums of a transformed problem.
#[derive(Clone, Copy)]
pub(crate) enum Seen<'a> {
    Rows(&'a Observations, &'a Rows),
    Transformed(&'a Transformed),
}

/// Places to start from, best first; at most `count`.
pub(crate) fn starts(seen: Seen<'_>, family: &Family, count: usize) -> Vec<Vec<f64>> {
    let shared = shared(family);
    let grids: Vec<Vec<f64>> = shared.iter().map(|&p| family.parameters[p].grid()).collect();
    let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
    for choice in product(&grids) {
        let mut q: Vec<f64> = family.parameters.iter().map(|p| 0.5 * (p.walked().0 + p.walked().1)).collect();
        for (&p, &x) in shared.iter().zip(&choice) {
            q[p] = x;
        }
        found.extend(at_shared(seen, family, &shared, &q));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let steps: Vec<f64> = family
        .parameters
        .iter()
        .map(|p| (p.walked().1 - p.walked().0) / (p.knots.max(2) - 1) as f64)
        .collect();
    // lowest of its neighbourhood: no better place within a step and a half
    let apart = |q: &[f64], o: &[f64]| q.iter().zip(o).zip(&steps).any(|((a, b), s)| (a - b).abs() > 1.5 * s);
    (0..found.len())
        .filter(|&i| found[..i].iter().all(|better| apart(&found[i].1, &better.1)))
        .map(|i| found[i].1.clone())
        .take(count)
        .collect()
}

/// Places that differ from `q` in one parameter, which takes `count` values over its range.
pub(crate) fn star(family: &Family, q: &[f64], count: usize) -> Vec<Vec<f64>> {
    let mut out = Vec::new();
    for (i, p) in family.parameters.iter().enumerate().take(q.len()) {
        let (low, high) = p.walked();
        for k in 0..count {
            let mut place = q.to_vec();
            place[i] = low + (high - low) * (k as f64 + 0.5) / count as f64;
            out.push(place);
        }
    }
    out
}

/// Parameters used by several parts, and the index of the coat.
fn shared(family: &Family) -> Vec<usize> {
    (0..family.parameters.len())
        .filter(|&p| {
            let users = family.parts.iter().filter(|part| part.uses.contains(&p)).count();
            users > 1 || family.coated == Coated::Parameter(p)
        })
        .collect()
}

/// All combinations of the values of some axes; one empty combination of no axes.
fn product(axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut out: Vec<Vec<f64>> = vec![Vec::new()];
    for axis in axes {
        out = out
            .iter()
            .flat_map(|o| {
                axis.iter().map(move |&x| {
                    let mut next = o.clone();
                    next.push(x);
                    next
                })
            })
            .collect();
    }
    out
}

/// Parameters of a part that no other part uses.
fn own(family: &Family, shared: &[usize], part: usize) -> Vec<usize> {
    let uses = family.parts[part].uses;
    uses.into_iter().filter(|u| *u < family.parameters.len() && !shared.contains(u)).collect()
}

/// The best combinations with the shared parameters as they stand in `q`.
fn at_shared(seen: Seen<'_>, family: &Family, shared: &[usize], q: &[f64]) -> Vec<(f64, Vec<f64>)> {
    let searched: Vec<usize> =
        (0..family.parts.len()).filter(|&k| !own(family, shared, k).is_empty()).collect();
    let (atoms, table) = match seen {
        Seen::Rows(obs, rows) => by_rows(obs, rows, family, shared, &searched, q),
        Seen::Transformed(t) => t.table(shared.first().and_then(|&p| q.get(p)).copied()),
    };
    let base = family.parts.len() - searched.len();
    let mut beam: Vec<(f64, Vec<usize>)> = vec![(table.squares(&(0..base).collect::<Vec<_>>()), Vec::new())];
    for _ in &searched {
        beam = extended(&beam, &table, atoms.len(), base);
    }
    beam.into_iter()
        .map(|(squares, set)| {
            let mut out = q.to_vec();
            for (&k, &a) in searched.iter().zip(&set) {
                for (p, &v) in own(family, shared, k).into_iter().zip(&atoms[a]) {
                    out[p] = v;
                }
            }
            (squares, out)
        })
        .collect()
}

/// Every combination of the beam with one atom more; the best of them.
fn extended(beam: &[(f64, Vec<usize>)], table: &Table, atoms: usize, base: usize) -> Vec<(f64, Vec<usize>)> {
    let mut next: Vec<(f64, Vec<usize>)> = Vec::with_capacity(beam.len() * atoms);
    for (_, chosen) in beam {
        for a in (0..atoms).filter(|a| !chosen.contains(a)) {
            let mut set = chosen.clone();
            set.push(a);
            set.sort_unstable();
            let mut columns = [0; MOST];
            let k = (base + set.len()).min(MOST);
            for (i, c) in columns.iter_mut().enumerate().take(k) {
                *c = if i < base { i } else { base + set[i - base] };
            }
            next.push((table.squares(&columns[..k]), set));
        }
    }
    next.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    next.dedup_by(|a, b| a.1 == b.1);
    next.truncate(BEAM);
    next
}

/// Atoms and table from the rows themselves.
fn by_rows(
    obs: &Observations,
    rows: &Rows,
    family: &Family,
    shared: &[usize],
    searched: &[usize],
    q: &[f64],
) -> (Vec<Vec<f64>>, Table) {
    let index = family.index(&family.values(q));
    let with_gloss = index.is_some();
    let levels = Levels::new(obs, rows, index);
    let column = |k: usize, q: &[f64]| -> Vec<f64> {
        let x = Family::of_part(&family.parts[k], &family.values(q));
        let term = family.parts[k].term;
        let nodes = levels.of(term.sharpness(&x));
        (0..rows.len()).map(|r| nodes.rays(r).map(|(w, ray)| w * term.value(&x, ray)).sum()).collect()
    };
    let fixed: Vec<Vec<f64>> =
        (0..family.parts.len()).filter(|k| !searched.contains(k)).map(|k| column(k, q)).collect();
    let offset: Vec<f64> = if with_gloss {
        let nodes = Nodes::new(obs, rows, 0.0, index, true);
        (0..rows.len())
            .map(|r| nodes.gloss.get(r).map_or(0.0, |&(s, cos)| s * reflectance(cos, index.unwrap_or(1.0))))
            .collect()
    } else {
        Vec::new()
    };
    let Some(&first) = searched.first() else {
        return (Vec::new(), Table::new(rows, &fixed, &offset, fixed.len()));
    };
    // lobes of one model are alike: the atoms of the first serve all
    let places = own(family, shared, first);
    let axes: Vec<Vec<f64>> = places.iter().map(|&p| family.parameters[p].grid()).collect();
    let atoms = product(&axes);
    let columns: Vec<Vec<f64>> = atoms
        .par_iter()
        .map(|x| {
            let mut at = q.to_vec();
            for (&p, &v) in places.iter().zip(x) {
                at[p] = v;
            }
            column(first, &at)
        })
        .collect();
    let base = fixed.len();
    let all: Vec<Vec<f64>> = fixed.into_iter().chain(columns).collect();
    // one lobe: no two atoms ever stand together
    let table = Table::new(rows, &all, &offset, if searched.len() > 1 { all.len() } else { base });
    (atoms, table)
}

/// The rows' nodes for lobes of every sharpness, made when first asked for: per factor of four.
struct Levels<'a> {
    obs: &'a Observations,
    rows: &'a Rows,
    index: Option<f64>,
    made: Vec<OnceLock<Nodes>>,
}

impl<'a> Levels<'a> {
    fn new(obs: &'a Observations, rows: &'a Rows, index: Option<f64>) -> Self {
        let made = if obs.averages() { 11 } else { 1 };
        Self { obs, rows, index, made: (0..made).map(|_| OnceLock::new()).collect() }
    }

    fn of(&self, sharpness: f64) -> &Nodes {
        static NONE: OnceLock<Nodes> = OnceLock::new();
        let level =
            (sharpness.max(1.0).log2() * 0.5).ceil().clamp(0.0, (self.made.len() - 1) as f64) as usize;
        match self.made.get(level) {
            Some(slot) => {
                if let Some(made) = slot.get() {
                    return made;
                }
                // outside the lock: a thread that waits for its part may take up another atom of the same level
                let made = Nodes::new(self.obs, self.rows, (2.0 * level as f64).exp2(), self.index, false);
                slot.get_or_init(|| made)
            }
            None => NONE.get_or_init(Nodes::default),
        }
    }
}

/// Sums of products of all columns.
pub(crate) struct Table {
    /// Columns.
    pub n: usize,
    /// Σ w z z', upper triangle: one for all channels or one each.
    pub gram: Vec<Vec<f64>>,
    /// Σ w z y per channel.
    pub by: Vec<Vec<f64>>,
    /// Σ w y² per channel.
    pub yy: [f64; 3],
}

impl Table {
    /// The first `mixed` columns stand with every other one, the rest with those and themselves alone.
    fn new(rows: &Rows, columns: &[Vec<f64>], offset: &[f64], mixed: usize) -> Self {
        let n = columns.len();
        let channels = if rows.shared { 1 } else { 3 };
        let value = |i: usize, c: usize| rows.rows[i].value[c] - offset.get(i).copied().unwrap_or(0.0);
        let gram = (0..channels)
            .map(|c| {
                let weighted: Vec<Vec<f64>> = columns
                    .par_iter()
                    .map(|z| z.iter().zip(&rows.rows).map(|(z, r)| z * r.weight[c]).collect())
                    .collect();
                (0..n * n)
                    .into_par_iter()
                    .map(|p| {
                        let (i, j) = (p / n, p % n);
                        if j < i || (i >= mixed && i != j) {
                            0.0
                        } else {
                            weighted[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum()
                        }
                    })
                    .collect()
            })
            .collect();
        let by = (0..3)
            .map(|c| {
                columns
                    .par_iter()
                    .map(|z| {
                        z.iter().enumerate().map(|(i, z)| rows.rows[i].weight[c] * z * value(i, c)).sum()
                    })
                    .collect()
            })
            .collect();
        let yy =
            [0, 1, 2].map(|c| (0..rows.len()).map(|i| rows.rows[i].weight[c] * value(i, c).powi(2)).sum());
        Self { n, gram, by, yy }
    }

    /// Weighted squares left with the best colours of some columns.
    fn squares(&self, columns: &[usize]) -> f64 {
        let k = columns.len().min(MOST);
        let mut total = 0.0;
        for c in 0..3 {
            let Some(gram) = self.gram.get(c).or_else(|| self.gram.first()) else { return f64::INFINITY };
            let mut g = [0.0; MOST * MOST];
            let mut by = [0.0; MOST];
            for (a, &i) in columns.iter().enumerate().take(k) {
                by[a] = self.by[c][i];
                for (b, &j) in columns.iter().enumerate().take(k) {
                    g[a * MOST + b] = gram[i.min(j) * self.n + i.max(j)];
                }
            }
            total += self.yy[c] - Sums { gram: &g, stride: MOST, by: &by, columns: k }.solve().1;
        }
        if total.is_nan() { f64::INFINITY } else { total }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_combinations_are_made_once() {
        assert_eq!(product(&[vec![1.0, 2.0], vec![5.0, 6.0, 7.0]]).len(), 6);
        assert_eq!(product(&[]), vec![Vec::<f64>::new()]);
    }
}
