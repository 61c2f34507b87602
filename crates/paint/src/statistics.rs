//! Flakes told by their statistics: for each slice a few dozen boxes in Lab with probabilities, and a fixed random texture that draws
//! from them (Golla & Klein 2018, section 3.2).
//!
//! A texture of 128 × 128 colours becomes at most 50 cuboids in Lab, colours uniform inside, and an inverse distribution function of
//! [`STEPS`] steps. Probabilities are whole steps, so nothing rare is lost in the function, and transport between two such
//! distributions moves whole steps as well. What rounding them changes is given back: mean and standard deviation of L*, a* and b* of each slice are those of
//! its texels ([`Cuboids::Moments`]); tight boxes as the paper has them are [`Cuboids::Tight`].

mod clusters;
mod draw;
mod fidelity;
mod lab;
mod octree;
mod random;

#[cfg(test)]
pub(crate) mod tests;

pub use clusters::{Cluster, FlakeStatistics, StatisticsError, StatisticsOptions};
pub use draw::Drawn;
pub use fidelity::{Fidelity, SliceFidelity, Sparkle, fidelity};
pub use lab::{brdf_from_lab, lab_from_brdf_lanes};
pub use octree::Cuboids;
pub use random::RandomTexture;

/// Steps of the inverse distribution function.
pub const STEPS: usize = 500;
