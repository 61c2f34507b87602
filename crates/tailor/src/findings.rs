//! What is worth saying about a material before its numbers are used: nothing is made up silently.

use gonio_brdf::maps;

use crate::{GlossPeak, Material};

/// One thing found.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// A coat is assumed of which the data show nothing.
    Uncoated {
        /// The index assumed.
        index: f64,
        /// Light in the peak about the mirror direction against what such a coat reflects, where it can be told.
        share: Option<f64>,
    },
    /// All measurements lie in the plane of incidence.
    AllInPlane {
        /// How many.
        count: usize,
    },
    /// Geometries asked for of which nothing was measured; they are left out.
    NotMeasured {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// What a flake map says of itself.
    Map(maps::Finding),
    /// Few measurements: the map between them is a smooth continuation.
    Sparse {
        /// How many.
        count: usize,
    },
}

impl Finding {
    /// Whether a coat is assumed of which nothing shows: in a model without one, or in a measurement without the gloss of one.
    #[must_use]
    pub fn of_coat(material: &Material, index: f64) -> Vec<Self> {
        if index <= 1.0 || material.flake_map().is_some() {
            return Vec::new();
        }
        if material.is_model() {
            let bare = material.stated_index().is_some_and(|n| n <= 1.0);
            return if bare { vec![Self::Uncoated { index, share: None }] } else { Vec::new() };
        }
        let peak = GlossPeak::of(material, index);
        match peak.share {
            Some(share) if !peak.is_seen() => vec![Self::Uncoated { index, share: Some(share) }],
            _ => Vec::new(),
        }
    }

    /// Name for programs.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Uncoated { .. } => "uncoated",
            Self::AllInPlane { .. } => "all-in-plane",
            Self::NotMeasured { .. } => "not-measured",
            Self::Map(maps::Finding::AllInPlane { .. }) => "all-in-plane",
            Self::Map(maps::Finding::CoatNotSeen { .. }) => "coat-not-seen",
            Self::Map(maps::Finding::MostlyContinued { .. }) => "mostly-continued",
            Self::Map(maps::Finding::Estimated { .. }) => "estimated",
            Self::Sparse { .. } => "sparse",
        }
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Uncoated { index, share: None } => write!(
                f,
                "the model has no coat, but an index of {index} is assumed: its isolines bend where no light is refracted; use --index 1"
            ),
            Self::Uncoated { index, share: Some(share) } => write!(
                f,
                "no gloss of a coat is seen: the peak about the mirror direction holds {:.1} % of what a coat of index {index} reflects; \
                 if the sample has no coat use --index 1",
                100.0 * share
            ),
            Self::AllInPlane { count } => write!(
                f,
                "all {count} measurements lie in the plane of incidence: how colour depends on the azimuth was not measured, so harmonics \
                 (K of 1 and more) cannot be determined"
            ),
            Self::NotMeasured { count, of } => {
                write!(f, "{count} of {of} geometries asked for have no measurement near and are left out")
            }
            Self::Map(finding) => finding.fmt(f),
            Self::Sparse { count } => {
                write!(
                    f,
                    "{count} measurements only: between them the map is a smooth continuation, not a measurement"
                )
            }
        }
    }
}
