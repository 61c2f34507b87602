//! Designing: the mixture of measured paints that comes closest to a target seen from several angles.
//!
//! The mean CIEDE2000 over the angles is minimised over the weights, which sum to 1: from the best point of a coarse lattice a compass search
//! halves its steps until they are below a ten-thousandth. No derivative is needed and no starting value; with at most five paints the
//! lattice is small.

use gonio_brdf::Brdf;
use gonio_optics::Vec3;
use gonio_optics::colour::{Lab, ciede2000, lab_from_brdf};

use crate::mixing::{MixError, Mixable, Mixed, Part};

/// A colour wanted at an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Towards the light, unit, sample frame.
    pub light: Vec3,
    /// Towards the viewer, unit, sample frame.
    pub view: Vec3,
    /// The colour of π f.
    pub lab: Lab,
}

/// How it is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignOptions {
    /// Smallest and largest weight of a paint; 0 … 1 mixes, wider extrapolates.
    pub range: [f64; 2],
    /// What the weights work on: [`Part::Everything`] leaves the sparkle free, [`Part::Hue`] holds the lightness of the first paint's flakes,
    /// [`Part::Base`] holds its flakes altogether.
    pub part: Part,
}

impl Default for DesignOptions {
    fn default() -> Self {
        Self { range: [0.0, 1.0], part: Part::Everything }
    }
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Design {
    /// Weights, one a paint.
    pub weights: Vec<f64>,
    /// The mixture.
    pub mixed: Mixed,
    /// CIEDE2000 at each angle, in the order of the target.
    pub delta_e: Vec<f64>,
    /// Colour of the mixture at each angle.
    pub lab: Vec<Lab>,
    /// Mean CIEDE2000 of each paint alone.
    pub alone: Vec<f64>,
    /// Mixtures that were looked at.
    pub looked_at: usize,
}

impl Design {
    /// Mean over the angles.
    #[must_use]
    pub fn mean(&self) -> f64 {
        mean(&self.delta_e)
    }
}

/// Why nothing is designed.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// No angle.
    #[error("the target has no angle; give at least one geometry with its colour")]
    NoTarget,
    /// A colour or direction that is no number, or below the horizon.
    #[error(
        "geometry {place} of the target is below the horizon or its colour is not a number; mend or leave it out"
    )]
    Target {
        /// From 0.
        place: usize,
    },
    /// Weights that leave no room.
    #[error("weights from {low} to {high} cannot sum to 1; expected a range with 0 and 1 in it")]
    Range {
        /// Smallest.
        low: f64,
        /// Largest.
        high: f64,
    },
    /// Paints that do not mix.
    #[error(transparent)]
    Mix(#[from] MixError),
}

/// Steps along an edge of the lattice that the search starts from.
const LATTICE: usize = 4;
/// The last step of the search.
const FINEST: f64 = 1e-4;

