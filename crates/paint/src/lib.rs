//! Car paints: what a coat with flakes looks like, what its flakes are like, and what lies between two paints.
//!
//! Directions inside the clear coat are told by the half angle θh̄ between flake plane and surface and the angle θī of incidence on it
//! (Golla & Klein 2018, section 3; the θ_flake and θ_inc of the flake maps).

pub mod btf_folder;
pub mod car_paint;
pub mod design;
pub mod fit;
pub mod flake_btf;
pub mod flake_floor;
pub mod mixing;
pub mod statistics;
pub mod transport;

pub use car_paint::{CarPaint, CarPaintError, CarPaintParts};
pub use flake_btf::{FlakeBtf, FlakeBtfError};
