//! The fit: Levenberg and Marquardt over all parameters, in units of their tolerances, with those as priors.
//!
//! A pose stands where its encoders say up to the mechanics' repeatability. That nuisance is integrated out: a spot's covariance is its
//! centroid's plus `b bᵀ` for tilt and spin, b the spot's motion per standard deviation of either. Far from the solution the spots count with
//! uncertainties of 2 and 0.3 pixels first (a descent from coarse to fine), so that nothing gross decides where the fit goes; in the end observations beyond
//! [`Settings::outlier_sigma`] are thrown out one after the other and named.

use gonio_instrument::{Description, ScanKind};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::edges::Edge;
use super::horizon;
use super::parameters::{COUNT, Estimate, PARAMETERS, Row, TILT_ZERO, WEDGE, WEDGE_AZIMUTH};
use super::predict::{derivatives, mirror_direction, spot};
use super::spots::Spot;
use crate::optics::Optics;

/// What is known of the mechanics, and when an observation is an outlier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Standard deviation of a tilt about what is read back, degrees.
    pub tilt_repeatability_deg: f64,
    /// The same of a spin.
    pub spin_repeatability_deg: f64,
    /// Added in quadrature to the uncertainty of each centroid, pixels: what the lamp's image model does not know.
    pub centroid_floor_px: f64,
    /// Standard deviations from which an observation is thrown out.
    pub outlier_sigma: f64,
    /// Most steps of a descent: one that has not arrived by then has not converged.
    pub most_steps: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            tilt_repeatability_deg: 0.01,
            spin_repeatability_deg: 0.01,
            centroid_floor_px: 0.01,
            outlier_sigma: 5.0,
            most_steps: 60,
        }
    }
}

/// What is to be explained.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The instrument as built; a calibration in it is where the search begins.
    pub description: Description,
    /// Spots on flat glass and wedge.
    pub spots: Vec<Spot>,
    /// Edges of known things.
    pub edges: Vec<Edge>,
}

/// A fit that cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// Too little was seen.
    #[error(
        "{found} spots of black glass were found, at least {needed} are needed; scan black glass flat (--kind black-glass) and on a wedge of 18 to 25 degrees (--kind black-glass-wedge) over several tilts and spins"
    )]
    TooFew {
        /// Spots found.
        found: usize,
        /// Spots needed.
        needed: usize,
    },
    /// The equations have no solution.
    #[error(
        "the normal equations of the calibration are singular or not finite; the description is far from the instrument: check mirror, camera and lamp in it"
    )]
    Singular,
}

/// Where an observation stands against the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// Session and pose, or the edge, in words.
    pub name: String,
    /// Where it was seen, pixels.
    pub at_px: [f64; 2],
    /// Seen less predicted, pixels; an edge's along its normal.
    pub off_px: [f64; 2],
    /// In standard deviations, the pose's repeatability included.
    pub sigmas: f64,
    /// Not used in the fit.
    pub rejected: bool,
    /// An edge, not a spot.
    pub edge: bool,
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Instrument and glass.
    pub estimate: Estimate,
    /// The same as a row.
    pub row: Row,
    /// Covariance of the parameters in units of their tolerances, row by row.
    pub covariance: DMatrix<f64>,
    /// What the observations alone tell, the same units: Jᵀ C⁻¹ J.
    pub information: DMatrix<f64>,
    /// Every observation.
    pub residuals: Vec<Residual>,
    /// Root mean square of the used spots' residuals, pixels a coordinate.
    pub rms_px: f64,
    /// Weighted sum of squares over degrees of freedom, priors included on both sides.
    pub reduced_chi2: f64,
    /// Steps taken.
    pub iterations: usize,
    /// Whether the last descent ended where no step helps.
    pub converged: bool,
}

impl Solution {
    /// Standard uncertainty of a parameter in its own unit.
    #[must_use]
    pub fn sigma(&self, k: usize) -> f64 {
        self.covariance[(k, k)].max(0.0).sqrt() * PARAMETERS[k].tolerance
    }

    /// Observations that were thrown out.
    pub fn rejected(&self) -> impl Iterator<Item = &Residual> {
        self.residuals.iter().filter(|r| r.rejected)
    }
}

