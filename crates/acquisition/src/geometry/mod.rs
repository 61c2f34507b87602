//! Geometric calibration: where mirror, camera, lamp and axes really are, from where a black glass shows the lamp.
//!
//! Observations are the centroids of the lamp's mirror image ([`spots`]) on black glass, flat and on a wedge of unknown angle, spun and tilted,
//! and edges of known things in the pictures of a white sample ([`edges`]): the mirror's rim and its openings. [`solve`] finds the
//! [`parameters`] by Levenberg and Marquardt with mechanical tolerances as priors, throws out outliers by name and gives the full covariance;
//! [`verdict`] says what stays undetermined and how surely directions are known.
//!
//! Gauge: the lab frame is that of the description (nominal mirror axis through F1), the semi-major axis a keeps its nominal value.
//! Joint motions of everything move no pixel's directions in the sample frame; their priors alone hold them, which harms nothing that is measured.

pub mod edges;
pub mod ellipse;
pub mod horizon;
pub mod parameters;
pub mod plans;
pub mod predict;
pub mod record;
pub mod solve;
pub mod spots;
pub mod verdict;

pub use parameters::{Estimate, Glass, PARAMETERS};
pub use solve::{CalibrationError, Problem, Residual, Settings, Solution, solve};
pub use spots::{NoSpot, Spot, SpotFinder};
pub use verdict::Verdict;