/// The closest mixture.
///
/// # Errors
/// [`DesignError`]: a target without an angle, directions below the horizon, a range without 0 and 1.
pub fn design(paints: &Mixable, target: &[Wanted], options: &DesignOptions) -> Result<Design, DesignError> {
    if target.is_empty() {
        return Err(DesignError::NoTarget);
    }
    let known = |w: &Wanted| {
        w.light.z >= 0.0 && w.view.z >= 0.0 && [w.lab.l, w.lab.a, w.lab.b].iter().all(|v| v.is_finite())
    };
    if let Some(place) = target.iter().position(|w| !known(w)) {
        return Err(DesignError::Target { place });
    }
    let [low, high] = options.range;
    if !(low <= 0.0 && high >= 1.0) {
        return Err(DesignError::Range { low, high });
    }
    let mut looked_at = 0;
    let mut far = |weights: &[f64]| -> Result<f64, MixError> {
        looked_at += 1;
        Ok(mean(&differences(&paints.mix(weights, options.part)?, target).0))
    };
    let n = paints.paints().len();
    let mut alone = Vec::with_capacity(n);
    let mut best = (f64::INFINITY, Vec::new());
    for weights in lattice(n) {
        let d = far(&weights)?;
        if weights.contains(&1.0) {
            alone.push((weights.iter().position(|w| *w == 1.0).unwrap_or(0), d));
        }
        if d < best.0 {
            best = (d, weights);
        }
    }
    let mut step = 0.5 / LATTICE as f64;
    while step >= FINEST {
        let mut moved = false;
        // mass from one paint to another
        for from in 0..n {
            for to in (0..n).filter(|to| *to != from) {
                let mut weights = best.1.clone();
                weights[from] -= step;
                weights[to] += step;
                // eighths and their halves are exact: the sum stays 1
                if weights[from] < low || weights[to] > high {
                    continue;
                }
                let d = far(&weights)?;
                if d < best.0 {
                    best = (d, weights);
                    moved = true;
                }
            }
        }
        if !moved {
            step *= 0.5;
        }
    }
    alone.sort_by_key(|a| a.0);
    let mixed = paints.mix(&best.1, options.part)?;
    let (delta_e, lab) = differences(&mixed, target);
    let alone = alone.into_iter().map(|a| a.1).collect();
    Ok(Design { weights: best.1, mixed, delta_e, lab, alone, looked_at })
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn differences(mixed: &Mixed, target: &[Wanted]) -> (Vec<f64>, Vec<Lab>) {
    let lab: Vec<Lab> = target.iter().map(|w| lab_from_brdf(mixed.paint.eval(w.light, w.view))).collect();
    (target.iter().zip(&lab).map(|(w, lab)| ciede2000(w.lab, *lab)).collect(), lab)
}

/// All weights of n paints in steps of 1/[`LATTICE`].
fn lattice(n: usize) -> Vec<Vec<f64>> {
    let mut done: Vec<Vec<usize>> = vec![Vec::new()];
    for place in 0..n {
        let mut next = Vec::new();
        for head in done {
            let left = LATTICE - head.iter().sum::<usize>();
            for k in if place + 1 == n { left..=left } else { 0..=left } {
                let mut list = head.clone();
                list.push(k);
                next.push(list);
            }
        }
        done = next;
    }
    done.into_iter().map(|l| l.into_iter().map(|k| k as f64 / LATTICE as f64).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mixing::tests::{paint, pair};
    use crate::statistics::StatisticsOptions;

    fn angles() -> Vec<(Vec3, Vec3)> {
        let direction = |deg: f64| {
            let (s, c) = deg.to_radians().sin_cos();
            Vec3::new(s, 0.0, c)
        };
        [-15.0, 15.0, 25.0, 45.0, 70.0].iter().map(|a| (direction(45.0), direction(-45.0 + a))).collect()
    }

    fn seen(paint: &dyn Brdf) -> Vec<Wanted> {
        angles()
            .into_iter()
            .map(|(light, view)| Wanted { light, view, lab: lab_from_brdf(paint.eval(light, view)) })
            .collect()
    }

    #[test]
    fn a_mixture_is_found_again() {
        let m = pair();
        for w in [0.0, 0.15, 0.62, 1.0] {
            let target = seen(&*m.mix(&[1.0 - w, w], Part::Everything).expect("mixed").paint);
            let found = design(&m, &target, &DesignOptions::default()).expect("a design");
            assert!(found.mean() < 0.02, "{w}: {:?} {}", found.weights, found.mean());
            assert!((found.weights[1] - w).abs() < 0.01, "{w}: {:?}", found.weights);
            assert!(found.mean() <= found.alone.iter().copied().fold(f64::INFINITY, f64::min));
            assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn three_paints_and_an_extrapolated_one_are_found_again() {
        let paints = [paint("a", 0.3, Some(1)), paint("b", 1.2, Some(2)), paint("c", 0.7, None)];
        let m = Mixable::new(&paints, &StatisticsOptions::default()).expect("mixable");
        let target = seen(&*m.mix(&[0.2, 0.5, 0.3], Part::Everything).expect("mixed").paint);
        let found = design(&m, &target, &DesignOptions::default()).expect("a design");
        assert!(found.mean() < 0.1, "{:?} {}", found.weights, found.mean());
        let m = pair();
        let target = seen(&*m.mix(&[1.2, -0.2], Part::Everything).expect("mixed").paint);
        let inside = design(&m, &target, &DesignOptions::default()).expect("a design");
        let wide = DesignOptions { range: [-0.5, 1.5], ..DesignOptions::default() };
        let beyond = design(&m, &target, &wide).expect("a design");
        assert!(beyond.mean() < 0.5 * inside.mean(), "{} {}", beyond.mean(), inside.mean());
    }

    #[test]
    fn held_sparkle_stays() {
        let m = pair();
        let target = seen(&*m.mix(&[0.5, 0.5], Part::Everything).expect("mixed").paint);
        let held = DesignOptions { part: Part::Hue, ..DesignOptions::default() };
        let found = design(&m, &target, &held).expect("a design");
        let free = design(&m, &target, &DesignOptions::default()).expect("a design");
        assert!(free.mean() <= found.mean() + 1e-6);
    }

    #[test]
    fn targets_that_are_none_are_refused() {
        let m = pair();
        let none = design(&m, &[], &DesignOptions::default());
        assert!(matches!(none, Err(DesignError::NoTarget)));
        let mut target = seen(&*m.paints()[0].clone());
        target[2].lab.l = f64::NAN;
        let bad = design(&m, &target, &DesignOptions::default());
        assert!(matches!(bad, Err(DesignError::Target { place: 2 })));
        let narrow = DesignOptions { range: [0.2, 0.8], ..DesignOptions::default() };
        assert!(matches!(
            design(&m, &seen(&*m.paints()[0].clone()), &narrow),
            Err(DesignError::Range { .. })
        ));
    }
}
