//! A physical flake paint: single mirrors in a clear coat, each with its place, size, tilt, depth and colour.
//!
//! A flake is a flat facet that flashes while the half angle moves over its *life* (6–7° for real ones: its own unevenness). In slopes, the half
//! vector h and a flake tilted to slope s meet as a Gaussian of width b, so that with the coat's factor k = T(i) T(o)/n² and directions inside,
//!
//! ```text
//! f(x) = k [ Σ_flakes v(x) t · R(θī) · P_b(slope(h) − s) / cos⁴θh̄ / (4 cos ī cos ō)  +  (1 − Σ v(x)) a/π ]
//! ```
//!
//! v(x) is the share of a texel that the flake covers and no flake above it hides, t what the tinted coat over it lets through, R its reflectance
//! with the interference colour of its film, P_b the Gaussian. Slopes of flakes are Gaussian too, so the mean over them is Beckmann's distribution:
//! that is the law its tests hold the sum over flakes to. Everything is a function of the description and its seed. The tile repeats over the surface.
//!
//! Left out: light that goes from flake to flake, and the shift by depth under oblique view (a flake is seen where it lies).

mod description;
mod field;
mod film;
mod footprint;
mod slices;
#[cfg(test)]
mod tests;

pub use description::{FlakePaint, FlakePaintError, Population};
pub use field::{Field, MeanPaint};
