//! The minimum: global search, refinement, and the rounds of reweighting that robust losses and logarithms need.

use crate::{
    Loss, Observations, Options, Weights, coat_index,
    direct::Columns,
    family::{Coated, Family},
    joint,
    laplace::Transformed,
    moments::{Layout, MAX_COLUMNS, Reduced, reduce},
    nodes::Nodes,
    refine::{COARSE_STEP, Refined, SMALLEST_STEP, refine},
    reweight,
    rows::Rows,
    start::{self, Seen},
};

/// The minimum and all that is said about it is computed from.
pub(crate) struct Solved {
    pub rows: Rows,
    /// The nonlinear parameters as the solver walks on them.
    pub q: Vec<f64>,
    /// Colours: `[term][channel]`.
    pub colours: Vec<[f64; 3]>,
    /// What the columns are.
    pub layout: Layout,
    /// Columns of every row at the minimum.
    pub columns: Vec<[f64; MAX_COLUMNS]>,
    /// Whether the search came to rest.
    pub converged: bool,
    /// Whether every number is one.
    pub finite: bool,
}

/// Rounds of reweighting at most.
const ROUNDS: usize = 60;
/// Rounds from each of several starts, before the best goes on.
const FEW_ROUNDS: usize = 6;
/// Values of each parameter that a logarithmic fit starts at besides the place of the least relative squares.
const LOGARITHM_STARTS: usize = 8;
/// Steps of all parameters together at the end, at most.
const POLISHES: usize = 5;
/// Steps of a refinement at most.
const STEPS: usize = 120;

/// Evaluates a family on the rows, with as many nodes as its sharpness needs.
struct Evaluator<'a> {
    obs: &'a Observations,
    columns: Columns<'a>,
    nodes: Option<Nodes>,
    /// The fast way, where the family has one.
    fast: Option<Transformed>,
}

impl<'a> Evaluator<'a> {
    fn new(obs: &'a Observations, family: &'a Family) -> Self {
        Self { obs, columns: Columns::new(family, obs.averages()), nodes: None, fast: None }
    }

    /// The nodes for a place of the walk: kept while they are enough and not far too many.
    fn prepare(&mut self, rows: &Rows, q: &[f64]) -> &Nodes {
        let family = self.columns.family;
        let needed = family.sharpness(&family.values(q)).max(1.0);
        let fits = |n: &Nodes| {
            n.len() == rows.len()
                && (!self.obs.averages() || (n.sharpness >= needed && n.sharpness <= 8.0 * needed))
        };
        match self.nodes.take_if(|n| fits(n)) {
            Some(kept) => self.nodes.insert(kept),
            None => {
                let sharpness = (1.4 * needed).log2().ceil().exp2();
                let index = match family.coated {
                    Coated::Known(n) => Some(n),
                    _ => None,
                };
                let gloss = family.coated != Coated::No;
                self.nodes.insert(Nodes::new(self.obs, rows, sharpness, index, gloss))
            }
        }
    }

    fn reduced(&mut self, rows: &Rows, q: &[f64]) -> Reduced {
        if let Some(fast) = &self.fast {
            return reduce(&fast.moments(q), &self.columns.layout);
        }
        self.prepare(rows, q);
        match &self.nodes {
            Some(nodes) => reduce(&self.columns.moments(rows, nodes, q), &self.columns.layout),
            None => Reduced::default(),
        }
    }

    /// Columns of every row. Of nodes and points they are exact; of means they come the way the sums did.
    fn table(&mut self, rows: &Rows, q: &[f64]) -> Vec<[f64; MAX_COLUMNS]> {
        if let Some(fast) = self.fast.as_ref().filter(|_| self.obs.averages()) {
            return fast.rows(q);
        }
        self.prepare(rows, q);
        self.nodes.as_ref().map_or_else(Vec::new, |nodes| self.columns.rows(nodes, q))
    }
}

