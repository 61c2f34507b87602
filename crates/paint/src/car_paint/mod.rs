//! The car-paint model of Golla & Klein (2018, eq. 7) with its file.
//!
//! ```text
//! f(x, i, o) = k(i, o) · [ χ(θh̄, θī) · (a/π + Σ_k fCT_k(ī, ō)) + Ξ(x, θh̄, θī) ]
//! ```
//!
//! Bars mark directions refracted by the coat; a is Lambert's diffuse part, fCT up to three Cook–Torrance lobes, χ a colour table, Ξ the flakes.
//! k is what the coat lets through, in one of two forms ([`Through`]): T(i) T(o)/n², or 1 as the paper prints it.
//! The gloss of the coat itself needs a lamp and stands apart, as everywhere ([`gonio_brdf::Coat`]).

mod angle_axis;
mod colour_table;
mod container;
mod error;
mod file;
mod flakes;
mod guenther;
#[cfg(test)]
pub(crate) mod laws;
mod paint;

pub use angle_axis::AngleAxis;
pub use colour_table::ColourTable;
pub use container::{Container, ContainerError, Section};
pub use error::CarPaintError;
pub use file::{is_paint, read_paint, write_paint};
pub use flakes::{FlakeDraws, FlakePlace, FlakeSlices, Flakes};
pub use guenther::{guenther_names, is_guenther, lobe_from_1982, read_guenther};
pub use paint::{CarPaint, CarPaintParts, Inside, MAX_LOBES, Through};
