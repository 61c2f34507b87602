//! Between two paints and beyond: flakes by optimal transport, the rest linearly (Golla & Klein 2018, section 4).
//!
//! Each slice of the flakes is a distribution of boxes in Lab. The cheapest transport between two of them pairs boxes; along each path a
//! box moves and changes its shape while the weights change (eqs. 14, 15), its probability stays. A third paint is joined to the mixture at
//! equal weights of those before, and so on. χ is blended in Lab, the coefficients of the analytic part as they are. Weights outside of [0, 1] extrapolate.
//!
//! [`Mixable`] is prepared once; [`Mixable::realise`] writes a mixture into memory that is there already, and [`Mixable::mix`] makes a paint of it.

mod analytic;
mod mixable;
mod realise;
mod shader;

#[cfg(test)]
pub(crate) mod tests;

pub use mixable::Mixable;
pub use realise::{Mixed, Part, Realisation};
pub use shader::ShaderFlakes;

use crate::statistics::StatisticsError;
use crate::transport::TransportError;
use crate::{CarPaintError, car_paint::Through};

/// Why paints do not mix.
#[derive(Debug, thiserror::Error)]
pub enum MixError {
    /// One paint is no mixture.
    #[error("{found} paint given, a mixture needs at least 2")]
    TooFew {
        /// Paints given.
        found: usize,
    },
    /// Another number of weights than paints.
    #[error("{found} weights given for {paints} paints; give one weight for each, in their order")]
    WeightCount {
        /// Weights given.
        found: usize,
        /// Paints.
        paints: usize,
    },
    /// A weight that is no number.
    #[error("weight {place} is {found}, expected a finite number from −10 to 10")]
    Weight {
        /// From 0.
        place: usize,
        /// As given.
        found: f64,
    },
    /// Flakes recorded at other angles.
    #[error(
        "the flakes of paint {place} ({name}) are sampled at {found}, those of the first at {expected}; slices are mixed one by one, \
         so record or rebuild both at the same angles"
    )]
    Sampling {
        /// Place of the paint, from 0.
        place: usize,
        /// Its name.
        name: String,
        /// Its angles.
        found: String,
        /// Those of the first paint that has flakes.
        expected: String,
    },
    /// Colours of the base against colours seen outside.
    #[error(
        "paint {place} ({name}) holds colours of the form {}, the first of the form {}; fit both in the same form", found.name(), expected.name()
    )]
    Through {
        /// Place of the paint, from 0.
        place: usize,
        /// Its name.
        name: String,
        /// Its form.
        found: Through,
        /// That of the first.
        expected: Through,
    },
    /// A coat on some only.
    #[error("paint {place} ({name}) {} a clear coat, unlike the first; angles inside and outside of a coat do not mix", if *coated { "has" } else { "has not" })]
    Coat {
        /// Place of the paint, from 0.
        place: usize,
        /// Its name.
        name: String,
        /// Whether it has one.
        coated: bool,
    },
    /// No statistics of the flakes.
    #[error(transparent)]
    Statistics(#[from] StatisticsError),
    /// No transport between two slices.
    #[error("slice {slice}: {source}")]
    Transport {
        /// Slice, from 0.
        slice: usize,
        /// Why.
        source: TransportError,
    },
    /// A mixture outside of what a paint can be.
    #[error(transparent)]
    Paint(#[from] CarPaintError),
}