/// Finds the minimum of a family on the data.
pub(crate) fn solve(obs: &Observations, options: &Options, family: &Family) -> Solved {
    let mut rows = Rows::new(obs, options);
    let mut evaluator = Evaluator::new(obs, family);
    evaluator.fast = Transformed::new(obs, options, family, &evaluator.columns.layout, &rows);
    let bounds: Vec<(f64, f64)> = family.parameters.iter().map(crate::family::Nonlinear::walked).collect();
    let mut best = global(obs, options, &rows, family, &bounds, &mut evaluator);
    if options.loss != Loss::Squares || options.weights == Weights::LogRelative {
        best = reweighted(&mut rows, options, family, &bounds, &mut evaluator, best);
    }
    let terms = family.parts.len();
    let mut q = best.q;
    let mut colours: Vec<[f64; 3]> = best.at.colours.iter().take(terms).copied().collect();
    let mut columns = evaluator.table(&rows, &q);
    let finite = best.at.squares.is_finite() && colours.iter().flatten().all(|x| x.is_finite());
    if finite {
        // what the sums lost to rounding comes back from the residuals themselves; along a bent valley a step may climb before the next one falls
        let layout = evaluator.columns.layout.clone();
        let mut lowest = joint::squares(&rows, &columns, &layout, &colours);
        let mut here = (q.clone(), colours.clone(), columns.clone());
        for _ in 0..POLISHES {
            let Some((next_q, next_colours)) =
                joint::polished(&rows, &here.2, &layout, &here.0, &here.1, &bounds)
            else {
                break;
            };
            let next = evaluator.table(&rows, &next_q);
            let squares = joint::squares(&rows, &next, &layout, &next_colours);
            let moved = here.0.iter().zip(&next_q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            here = (next_q, next_colours, next);
            if squares <= lowest {
                lowest = squares;
                (q, colours, columns) = here.clone();
            } else if squares.is_nan() || squares > 100.0 * lowest {
                break;
            }
            if moved < 1e-10 {
                break;
            }
        }
    }
    let layout = evaluator.columns.layout.clone();
    Solved { rows, layout, q, colours, columns, converged: best.converged, finite }
}

/// Lower and upper ends of what is searched.
type SearchBox = Vec<(f64, f64)>;

/// What is minimised, as a function of the nonlinear parameters alone, with the box they are sought in.
pub(crate) fn objective<'a>(
    obs: &'a Observations,
    options: &Options,
    family: &'a Family,
) -> (SearchBox, impl Fn(&[f64]) -> f64 + 'a) {
    let rows = Rows::new(obs, options);
    let evaluator = std::cell::RefCell::new(Evaluator::new(obs, family));
    let bounds = family.parameters.iter().map(crate::family::Nonlinear::walked).collect();
    (bounds, move |q: &[f64]| evaluator.borrow_mut().reduced(&rows, q).squares)
}

/// Everything at a given place, nothing searched: for other methods. Without `colours` the best ones there.
pub(crate) fn at(
    obs: &Observations,
    options: &Options,
    family: &Family,
    q: &[f64],
    colours: Option<&[[f64; 3]]>,
    converged: bool,
) -> Solved {
    let rows = Rows::new(obs, options);
    let mut evaluator = Evaluator::new(obs, family);
    let reduced = evaluator.reduced(&rows, q);
    let terms = family.parts.len();
    let colours =
        colours.map_or_else(|| reduced.colours.iter().take(terms).copied().collect(), <[_]>::to_vec);
    let columns = evaluator.table(&rows, q);
    let finite = reduced.squares.is_finite() && colours.iter().flatten().all(|x: &f64| x.is_finite());
    let layout = evaluator.columns.layout.clone();
    Solved { rows, q: q.to_vec(), colours, layout, columns, converged, finite }
}

/// The lowest of the refined starts.
fn global(
    obs: &Observations,
    options: &Options,
    rows: &Rows,
    family: &Family,
    bounds: &[(f64, f64)],
    evaluator: &mut Evaluator<'_>,
) -> Refined {
    let lobes = family.parts.len() - 1;
    if family.parameters.is_empty() {
        return refine(&[], &[], 0, COARSE_STEP, |q| evaluator.reduced(rows, q));
    }
    if let Some(fast) = &evaluator.fast {
        let starts = start::starts(Seen::Transformed(fast), family, 8);
        return lowest(&starts, bounds, |q| evaluator.reduced(rows, q));
    }
    let chosen = start::representative(rows);
    let some = rows.some(&chosen);
    if let Some(starts) = coat_index::starts(obs, options, family, &some) {
        return lowest(&starts, bounds, |q| evaluator.reduced(rows, q));
    }
    let count = match (lobes, family.parameters.len()) {
        (_, 1) => 3,
        (0 | 1, _) => 5,
        _ => 8,
    };
    let mut starts = start::starts(Seen::Rows(obs, &some), family, count);
    let partial = chosen.len() < rows.len();
    if partial && family.parameters.len() > 1 {
        let mut coarse = Evaluator::new(obs, family);
        let mut refined: Vec<Refined> = starts
            .iter()
            .map(|q| refine(q, bounds, 25, COARSE_STEP, |q| coarse.reduced(&some, q)))
            .filter(|r| !r.at.squares.is_nan())
            .collect();
        refined.sort_by(|a, b| a.at.squares.total_cmp(&b.at.squares));
        let mut apart: Vec<Vec<f64>> = Vec::new();
        for r in refined {
            let far = |o: &Vec<f64>| o.iter().zip(&r.q).any(|(a, b)| (a - b).abs() > 0.05);
            if apart.iter().all(far) {
                apart.push(r.q);
            }
        }
        apart.truncate(3);
        starts = apart;
    }
    lowest(&starts, bounds, |q| evaluator.reduced(rows, q))
}

