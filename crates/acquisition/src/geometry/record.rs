//! What of a calibration is kept in the instrument's description.

use gonio_instrument::calibration::{CalibrationRecord, Determined};
use gonio_instrument::{Description, Misalignment};

use super::parameters::{COUNT, PARAMETERS};
use super::solve::{Settings, Solution};
use super::verdict::Verdict;

/// The description with a calibration, one version further than `description` itself.
#[must_use]
pub fn calibrated(
    description: &Description,
    solution: &Solution,
    verdict: &Verdict,
    settings: &Settings,
    sessions: Vec<String>,
) -> Description {
    let before = description.calibration_record.as_ref().map_or(0, |r| r.version);
    let parameters = (0..COUNT)
        .map(|k| Determined {
            name: PARAMETERS[k].name.to_owned(),
            unit: PARAMETERS[k].unit.to_owned(),
            value: solution.row[k],
            sigma: solution.sigma(k),
        })
        .collect();
    // rows of the lower triangle, in the parameters' own units
    let covariance = (0..COUNT)
        .flat_map(|i| (0..=i).map(move |j| (i, j)))
        .map(|(i, j)| solution.covariance[(i, j)] * PARAMETERS[i].tolerance * PARAMETERS[j].tolerance)
        .collect();
    let used =
        |edge: bool| solution.residuals.iter().filter(|r| !r.rejected && r.edge == edge).count() as u32;
    let mut out = description.clone();
    out.calibration = Some(Misalignment {
        tilt_repeatability_deg: settings.tilt_repeatability_deg,
        ..solution.estimate.instrument.clone()
    });
    out.calibration_record = Some(CalibrationRecord {
        version: before + 1,
        good: verdict.good,
        sessions,
        spots: used(false),
        edges: used(true),
        rejected: solution.rejected().map(|r| r.name.clone()).collect(),
        spot_rms_px: solution.rms_px,
        reduced_chi2: solution.reduced_chi2,
        theta_i_deg: verdict.after.rms_deg[0],
        theta_o_deg: verdict.after.rms_deg[1],
        light_view_deg: verdict.after.rms_deg[2],
        aim_mm: Some(verdict.aim_mm),
        undetermined: verdict.undetermined.iter().map(|u| u.words.clone()).collect(),
        parameters,
        covariance,
    });
    out
}
