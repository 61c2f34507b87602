//! The clear coat: its gloss found and measured pose by pose, its index from all of them, the base coat underneath.
//!
//! ```text
//! f = T(θi) T(θo)/n² · f_base(refracted directions) + f_gloss,     f_gloss = F(θi)/(Ω_lamp cos θi) inside the lamp's mirror image
//! ```
//!
//! Nothing is assumed of the sample: [`gloss`] fits the base around the mirror direction and takes what stands above it there as gloss, [`index`]
//! holds the poses' gloss against Fresnel's curve and decides whether there is a coat, [`separate`] divides it out cell by cell and
//! [`crate::fill`] then fills what was not measured in flake space, where 75°…90° outside is a strip of 1.7° beside what is known.
//! No inter-reflection inside the coat is modelled, so π f_base may exceed 1.

pub mod gloss;
pub mod index;
mod local_base;
pub mod separate;

pub use gloss::Gloss;
pub use index::{CoatFit, Verdict};
