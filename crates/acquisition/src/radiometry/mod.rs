//! Radiometric calibration: what the counts of the camera mean.
//!
//! From sessions to [`gonio_instrument::radiometry::Radiometry`], in the order in which one needs the other: dark frames ([`dark_current`]), a flat series
//! ([`series`], put together in `response`) for dead pixels ([`defects`]), linearity ([`linearity`]) and photon transfer ([`photon_transfer`]); then, with these, a trap's haze ([`haze`]), glare
//! and tails ([`stray_fit`], from [`evidence`]), the camera's own face ([`face`], [`face_fit`]; together in `astray`), the white reference's flat field and black glass ([`gloss_scale`]; `references`).
//! [`stray`] takes stray light off the pictures of a reduction.

mod astray;
pub mod azimuth_part;
pub mod calibrate;
pub mod chart;
pub mod dark_current;
pub mod defects;
pub mod distance;
pub mod error;
pub mod evidence;
pub mod face;
pub mod face_azimuths;
pub mod face_fit;
pub mod gloss_scale;
pub mod haze;
pub mod linearity;
pub mod photon_transfer;
pub mod plans;
mod references;
mod response;
pub mod series;
pub mod stray;
pub mod stray_fit;
pub mod table_part;

pub use calibrate::{Calibrated, Input, Settings, calibrate};
pub use error::RadiometryError;
