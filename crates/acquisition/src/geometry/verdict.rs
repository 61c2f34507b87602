//! How good a calibration is: how surely directions are known, and what stayed undetermined, in words, with the poses that would help.
//!
//! The observations' information is taken in units of the tolerances. Where one of its eigenvalues lies below 1 the observations say less about that
//! combination of parameters than the tolerances do. Whether that matters is another question: a combination that moves no pixel's (θi, θo, angle between
//! light and view) is a gauge, and harmless.

use gonio_instrument::{Description, Pose, ScanKind};
use gonio_optics::{Angle, Vec3};
use nalgebra::{DMatrix, DVector};

use super::parameters::{COUNT, Estimate, OF_INSTRUMENT, PARAMETERS, Row, WEDGE};
use super::predict::{derivatives, spot};
use super::solve::{Settings, Solution};
use crate::optics::Optics;

/// What θi, θo and the angle between light and view are uncertain by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DirectionUncertainty {
    /// Root mean square over the pixels used, degrees: θi, θo, angle between l and v.
    pub rms_deg: [f64; 3],
    /// Largest, degrees.
    pub max_deg: [f64; 3],
}

/// A combination of parameters about which the observations say less than the tolerances.
#[derive(Clone, Debug, PartialEq)]
pub struct Undetermined {
    /// Which parameters take part, in words.
    pub words: String,
    /// How much the observations know of it, in units of what the tolerances know (below 1).
    pub information: f64,
    /// What a tolerance's worth of it does to directions, degrees (root mean square).
    pub effect_deg: f64,
    /// Poses that would determine it, in words; empty where it does not matter.
    pub poses: Vec<String>,
}

/// How good a calibration is.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Before: from the tolerances alone.
    pub before: DirectionUncertainty,
    /// After.
    pub after: DirectionUncertainty,
    /// What the places on the sample that pixels look at are uncertain by, across the line of sight, mm (root mean square near the limit in θo):
    /// how surely it is known where the lamp's spot ends. Only the fading towards a white sample's horizon tells it.
    pub aim_mm: f64,
    /// What stayed undetermined and matters.
    pub undetermined: Vec<Undetermined>,
    /// Undetermined combinations that move no direction.
    pub gauges: usize,
    /// Whether directions are known well enough to be used.
    pub good: bool,
}

/// Directions known to this are good, degrees (root mean square).
pub const GOOD_DEG: f64 = 0.03;
/// An undetermined combination whose tolerance moves directions by less does not matter, degrees.
const MATTERS_DEG: f64 = 0.003;
/// Tilts at which directions are scored, degrees.
const TILTS_DEG: [f64; 4] = [5.0, 30.0, 55.0, 75.0];
/// Largest θo that counts, degrees.
const LIMIT_DEG: f64 = 75.0;

/// Judges a solution.
#[must_use]
pub fn judge(description: &Description, solution: &Solution, settings: &Settings) -> Verdict {
    let score = score_slopes(description, &solution.row);
    let before = uncertainty(&score, &DMatrix::identity(COUNT, COUNT));
    let after = uncertainty(&score, &solution.covariance);
    let aim_mm = aim_uncertainty(description, solution);
    let eigen = solution.information.clone().symmetric_eigen();
    let mut undetermined = Vec::new();
    let mut gauges = 0;
    for k in 0..COUNT {
        let known = eigen.eigenvalues[k].max(0.0);
        if known >= 1.0 {
            continue;
        }
        let direction = eigen.eigenvectors.column(k).into_owned();
        let effect_deg = effect(&score, &direction);
        if effect_deg < MATTERS_DEG {
            gauges += 1;
            continue;
        }
        undetermined.push(Undetermined {
            words: words(&direction),
            information: known,
            effect_deg,
            poses: helpful(description, &solution.row, &direction, settings),
        });
    }
    undetermined.sort_by(|a, b| b.effect_deg.total_cmp(&a.effect_deg));
    let good = after.rms_deg.iter().all(|v| *v <= GOOD_DEG) && solution.converged;
    Verdict { before, after, aim_mm, undetermined, gauges, good }
}

/// Derivatives of (θi, θo, angle between l and v), degrees per tolerance, over pixels and tilts.
fn score_slopes(description: &Description, row: &Row) -> Vec<[[f64; COUNT]; 3]> {
    let [w, h] = description.camera.size.map(f64::from);
    let optics = Optics::with(description, &Estimate::from_row(row).instrument);
    let rim = description.mirror.rim_eta_deg.to_radians().cos();
    let mut out = Vec::new();
    for tilt in TILTS_DEG {
        let tilt = Angle::from_degrees(tilt);
        for j in 0..10 {
            for i in 0..12 {
                let (u, v) = (w * (f64::from(i) + 0.5) / 12.0, h * (f64::from(j) + 0.5) / 10.0);
                let Some(view) = optics.view(u, v) else { continue };
                let cos_o = view.direction.dot(optics.normal(tilt));
                if view.cos_eta < rim || cos_o < LIMIT_DEG.to_radians().cos() {
                    continue;
                }
                let angles = |o: &Optics, _: &super::Glass| {
                    let d: Vec3 = o.view(u, v)?.direction;
                    let (n, l) = (o.normal(tilt), o.lamp());
                    Some([l.angle_to(n).degrees(), d.angle_to(n).degrees(), l.angle_to(d).degrees()])
                };
                if let Some(s) = derivatives(description, row, &angles) {
                    out.push(s);
                }
            }
        }
    }
    out
}

