//! χ on the nodes of a table: weighted least squares of the relative error with a penalty on curvature, by conjugate gradients.
//!
//! Per channel, with φ_j the hat functions of the table, b the base and y the measurement of a cell,
//!
//! ```text
//! Σ w (b Σ_j χ_j φ_j − y)² / y_rel² + λ Σ (second differences of χ along both axes)² + ε Σ (χ_j − 1)² → min
//! ```
//!
//! y_rel is the mean over the channels, so that colour counts alike in the dark and in the lobe, as the eye sees it. Nodes without a measurement are
//! continued from their neighbours by the second term; the third settles what is left.

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Geometry, edge::safe_asin, flake::FlakeVectors};

use crate::car_paint::{AngleAxis, CarPaintError, ColourTable, FlakePlace};

/// A cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub geometry: Geometry,
    /// Measured, 1/sr.
    pub value: Rgb,
    /// The grey base, 1/sr.
    pub base: f64,
    /// Solid angle, or 1.
    pub weight: f64,
}

/// Curvature against the mean weight of a node.
const STIFFNESS: f64 = 3e-3;
/// Pull towards 1 against the mean weight of a node.
const PULL: f64 = 1e-6;
/// A measurement below this share of the median counts no more than that.
const LEAST: f64 = 0.02;
/// Largest factor: beyond, it says that the base misses a lobe.
const LARGEST: f64 = 50.0;

/// Entries of a row: up to four nodes with their share.
type Entries = [(u32, f64); 4];

/// The table and the share of its nodes that some cell touches.
pub(super) fn solve(
    rows: &[Row],
    index: f64,
    [nh, ni]: [usize; 2],
) -> Result<(ColourTable, f64), CarPaintError> {
    let (half, incidence) = (nodes(nh, index, 2.0), nodes(ni, index, 1.0));
    let axes = (AngleAxis::new("χ half", half.clone())?, AngleAxis::new("χ incidence", incidence.clone())?);
    let n = axes.0.len() * axes.1.len();
    let mut levels: Vec<f64> = rows.iter().map(|r| mean(r.value).abs()).collect();
    levels.sort_by(f64::total_cmp);
    let least = LEAST * levels.get(levels.len() / 2).copied().unwrap_or(1.0);
    let total: f64 = rows.iter().map(|r| r.weight).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut lines: Vec<(Entries, f64, Rgb)> = Vec::with_capacity(rows.len());
    let mut touched = vec![0.0; n];
    for r in rows {
        let (l, v) = r.geometry.directions();
        let entries = entries(&axes, FlakePlace::of(FlakeVectors::new(l, v, index)));
        // each row scaled so that it measures the relative error with its share of the weight
        let scale = (r.weight / total).sqrt() / mean(r.value).abs().max(least).max(f64::MIN_POSITIVE);
        let b = scale * r.base;
        if !b.is_finite() {
            continue;
        }
        for (k, share) in entries {
            touched[k as usize] += share;
        }
        lines.push((entries.map(|(k, share)| (k, share * b)), scale, r.value));
    }
    let strength =
        lines.iter().map(|(e, ..)| e.iter().map(|x| x.1 * x.1).sum::<f64>()).sum::<f64>() / n as f64;
    let (stiff, pull) = (STIFFNESS * strength, (PULL * strength).max(f64::MIN_POSITIVE));
    let size = [axes.0.len(), axes.1.len()];
    let apply = |x: &[f64]| normal(&lines, size, stiff, pull, x);
    let mut solution = vec![[0.0f32; 3]; n];
    for c in 0..3 {
        let mut right = vec![pull; n];
        for (e, scale, y) in &lines {
            for (k, share) in e {
                right[*k as usize] += share * scale * y[c];
            }
        }
        let x = conjugate_gradients(&apply, &right, vec![1.0; n]);
        for (out, x) in solution.iter_mut().zip(&x) {
            // noise about nothing may ask for less than no light
            out[c] = x.clamp(0.0, LARGEST) as f32;
        }
    }
    let seen = touched.iter().filter(|t| **t > 1e-3).count() as f64 / n as f64;
    Ok((ColourTable::new(half, incidence, solution)?, seen))
}

fn mean(v: Rgb) -> f64 {
    v.iter().sum::<f64>() / 3.0
}

/// Nodes from 0° to the steepest angle inside the coat, denser near 0° for a power above 1: colours change fastest near the gloss.
fn nodes(n: usize, index: f64, power: f64) -> Vec<Angle> {
    let n = n.clamp(2, 256);
    let steepest = 1.0 / index.max(1.0);
    (0..n)
        .map(|k| Angle::from_radians(safe_asin(steepest * (k as f64 / (n - 1) as f64).powf(power))))
        .collect()
}

fn entries((half, incidence): &(AngleAxis, AngleAxis), place: FlakePlace) -> Entries {
    let ((h, s), (i, t)) = (half.locate(place.sin_half), incidence.locate(place.sin_incidence));
    let n = incidence.len();
    let (h1, i1) = ((h + 1).min(half.len() - 1), (i + 1).min(n - 1));
    [
        ((h * n + i) as u32, (1.0 - s) * (1.0 - t)),
        ((h * n + i1) as u32, (1.0 - s) * t),
        ((h1 * n + i) as u32, s * (1.0 - t)),
        ((h1 * n + i1) as u32, s * t),
    ]
}

/// The normal matrix times x.
fn normal(lines: &[(Entries, f64, Rgb)], [nh, ni]: [usize; 2], stiff: f64, pull: f64, x: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = x.iter().map(|v| pull * v).collect();
    for (e, ..) in lines {
        let dot: f64 = e.iter().map(|(k, share)| share * x[*k as usize]).sum();
        for (k, share) in e {
            out[*k as usize] += share * dot;
        }
    }
    let mut bend = |a: usize, b: usize, c: usize| {
        let second = stiff * (x[a] - 2.0 * x[b] + x[c]);
        out[a] += second;
        out[b] -= 2.0 * second;
        out[c] += second;
    };
    for h in 0..nh {
        for i in 0..ni {
            if h + 2 < nh {
                bend(h * ni + i, (h + 1) * ni + i, (h + 2) * ni + i);
            }
            if i + 2 < ni {
                bend(h * ni + i, h * ni + i + 1, h * ni + i + 2);
            }
        }
    }
    out
}

/// Solves a symmetric positive system to 1e-10 of the right side, or as far as it comes.
fn conjugate_gradients(apply: &dyn Fn(&[f64]) -> Vec<f64>, right: &[f64], mut x: Vec<f64>) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut r: Vec<f64> = right.iter().zip(apply(&x)).map(|(b, a)| b - a).collect();
    let mut p = r.clone();
    let (mut rr, limit) = (dot(&r, &r), 1e-20 * dot(right, right));
    for _ in 0..4 * right.len() {
        if rr <= limit || !rr.is_finite() {
            break;
        }
        let a = apply(&p);
        let step = rr / dot(&p, &a);
        if !step.is_finite() {
            break;
        }
        for k in 0..x.len() {
            x[k] += step * p[k];
            r[k] -= step * a[k];
        }
        let next = dot(&r, &r);
        for (p, r) in p.iter_mut().zip(&r) {
            *p = r + next / rr * *p;
        }
        rr = next;
    }
    x
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
                    rows.push(Row { geometry, value: chi.map(|x| x * base), base, weight: 1.0 });
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
