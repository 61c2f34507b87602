//! Radiometric calibration: what the counts of the camera mean.
//!
//! From sessions to [`gonio_instrument::radiometry::Radiometry`], in the order in which one needs the other: dark frames ([`dark_current`]), a flat series
//! ([`series`]) for dead pixels ([`defects`]), linearity ([`linearity`]) and photon transfer ([`photon_transfer`]); then, with these, a trap's haze, glare
//! and tails ([`stray_fit`]), the camera's own face ([`face`], [`face_fit`]), the white reference's flat field and black glass ([`gloss_scale`]).
//! [`stray`] takes stray light off the pictures of a reduction.

pub mod calibrate;
pub mod chart;
pub mod dark_current;
pub mod defects;
pub mod error;
pub mod face;
pub mod face_fit;
pub mod gloss_scale;
pub mod linearity;
pub mod photon_transfer;
pub mod plans;
pub mod series;
pub mod stray;
pub mod stray_fit;
pub mod table_part;

pub use calibrate::{Calibrated, Input, Settings, calibrate};
pub use error::RadiometryError;