/// Fewest spots.
pub const FEWEST: usize = 8;
/// Uncertainties that stand in for the spots' while the fit is far off, pixels.
const COARSE_PX: [f64; 3] = [2.0, 0.3, 0.0];

/// Fits everything.
///
/// # Errors
/// [`CalibrationError`]; a fit that does not converge comes back marked as such.
pub fn solve(problem: &Problem, settings: &Settings) -> Result<Solution, CalibrationError> {
    if problem.spots.len() < FEWEST {
        return Err(CalibrationError::TooFew { found: problem.spots.len(), needed: FEWEST });
    }
    let centre = start(problem);
    let count = problem.spots.len() + problem.edges.len();
    let mut used = vec![true; count];
    let mut row = horizon::start(&problem.description, &problem.edges, &centre);
    let mut iterations = 0;
    let mut converged = false;
    let mut descend = |row: &mut Row, used: &[bool], coarse: f64| -> Result<(), CalibrationError> {
        let (steps, done) = descent(problem, settings, &centre, row, used, coarse)?;
        iterations += steps;
        converged = done;
        Ok(())
    };
    for coarse in COARSE_PX {
        descend(&mut row, &used, coarse)?;
        // what is still grossly off after the coarse descent is no spot of this lamp
        let bound = if coarse > 0.0 { 4.0 * settings.outlier_sigma } else { f64::INFINITY };
        for (k, o) in observations(problem, settings, &row, coarse).iter().enumerate() {
            used[k] = o.as_ref().is_none_or(|o| o.sigmas() <= bound);
        }
    }
    loop {
        let worst = observations(problem, settings, &row, 0.0)
            .iter()
            .enumerate()
            .filter(|(k, _)| used[*k])
            .map(|(k, o)| (k, o.as_ref().map_or(f64::INFINITY, Observation::sigmas)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, s)) = worst else { break };
        let left = used.iter().take(problem.spots.len()).filter(|u| **u).count();
        if s <= settings.outlier_sigma || left <= FEWEST {
            break;
        }
        used[k] = false;
        descend(&mut row, &used, 0.0)?;
    }
    let all = observations(problem, settings, &row, 0.0);
    let (information, _, chi2) = equations(&all, &used);
    let whole = &information + DMatrix::identity(COUNT, COUNT);
    let covariance = whole.try_inverse().ok_or(CalibrationError::Singular)?;
    let prior: f64 = departures(&row, &centre).iter().map(|x| x * x).sum();
    let mut rows = 0;
    let (mut sum, mut spots) = (0.0, 0.0);
    let residuals = (0..count)
        .map(|k| {
            let edge = k >= problem.spots.len();
            let (name, at_px) = if edge {
                let e = &problem.edges[k - problem.spots.len()];
                (e.name(), e.at_px)
            } else {
                (problem.spots[k].name.clone(), problem.spots[k].centre_px)
            };
            let o = all[k].as_ref();
            let off_px = o.map_or([f64::NAN; 2], |o| o.off_px);
            if used[k] {
                rows += if edge { 1 } else { 2 };
                if !edge {
                    sum += off_px[0].powi(2) + off_px[1].powi(2);
                    spots += 2.0;
                }
            }
            let sigmas = o.map_or(f64::INFINITY, Observation::sigmas);
            Residual { name, at_px, off_px, sigmas, rejected: !used[k], edge }
        })
        .collect();
    Ok(Solution {
        estimate: Estimate::from_row(&row),
        row,
        covariance,
        information,
        residuals,
        rms_px: (sum / f64::max(spots, 1.0)).sqrt(),
        // as many priors as parameters: what is left of the freedom is the number of observations
        reduced_chi2: (chi2 + prior) / f64::from(rows.max(1)),
        iterations,
        converged,
    })
}

