//! χ on the nodes of a table: the factors that bring the base closest to the measurement ([`super::relative`]).

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Geometry, edge::safe_asin, flake::FlakeVectors};

use super::relative::{self, Hold, corners};
use crate::car_paint::{AngleAxis, CarPaintError, ColourTable, FlakePlace};

/// A cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub geometry: Geometry,
    /// Measured, what flakes add on average taken off, 1/sr.
    pub value: Rgb,
    /// The grey base, 1/sr.
    pub base: f64,
    /// Mean over the channels of all that was measured, flakes included, 1/sr.
    pub seen: f64,
    /// Solid angle, or 1.
    pub weight: f64,
}

/// Curvature and pull against the mean weight of a node. Beyond the largest factor the base misses a lobe.
const HOLD: Hold = Hold { stiffness: 3e-3, pull: 1e-6, bounds: [0.0, 50.0] };

/// The table and the share of its nodes that some cell touches.
pub(super) fn solve(
    rows: &[Row],
    index: f64,
    [nh, ni]: [usize; 2],
) -> Result<(ColourTable, f64), CarPaintError> {
    let (half, incidence) = (nodes(nh, index, 2.0), nodes(ni, index, 1.0));
    let axes = (AngleAxis::new("χ half", half.clone())?, AngleAxis::new("χ incidence", incidence.clone())?);
    let size = [axes.0.len(), axes.1.len()];
    let mut touched = vec![0.0; size[0] * size[1]];
    let mut lines = Vec::with_capacity(rows.len());
    for r in rows.iter().filter(|r| r.base.is_finite()) {
        let (l, v) = r.geometry.directions();
        let around = corners(&axes.0, &axes.1, FlakePlace::of(FlakeVectors::new(l, v, index)));
        for (k, share) in around {
            touched[k as usize] += share;
        }
        let entries = around.map(|(k, share)| (k, [share * r.base; 3]));
        lines.push(relative::Row { entries, value: r.value, seen: r.seen, weight: r.weight });
    }
    // noise about nothing may ask for less than no light: the bounds say no
    let values = relative::factors(&lines, size, HOLD);
    let values = values.iter().map(|v| v.map(|v| v as f32)).collect();
    let seen = touched.iter().filter(|t| **t > 1e-3).count() as f64 / touched.len() as f64;
    Ok((ColourTable::new(half, incidence, values)?, seen))
}

/// Nodes from 0° to the steepest angle inside the coat, denser near 0° for a power above 1: colours change fastest near the gloss.
fn nodes(n: usize, index: f64, power: f64) -> Vec<Angle> {
    let n = n.clamp(2, 256);
    let steepest = 1.0 / index.max(1.0);
    (0..n)
        .map(|k| Angle::from_radians(safe_asin(steepest * (k as f64 / (n - 1) as f64).powf(power))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_was_put_in_comes_out() {
        let index = 1.5;
        let truth = {
            let (half, incidence) = (nodes(6, index, 2.0), nodes(5, index, 1.0));
            let values =
                (0..30).map(|k| [1.0 + 0.01 * k as f32, 0.8, 1.2 - 0.005 * (k % 5) as f32]).collect();
            ColourTable::new(half, incidence, values).expect("sound")
        };
        let mut rows = Vec::new();
        for i in 0..19 {
            for o in 0..19 {
                for p in 0..13 {
                    let geometry =
                        Geometry::from_degrees(5.0 * f64::from(i), 5.0 * f64::from(o), 15.0 * f64::from(p));
                    let (l, v) = geometry.directions();
                    let chi = truth.at(FlakePlace::of(FlakeVectors::new(l, v, index)));
                    let base = 0.1 + f64::from(o);
                    let value = chi.map(|x| x * base);
                    rows.push(Row { geometry, value, base, seen: base, weight: 1.0 });
                }
            }
        }
        let (found, seen) = solve(&rows, index, [6, 5]).expect("solved");
        assert!(seen > 0.8, "{seen}");
        for r in &rows {
            let (l, v) = r.geometry.directions();
            let place = FlakePlace::of(FlakeVectors::new(l, v, index));
            let (a, b) = (found.at(place), truth.at(place));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 0.01), "{:?}: {a:?} {b:?}", r.geometry);
        }
    }

    #[test]
    fn without_a_measurement_chi_is_one() {
        let (table, seen) = solve(&[], 1.0, [4, 4]).expect("solved");
        assert_eq!(seen, 0.0);
        assert!(table.values().iter().flatten().all(|v| (v - 1.0).abs() < 1e-6));
    }
}
