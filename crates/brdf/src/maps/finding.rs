//! What a map has to say about itself: what its data could not decide, and where an answer is no measurement.

use serde::{Deserialize, Serialize};

/// Something that whoever uses a map should know; kept in its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Finding {
    /// All geometries lie in the plane of incidence, where every harmonic has the same sign: none can be told from c_0, so the map has none.
    AllInPlane {
        /// K that was asked for.
        asked: usize,
    },
    /// Without a coat the measurements are predicted better than with the one that was given.
    CoatNotSeen {
        /// Index that was given.
        index: f64,
        /// Error of prediction with it, relative to that without a coat.
        ratio: f64,
    },
    /// Few measurements: most of the map is a smooth continuation.
    MostlyContinued {
        /// Share of the map's nodes with a measurement beside them.
        covered: f64,
    },
    /// Estimated from the in-plane geometries of a portable instrument with what is usual among materials; `sigma` says how far to trust it.
    Estimated {
        /// Geometries.
        measured: usize,
    },
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AllInPlane { asked } => write!(
                f,
                "all geometries lie in the plane of incidence: the {asked} harmonics asked for are undetermined and left out; measure out of the plane to have them"
            ),
            Self::CoatNotSeen { index, ratio } => write!(
                f,
                "the measurements speak against a coat of index {index}: without one they are predicted {ratio:.2} times better; if the sample has no clear coat, use index 1"
            ),
            Self::MostlyContinued { covered } => write!(
                f,
                "only {:.0} % of the map has measurements beside it, the rest is a smooth continuation; measure more geometries",
                100.0 * covered
            ),
            Self::Estimated { measured } => write!(
                f,
                "estimated from {measured} in-plane geometries: away from them the map is a guess with the uncertainty it states"
            ),
        }
    }
}

/// What stands behind the answer of a map at one geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// Measurements stand around it.
    Measured,
    /// No measurement stands beside this place in flake space: a smooth continuation.
    Continued,
    /// Within the cone about the mirror direction that was left out for the gloss: the base coat continued, without gloss.
    Gloss,
    /// Beyond the largest polar angle of the measurements.
    BeyondLargest,
    /// Below the horizon: f is 0.
    BelowHorizon,
}

impl Standing {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Continued => "continued",
            Self::Gloss => "gloss",
            Self::BeyondLargest => "beyond-largest",
            Self::BelowHorizon => "below-horizon",
        }
    }
}