/// Where the search begins: the description's calibration or nominal, and the wedge that explains the spots best.
fn start(problem: &Problem) -> Row {
    let instrument = problem.description.calibration.clone().unwrap_or_default();
    let mut best = Estimate { instrument, ..Estimate::default() };
    let optics = Optics::with(&problem.description, &best.instrument);
    let wedge: Vec<&Spot> = problem.spots.iter().filter(|s| s.kind == ScanKind::BlackGlassWedge).collect();
    if wedge.is_empty() {
        return best.to_row();
    }
    let alpha = problem.description.lamp.half_angle();
    let candidates: Vec<(f64, f64)> =
        (0..5).flat_map(|a| (0..36).map(move |k| (17.5 + 2.0 * f64::from(a), 10.0 * f64::from(k)))).collect();
    let off = |&(angle, azimuth): &(f64, f64)| -> f64 {
        let mut glass = best.glass;
        (glass.wedge_deg, glass.wedge_azimuth_deg) = (angle, azimuth);
        let mut all: Vec<f64> = wedge
            .iter()
            .map(|s| match spot(&optics, &glass, s.kind, s.readback, alpha) {
                Some(i) => (i.centre_px[0] - s.centre_px[0]).hypot(i.centre_px[1] - s.centre_px[1]),
                None => 1e3,
            })
            .collect();
        all.sort_unstable_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let errors: Vec<f64> = candidates.par_iter().map(off).collect();
    let least = (0..errors.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
    (best.glass.wedge_deg, best.glass.wedge_azimuth_deg) = candidates[least];
    best.to_row()
}

/// The centre of the priors: nominal, with the wedge where the search began.
fn prior_centre(centre: &Row) -> Row {
    let mut out = Estimate::default().to_row();
    out[WEDGE] = centre[WEDGE];
    out[WEDGE_AZIMUTH] = centre[WEDGE_AZIMUTH];
    out
}

fn departures(row: &Row, centre: &Row) -> DVector<f64> {
    let prior = prior_centre(centre);
    DVector::from_fn(COUNT, |k, _| (row[k] - prior[k]) / PARAMETERS[k].tolerance)
}

/// An observation against its prediction, whitened.
pub(crate) struct Observation {
    /// Seen less predicted, pixels.
    off_px: [f64; 2],
    /// Whitened residuals, one or two.
    residuals: Vec<f64>,
    /// Their derivatives of the *prediction* per tolerance.
    slopes: Vec<[f64; COUNT]>,
}

impl Observation {
    /// Length of the whitened residual, as a number of standard deviations.
    pub fn sigmas(&self) -> f64 {
        let s: f64 = self.residuals.iter().map(|r| r * r).sum();
        s.sqrt()
    }
}

fn observations(
    problem: &Problem,
    settings: &Settings,
    row: &Row,
    coarse_px: f64,
) -> Vec<Option<Observation>> {
    let d = &problem.description;
    let estimate = Estimate::from_row(row);
    let optics = Optics::with(d, &estimate.instrument);
    let alpha = d.lamp.half_angle();
    let spots = problem.spots.par_iter().map(|s| {
        let here = spot(&optics, &estimate.glass, s.kind, s.readback, alpha)?.centroid_px;
        // the slope of the image's centre: that of its centroid differs by a thousandth and costs five times as much
        let centre = |o: &Optics, g: &super::Glass| o.pixel(mirror_direction(o, g, s.kind, s.readback)?);
        let slope = derivatives(d, row, &centre)?;
        let sigma = (s.sigma_px.powi(2) + settings.centroid_floor_px.powi(2)).sqrt().max(coarse_px);
        let off_px = [s.centre_px[0] - here[0], s.centre_px[1] - here[1]];
        let per = |k: usize, deg: f64| {
            let f = deg / PARAMETERS[k].tolerance;
            [slope[0][k] * f, slope[1][k] * f]
        };
        let tilt = per(TILT_ZERO, settings.tilt_repeatability_deg);
        let spin = per(WEDGE_AZIMUTH, settings.spin_repeatability_deg);
        let c = |i: usize, j: usize| {
            tilt[i] * tilt[j] + spin[i] * spin[j] + if i == j { sigma * sigma } else { 0.0 }
        };
        // C = L Lᵀ; whitened is L⁻¹
        let l00 = c(0, 0).sqrt();
        let l10 = c(1, 0) / l00;
        let l11 = (c(1, 1) - l10 * l10).max(1e-300).sqrt();
        let white = |a: f64, b: f64| [a / l00, (b - l10 / l00 * a) / l11];
        let mut slopes = vec![[0.0; COUNT]; 2];
        for k in 0..COUNT {
            let w = white(slope[0][k], slope[1][k]);
            (slopes[0][k], slopes[1][k]) = (w[0], w[1]);
        }
        Some(Observation { off_px, residuals: white(off_px[0], off_px[1]).to_vec(), slopes })
    });
    let edges = problem.edges.par_iter().map(|e| {
        let at = |o: &Optics, _: &super::Glass| e.distance_px(o, d).map(|v| [v]);
        let here = e.distance_px(&optics, d)?;
        let [slope] = derivatives(d, row, &at)?;
        let sigma = e.sigma_px.max(0.5 * coarse_px);
        // the distance grows as the edge is predicted nearer: its own derivative with the sign of a prediction
        Some(Observation {
            off_px: [0, 1].map(|k| here * e.normal_px[k]),
            residuals: vec![here / sigma],
            slopes: vec![slope.map(|s| -s / sigma)],
        })
    });
    spots.chain(edges).collect()
}

/// Information, gradient and weighted sum of squares of the observations in use.
fn equations(all: &[Option<Observation>], used: &[bool]) -> (DMatrix<f64>, DVector<f64>, f64) {
    let mut information = DMatrix::zeros(COUNT, COUNT);
    let mut gradient = DVector::zeros(COUNT);
    let mut chi2 = 0.0;
    for o in all.iter().zip(used).filter(|(_, u)| **u).filter_map(|(o, _)| o.as_ref()) {
        for (r, s) in o.residuals.iter().zip(&o.slopes) {
            let s = DVector::from_column_slice(s);
            information.ger(1.0, &s, &s, 1.0);
            gradient.axpy(*r, &s, 1.0);
            chi2 += r * r;
        }
    }
    (information, gradient, chi2)
}

/// Descends from `row` with the observations in use; steps taken, and whether it arrived.
fn descent(
    problem: &Problem,
    settings: &Settings,
    centre: &Row,
    row: &mut Row,
    used: &[bool],
    coarse_px: f64,
) -> Result<(usize, bool), CalibrationError> {
    // an observation that vanishes from the sensor must not make a step look good
    let missing = |all: &[Option<Observation>]| {
        all.iter().zip(used).filter(|(o, u)| **u && o.is_none()).count() as f64 * 1e6
    };
    let cost = |all: &[Option<Observation>], row: &Row| {
        let chi2: f64 = all
            .iter()
            .zip(used)
            .filter(|(_, u)| **u)
            .filter_map(|(o, _)| o.as_ref())
            .map(|o| o.residuals.iter().map(|r| r * r).sum::<f64>())
            .sum();
        chi2 + departures(row, centre).norm_squared() + missing(all)
    };
    let mut all = observations(problem, settings, row, coarse_px);
    let mut now = cost(&all, row);
    let mut lambda = 1e-3;
    for step in 0..settings.most_steps {
        let (information, gradient, _) = equations(&all, used);
        let normal = &information + DMatrix::identity(COUNT, COUNT);
        let right = gradient - departures(row, centre);
        let mut accepted = false;
        while lambda < 1e10 {
            let mut damped = normal.clone();
            for k in 0..COUNT {
                damped[(k, k)] *= 1.0 + lambda;
            }
            let delta = damped.cholesky().ok_or(CalibrationError::Singular)?.solve(&right);
            let mut trial = *row;
            for k in 0..COUNT {
                trial[k] += delta[k] * PARAMETERS[k].tolerance;
            }
            let there = observations(problem, settings, &trial, coarse_px);
            let then = cost(&there, &trial);
            if then.is_finite() && then <= now {
                let gain = now - then;
                (*row, all, now) = (trial, there, then);
                lambda = (lambda * 0.1).max(1e-12);
                if gain < 1e-7 * (1.0 + now) && delta.norm() < 1e-4 {
                    return Ok((step + 1, true));
                }
                accepted = true;
                break;
            }
            if delta.norm() < 1e-9 {
                return Ok((step + 1, true));
            }
            lambda = (lambda * 10.0).max(1e-6);
        }
        if !accepted {
            return Ok((step + 1, false));
        }
    }
    Ok((settings.most_steps, false))
}
