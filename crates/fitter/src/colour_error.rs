//! Colour differences of a fit: CIEDE2000 between the Lab of π f measured and fitted, within and beyond 15° of the mirror direction.

use gonio_optics::colour::{ciede2000, lab_from_brdf};
use rayon::prelude::*;
use serde::Serialize;

/// Degrees from the mirror direction that split the cells.
const SPLIT_DEG: f64 = 15.0;

/// Mean, 95th percentile and largest of a set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// 95th percentile (nearest rank).
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Number of cells.
    pub cells: usize,
}

impl Spread {
    /// Of any numbers; those that are not finite are left out. `None` of none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.retain(|v| v.is_finite());
        values.sort_by(f64::total_cmp);
        let rank = (0.95 * values.len() as f64).ceil() as usize;
        Some(Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            p95: *values.get(rank.max(1) - 1)?,
            max: *values.last()?,
            cells: values.len(),
        })
    }
}

/// CIEDE2000 over the cells of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ColourErrors {
    /// All cells used.
    pub all: Option<Spread>,
    /// Up to 15° from the mirror direction.
    pub within_15_deg: Option<Spread>,
    /// Farther than that.
    pub beyond_15_deg: Option<Spread>,
}

/// One comparison: degrees from the mirror direction, measured and fitted f.
pub(crate) type Pair = (f64, [f64; 3], [f64; 3]);

impl ColourErrors {
    pub(crate) fn of(pairs: &[Pair]) -> Self {
        let delta: Vec<(f64, f64)> = pairs
            .par_iter()
            .map(|&(deg, a, b)| (deg, ciede2000(lab_from_brdf(a), lab_from_brdf(b))))
            .collect();
        let part = |keep: &dyn Fn(f64) -> bool| {
            Spread::of(delta.iter().filter(|d| keep(d.0)).map(|d| d.1).collect())
        };
        Self {
            all: part(&|_| true),
            within_15_deg: part(&|deg| deg <= SPLIT_DEG),
            beyond_15_deg: part(&|deg| deg > SPLIT_DEG),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_of_finite_numbers() {
        let s = Spread::of((1..=100).map(f64::from).chain([f64::NAN]).collect()).unwrap();
        assert_eq!((s.mean, s.p95, s.max, s.cells), (50.5, 95.0, 100.0, 100));
        assert!(Spread::of(vec![f64::NAN]).is_none());
    }
}