/// The lowest of the minima that the starts lead to.
pub(crate) fn lowest(
    starts: &[Vec<f64>],
    bounds: &[(f64, f64)],
    mut reduced: impl FnMut(&[f64]) -> Reduced,
) -> Refined {
    // first near the minima, then into those that may be the lowest
    let mut near: Vec<Refined> = match starts {
        [one] => vec![Refined { q: one.clone(), at: Reduced::default(), converged: false }],
        several => several.iter().map(|q| refine(q, bounds, STEPS, COARSE_STEP, &mut reduced)).collect(),
    };
    near.retain(|r| !r.at.squares.is_nan());
    near.sort_by(|a, b| a.at.squares.total_cmp(&b.at.squares));
    let limit = near.first().map_or(0.0, |r| 1.05 * r.at.squares);
    let mut best: Option<Refined> = None;
    let mut seen: Vec<Vec<f64>> = Vec::new();
    for r in near.iter().filter(|r| r.at.squares <= limit) {
        if seen.iter().any(|o| o.iter().zip(&r.q).all(|(a, b)| (a - b).abs() < 0.02)) {
            continue;
        }
        seen.push(r.q.clone());
        let r = refine(&r.q, bounds, STEPS, SMALLEST_STEP, &mut reduced);
        if best.as_ref().is_none_or(|b| r.at.squares < b.at.squares || b.at.squares.is_nan()) {
            best = Some(r);
        }
    }
    best.unwrap_or_else(|| {
        let middle: Vec<f64> = bounds.iter().map(|b| 0.5 * (b.0 + b.1)).collect();
        Refined { at: reduced(&middle), q: middle, converged: false }
    })
}

/// Robust losses and logarithms: rounds from several starts, since what they minimise can have minima that plain squares have not.
fn reweighted(
    rows: &mut Rows,
    options: &Options,
    family: &Family,
    bounds: &[(f64, f64)],
    evaluator: &mut Evaluator<'_>,
    first: Refined,
) -> Refined {
    let plain = rows.clone();
    let mut places = vec![first];
    if options.weights == Weights::LogRelative && options.loss == Loss::Squares {
        // the general way is too slow for that many
        let count = if evaluator.fast.is_some() { LOGARITHM_STARTS } else { 0 };
        let starts = start::star(family, &places[0].q, count);
        places.extend(starts.into_iter().map(|q| Refined {
            at: evaluator.reduced(&plain, &q),
            q,
            converged: true,
        }));
    }
    let several = places.len() > 1;
    let mut best: Option<(Refined, Rows)> = None;
    let mut ends: Vec<Vec<f64>> = Vec::new();
    for place in places {
        let mut own = plain.clone();
        let mut end =
            rounds(&plain, &mut own, options, bounds, evaluator, place, if several { 2 } else { ROUNDS });
        let known = |q: &[f64]| ends.iter().any(|o| o.iter().zip(q).all(|(a, b)| (a - b).abs() < 0.05));
        if several && !known(&end.q) {
            end = rounds(&plain, &mut own, options, bounds, evaluator, end, FEW_ROUNDS);
            ends.push(end.q.clone());
        }
        let lower = |b: &(Refined, Rows)| end.at.squares < b.0.at.squares || b.0.at.squares.is_nan();
        if best.as_ref().is_none_or(lower) {
            best = Some((end, own));
        }
    }
    let Some((mut best, own)) = best else {
        return Refined { q: Vec::new(), at: Reduced::default(), converged: false };
    };
    *rows = own;
    if several {
        best.converged = true;
        best = rounds(&plain, rows, options, bounds, evaluator, best, ROUNDS);
    }
    best
}

/// At most `most` rounds of working values and weights, each a least-squares fit from where the last one ended. Of logarithms the squares at the end are those of
/// the logarithms where the rounds came to rest.
fn rounds(
    plain: &Rows,
    rows: &mut Rows,
    options: &Options,
    bounds: &[(f64, f64)],
    evaluator: &mut Evaluator<'_>,
    start: Refined,
    most: usize,
) -> Refined {
    let mut best = start;
    let mut converged = false;
    for _ in 0..most {
        let columns = evaluator.table(rows, &best.q);
        let layout = evaluator.columns.layout.clone();
        *rows = reweight::reweighted(plain, options, &columns, &layout, &best.at.colours);
        if let Some(fast) = &mut evaluator.fast {
            fast.reweigh(rows);
        }
        let next = refine(&best.q, bounds, STEPS, SMALLEST_STEP, |q| evaluator.reduced(rows, q));
        if !next.at.squares.is_finite() {
            break;
        }
        let moved = best.q.iter().zip(&next.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = next.at.colours.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        let changed = best
            .at
            .colours
            .iter()
            .flatten()
            .zip(next.at.colours.iter().flatten())
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        best = next;
        if moved < 1e-8 && changed <= 1e-8 * largest {
            converged = true;
            break;
        }
    }
    Refined { converged: converged && best.converged, ..best }
}
