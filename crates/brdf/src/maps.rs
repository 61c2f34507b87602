//! Two-dimensional look-ups for effect coatings, and the three-dimensional one they are compared with.
//!
//! Flakes in a clear coat make the colour depend on what a flake sees, (θ_inc, θ_flake), far more than on how the three angles outside came
//! about. [`ColourMap`] is Kirchner's map: in-plane measurements, reached from any geometry along its isochromatic line. [`FlakeMap`] is
//! tabulated over flake space itself and fitted to all measurements, so that no critical angle stands in its way. [`Aspecular`] is what
//! came before both, [`LookupTable`] the trilinear table that all of them save.
//!
//! None of them holds the gloss of the coat: within some degrees of the mirror direction they say nothing that was measured.

pub mod aspecular;
mod banded;
pub mod colour_map;
pub mod finding;
mod flake_choice;
pub mod flake_file;
pub mod flake_fit;
mod flake_lanes;
pub mod flake_map;
pub mod flake_options;
mod flake_point;
mod flake_rows;
pub mod lookup_table;
pub mod multi_angle;
pub mod samples;
pub mod speed;
pub mod transform;
pub mod trigonometric_map;

pub use aspecular::Aspecular;
pub use colour_map::ColourMap;
pub use finding::{Finding, Standing};
pub use flake_file::MapFileError;
pub use flake_map::FlakeMap;
pub use flake_options::{FitError, FlakeFitOptions, Setting};
pub use lookup_table::LookupTable;
pub use multi_angle::{Prior, portable_geometries};
pub use samples::{Region, Sample};
pub use transform::Transform;

#[cfg(test)]
mod honesty_tests;
#[cfg(test)]
mod tests;
