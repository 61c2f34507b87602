//! What representations there are, and what they are called.

use std::str::FromStr;

use gonio_fitter::ModelChoice;
use gonio_optics::isoline::Method;

/// Largest K.
const MOST_HARMONICS: usize = 3;

/// One way to store f.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Representation {
    /// Three dimensions, trilinear.
    Table,
    /// Kirchner's colour map with a rule for the critical angle.
    ColourMap(Method),
    /// Flake map of K harmonics.
    FlakeMap(usize),
    /// The aspecular angle alone.
    Aspecular,
    /// A fitted model.
    Model(ModelChoice),
}

/// A name that is no representation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown representation \"{found}\": use table, clip, map-vector, map-vector-parallel, unit-index, flake-map:K with K of 0 to 3, or aspecular"
)]
pub struct UnknownRepresentation {
    /// The name given.
    pub found: String,
}

impl Representation {
    /// Every one that can be built without a fit of a model.
    pub const MAPS: [Self; 10] = [
        Self::Table,
        Self::Aspecular,
        Self::ColourMap(Method::UnitIndex),
        Self::ColourMap(Method::Clip),
        Self::ColourMap(Method::MapVector),
        Self::ColourMap(Method::MapVectorParallel),
        Self::FlakeMap(0),
        Self::FlakeMap(1),
        Self::FlakeMap(2),
        Self::FlakeMap(3),
    ];

    /// Every one, the fitter's models included.
    pub fn all() -> impl Iterator<Item = Self> {
        let models = ModelChoice::ALL.into_iter().map(|(_, m)| m).filter(|m| *m != ModelChoice::Auto);
        Self::MAPS.into_iter().chain(models.map(Self::Model))
    }
}

impl std::fmt::Display for Representation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Table => f.write_str("table"),
            Self::ColourMap(m) => f.write_str(m.name()),
            Self::FlakeMap(k) => write!(f, "flake-map:{k}"),
            Self::Aspecular => f.write_str("aspecular"),
            Self::Model(m) => {
                f.write_str(ModelChoice::ALL.iter().find(|a| a.1 == *m).map_or("model", |a| a.0))
            }
        }
    }
}

impl FromStr for Representation {
    type Err = UnknownRepresentation;
    fn from_str(s: &str) -> Result<Self, UnknownRepresentation> {
        let unknown = || UnknownRepresentation { found: s.to_owned() };
        match s {
            "table" => Ok(Self::Table),
            "aspecular" => Ok(Self::Aspecular),
            _ => match s.strip_prefix("flake-map:") {
                Some(k) => {
                    k.parse().ok().filter(|k| *k <= MOST_HARMONICS).map(Self::FlakeMap).ok_or_else(unknown)
                }
                None => s.parse().map(Self::ColourMap).map_err(|_| unknown()),
            },
        }
    }
}
