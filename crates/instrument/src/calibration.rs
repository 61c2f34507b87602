//! What a geometric calibration says of itself, kept beside what it found: from what, how surely, and the whole covariance.

use serde::{Deserialize, Serialize};

/// One estimated number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Determined {
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Departure from the description (the glass's own for its lean and wedge).
    pub value: f64,
    /// Standard uncertainty.
    pub sigma: f64,
}

/// A geometric calibration's record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationRecord {
    /// Counts the calibrations of an instrument.
    pub version: u32,
    /// Whether it converged and directions are known well enough.
    pub good: bool,
    /// The sessions it was made from, by file name.
    pub sessions: Vec<String>,
    /// Spots used.
    pub spots: u32,
    /// Edge points used.
    pub edges: u32,
    /// Observations thrown out, by name.
    pub rejected: Vec<String>,
    /// Root mean square residual of a spot's coordinate, pixels.
    pub spot_rms_px: f64,
    /// Weighted sum of squares over degrees of freedom.
    pub reduced_chi2: f64,
    /// Standard uncertainty of θi, degrees.
    pub theta_i_deg: f64,
    /// Of θo, root mean square over the pixels, degrees.
    pub theta_o_deg: f64,
    /// Of the angle between light and view, root mean square over the pixels, degrees.
    pub light_view_deg: f64,
    /// Standard uncertainty of where mirror and camera look on the sample, across the line of sight, mm; none in records that do not tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aim_mm: Option<f64>,
    /// Combinations of parameters that matter and stayed undetermined.
    pub undetermined: Vec<String>,
    /// Rows of the covariance's lower triangle, in the units of `parameters`.
    pub covariance: Vec<f64>,
    /// Every parameter.
    pub parameters: Vec<Determined>,
}

impl CalibrationRecord {
    /// The standard uncertainty of a direction for the uncertainty budget, degrees: the largest of its three.
    #[must_use]
    pub fn direction_deg(&self) -> f64 {
        self.theta_i_deg.max(self.theta_o_deg).max(self.light_view_deg)
    }
}
