//! Angles, directions, frames; Fresnel and Snell; flake space; colour.
//!
//! The physics every other room shares. Nothing here knows devices, files or threads, and nothing here is fitted or measured:
//! it is closed-form geometry, refraction and colour science in f64.
//!
//! Conventions: the sample frame has z along the outward normal; light `l = (sin θi, 0, cos θi)` and view
//! `v = (sin θo cos φ, sin θo sin φ, cos θo)` both point away from the surface. φ = 0° is the light's own side
//! (retro-reflection), φ = 180° the mirror side.

pub mod angle;
pub mod colour;
pub mod edge;
pub mod flake;
pub mod frame;
pub mod fresnel;
pub mod geometry;
pub mod isoline;
pub mod isoline_single;
pub mod quadrature;
pub mod vec3;

pub use angle::Angle;
pub use frame::{Rigid, Rotation};
pub use geometry::Geometry;
pub use isoline::{Isoline, isoline};
pub use isoline_single::{IsolineSingle, isoline_single};
pub use vec3::Vec3;

/// The smallest cosine used as a denominator; keeps models finite at θ = 90°.
pub const COS_FLOOR: f64 = 1e-6;
