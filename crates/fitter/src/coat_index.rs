//! Where the index of a coat lies, by its profile: with the index fixed everything else is found the fast way ([`crate::laplace`]), so every index of
//! the search is tried with all else at its best.

use crate::{
    Observations, Options,
    direct::Columns,
    family::{Coated, Family},
    laplace::Transformed,
    moments::reduce,
    refine::Refined,
    rows::Rows,
    solve::lowest,
    start::{self, Seen},
};

/// Minima of the profile that are followed.
const MINIMA: usize = 2;
/// Narrowings of the interval about a minimum.
const NARROWINGS: usize = 9;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Places to start from, best first: on some of the rows. `None` where the family has no fast form. The index must be the last parameter.
pub(crate) fn starts(
    obs: &Observations,
    options: &Options,
    family: &Family,
    some: &Rows,
) -> Option<Vec<Vec<f64>>> {
    let Coated::Parameter(p) = family.coated else { return None };
    let index = family.parameters.get(p)?;
    let bounds: Vec<(f64, f64)> =
        family.parameters.iter().take(p).map(crate::family::Nonlinear::walked).collect();
    // everything else at its best for an index
    let at = |walked: f64| -> Option<Refined> {
        let mut known = family.clone();
        known.parameters.truncate(p);
        known.coated = Coated::Known(index.value(walked));
        let layout = Columns::new(&known, obs.averages()).layout;
        let fast = Transformed::of_some(obs, options, &known, &layout, some)?;
        let places = start::starts(Seen::Transformed(&fast), &known, 4);
        let best = lowest(&places, &bounds, |q| reduce(&fast.moments(q), &layout));
        best.at.squares.is_finite().then_some(best)
    };
    let place = |walked: f64, r: Refined| {
        let mut q = r.q;
        q.push(walked);
        (r.at.squares, q)
    };
    let knots = index.grid();
    let tried: Vec<Option<Refined>> = knots.iter().map(|&n| at(n)).collect();
    let squares = |k: Option<usize>| {
        k.and_then(|k| tried.get(k)).and_then(Option::as_ref).map_or(f64::INFINITY, |r| r.at.squares)
    };
    let mut minima: Vec<usize> = (0..knots.len())
        .filter(|&k| {
            let here = squares(Some(k));
            here.is_finite() && here <= squares(k.checked_sub(1)) && here <= squares(Some(k + 1))
        })
        .collect();
    minima.sort_by(|a, b| squares(Some(*a)).total_cmp(&squares(Some(*b))));
    let mut found: Vec<(f64, Vec<f64>)> = Vec::new();
    for k in minima.into_iter().take(MINIMA) {
        let (mut low, mut high) = (knots[k.saturating_sub(1)], knots[(k + 1).min(knots.len() - 1)]);
        let mut best = tried[k].clone().map(|r| place(knots[k], r));
        let mut pair: [Option<(f64, f64)>; 2] = [None, None];
        for _ in 0..NARROWINGS {
            for (side, slot) in pair.iter_mut().enumerate() {
                if slot.is_none() {
                    let n =
                        if side == 0 { high - GOLDEN * (high - low) } else { low + GOLDEN * (high - low) };
                    let r = at(n)?;
                    *slot = Some((n, r.at.squares));
                    if best.as_ref().is_none_or(|b| r.at.squares < b.0) {
                        best = Some(place(n, r));
                    }
                }
            }
            let [Some(left), Some(right)] = pair else { break };
            if left.1 <= right.1 {
                high = right.0;
                pair = [None, Some(left)];
            } else {
                low = left.0;
                pair = [Some(right), None];
            }
        }
        found.extend(best);
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    (!found.is_empty()).then(|| found.into_iter().map(|f| f.1).collect())
}