/// Standard uncertainty of the offset along the azimuth of view, root mean square over pixels that look at the sample between 60° and 77°, mm.
fn aim_uncertainty(description: &Description, solution: &Solution) -> f64 {
    let [w, h] = description.camera.size.map(f64::from);
    let optics = Optics::with(description, &Estimate::from_row(&solution.row).instrument);
    let rim = description.mirror.rim_eta_deg.to_radians().cos();
    let (mut sum, mut n) = (0.0, 0.0);
    for tilt in TILTS_DEG {
        let pose = Pose::from_degrees(tilt, 0.0);
        for k in 0..20 * 16 {
            let at = [w * (f64::from(k % 20) + 0.5) / 20.0, h * (f64::from(k / 20) + 0.5) / 16.0];
            let Some(view) = optics.view(at[0], at[1]) else { continue };
            let cos_o = view.direction.dot(optics.normal(pose.tilt));
            if view.cos_eta < rim || !(0.225..0.5).contains(&cos_o) {
                continue;
            }
            let f =
                |o: &Optics, _: &super::Glass| Some([super::horizon::offset_mm(o, description, pose, at)?]);
            if let Some([s]) = derivatives(description, &solution.row, &f) {
                let s = DVector::from_column_slice(&s);
                sum += (s.transpose() * &solution.covariance * &s)[(0, 0)].max(0.0);
                n += 1.0;
            }
        }
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

fn uncertainty(score: &[[[f64; COUNT]; 3]], covariance: &DMatrix<f64>) -> DirectionUncertainty {
    let mut out = DirectionUncertainty::default();
    for rows in score {
        for (k, row) in rows.iter().enumerate() {
            let s = DVector::from_column_slice(row);
            let variance = (s.transpose() * covariance * &s)[(0, 0)].max(0.0);
            out.rms_deg[k] += variance / score.len() as f64;
            out.max_deg[k] = out.max_deg[k].max(variance.sqrt());
        }
    }
    out.rms_deg = out.rms_deg.map(f64::sqrt);
    out
}

fn effect(score: &[[[f64; COUNT]; 3]], direction: &DVector<f64>) -> f64 {
    let dot = |row: &[f64; COUNT]| -> f64 { row.iter().zip(direction.iter()).map(|(a, b)| a * b).sum() };
    let sum: f64 = score.iter().flatten().map(|row| dot(row).powi(2)).sum();
    (sum / score.len().max(1) as f64).sqrt()
}

/// The parameters that take part in a direction, the strongest first.
fn words(direction: &DVector<f64>) -> String {
    let mut parts: Vec<usize> = (0..COUNT).filter(|&k| direction[k].abs() > 0.3).collect();
    parts.sort_by(|&a, &b| direction[b].abs().total_cmp(&direction[a].abs()));
    let first = parts.first().map_or(1.0, |&k| direction[k].signum());
    let named: Vec<String> = parts
        .iter()
        .enumerate()
        .map(|(i, &k)| {
            let against = if i > 0 && direction[k].signum() != first { "against " } else { "" };
            format!("{against}{}", PARAMETERS[k].words)
        })
        .collect();
    named.join(", ")
}

/// The poses of black glass, flat or on the wedge, that would tell most about a direction.
fn helpful(
    description: &Description,
    row: &Row,
    direction: &DVector<f64>,
    settings: &Settings,
) -> Vec<String> {
    let alpha = description.lamp.half_angle();
    let [low, high] = description.holder.tilt_limits_deg;
    let mut row = *row;
    // nobody has said what wedge there is: one that serves
    if direction.iter().skip(OF_INSTRUMENT).all(|v| v.abs() < 0.3) && !(15.0..28.0).contains(&row[WEDGE]) {
        row[WEDGE] = 21.5;
    }
    let optics = Optics::with(description, &Estimate::from_row(&row).instrument);
    let glass = Estimate::from_row(&row).glass;
    let [w, h] = description.camera.size.map(f64::from);
    let mut gains = Vec::new();
    for kind in [ScanKind::BlackGlass, ScanKind::BlackGlassWedge] {
        let spins: &[f64] =
            if kind == ScanKind::BlackGlass { &[0.0] } else { &[0.0, 60.0, 120.0, 180.0, 240.0, 300.0] };
        for tilt in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0].into_iter().filter(|t| (low..=high).contains(t)) {
            for &spin in spins {
                let pose = Pose::from_degrees(tilt, spin);
                let seen = spot(&optics, &glass, kind, pose, alpha).is_some_and(|i| {
                    (0.0..w).contains(&i.centre_px[0]) && (0.0..h).contains(&i.centre_px[1])
                });
                if !seen {
                    continue;
                }
                let at = |o: &Optics, g: &super::Glass| spot(o, g, kind, pose, alpha).map(|i| i.centroid_px);
                let Some(slopes) = derivatives(description, &row, &at) else { continue };
                let sigma = 0.05f64.hypot(settings.centroid_floor_px);
                let gain: f64 = slopes
                    .iter()
                    .map(|s| {
                        let moved: f64 = s.iter().zip(direction.iter()).map(|(a, b)| a * b).sum();
                        (moved / sigma).powi(2)
                    })
                    .sum();
                gains.push((gain, kind, pose));
            }
        }
    }
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    gains
        .iter()
        .take(3)
        .filter(|g| g.0 > 1.0)
        .map(|(_, kind, pose)| format!("{} at {pose}", kind.name()))
        .collect()
}
