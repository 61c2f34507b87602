//! Factors on the nodes of a table over half angle and angle of incidence that bring something known closest to a measurement.
//!
//! Per channel, with φ_j the hat functions of the table, b_j what factor 1 on node j stands for and y the measurement of a cell,
//!
//! ```text
//! Σ w (Σ_j x_j b_j φ_j − y)² / y_rel² + λ Σ (second differences of x along both axes)² + ε Σ (x_j − 1)² → min
//! ```
//!
//! by conjugate gradients. y_rel is the mean over the channels of what is seen there altogether, so that colour counts alike in the dark and in the lobe,
//! as the eye sees it, and that a part which adds next to nothing to what is seen counts for next to nothing. Nodes without a measurement are continued
//! from their neighbours by the second term; the third settles what is left.

use gonio_brdf::Rgb;

use crate::car_paint::{AngleAxis, FlakePlace};

/// The four nodes around a place with their shares.
pub(super) type Corners = [(u32, f64); 4];

/// One measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Nodes around it, each with its share of what a factor of 1 on it stands for, 1/sr.
    pub entries: [(u32, Rgb); 4],
    /// What the factors are to bring it to, 1/sr.
    pub value: Rgb,
    /// Mean over the channels of all that is seen there, 1/sr.
    pub seen: f64,
    /// Solid angle, or 1.
    pub weight: f64,
}

/// What holds factors that measurements leave open, against the mean weight of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    /// Of the curvature.
    pub stiffness: f64,
    /// Of the distance from 1.
    pub pull: f64,
    /// The factors' bounds.
    pub bounds: [f64; 2],
}

/// A measurement below this share of the median counts no more than that.
const LEAST: f64 = 0.02;

/// A row scaled so that it measures the relative error with its share of the weight.
struct Line {
    entries: [(u32, Rgb); 4],
    value: Rgb,
}

/// The factors of `size` = half angles × angles of incidence nodes.
pub(super) fn factors(rows: &[Row], size: [usize; 2], hold: Hold) -> Vec<Rgb> {
    let n = size[0] * size[1];
    let mut levels: Vec<f64> = rows.iter().map(|r| r.seen.abs()).collect();
    levels.sort_by(f64::total_cmp);
    let least = LEAST * levels.get(levels.len() / 2).copied().unwrap_or(1.0);
    let total: f64 = rows.iter().map(|r| r.weight).sum::<f64>().max(f64::MIN_POSITIVE);
    let lines: Vec<Line> = rows
        .iter()
        .map(|r| {
            let scale = (r.weight / total).sqrt() / r.seen.abs().max(least).max(f64::MIN_POSITIVE);
            Line {
                entries: r.entries.map(|(k, b)| (k, b.map(|b| scale * b))),
                value: r.value.map(|v| scale * v),
            }
        })
        .filter(|l| l.value.iter().chain(l.entries.iter().flat_map(|e| &e.1)).all(|v| v.is_finite()))
        .collect();
    let mut solution = vec![[1.0; 3]; n];
    for c in 0..3 {
        let squares = lines.iter().flat_map(|l| &l.entries).map(|e| e.1[c] * e.1[c]).sum::<f64>();
        let strength = squares / n as f64;
        let (stiff, pull) = (hold.stiffness * strength, (hold.pull * strength).max(f64::MIN_POSITIVE));
        let apply = |x: &[f64]| normal(&lines, c, size, stiff, pull, x);
        let mut right = vec![pull; n];
        for l in &lines {
            for (k, b) in &l.entries {
                right[*k as usize] += b[c] * l.value[c];
            }
        }
        let x = conjugate_gradients(&apply, &right, vec![1.0; n]);
        for (out, x) in solution.iter_mut().zip(&x) {
            out[c] = x.clamp(hold.bounds[0], hold.bounds[1]);
        }
    }
    solution
}

/// The nodes around a place.
pub(super) fn corners(half: &AngleAxis, incidence: &AngleAxis, place: FlakePlace) -> Corners {
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
fn normal(lines: &[Line], c: usize, [nh, ni]: [usize; 2], stiff: f64, pull: f64, x: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = x.iter().map(|v| pull * v).collect();
    for l in lines {
        let dot: f64 = l.entries.iter().map(|(k, share)| share[c] * x[*k as usize]).sum();
        for (k, share) in &l.entries {
            out[*k as usize] += share[c] * dot;
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
