//! Who and what was scanned.

use serde::{Deserialize, Serialize};

/// What a session measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScanKind {
    /// A sample.
    #[default]
    Sample,
    /// The white reference: fixes `k(p) E0 g`.
    White,
    /// Black glass, flat: gloss scale and lamp profile.
    BlackGlass,
    /// Black glass on a wedge: geometry.
    BlackGlassWedge,
    /// Shutter closed.
    Dark,
    /// A white sample at one pose under a series of exposures, each at least twice: photon transfer and linearity.
    Flat,
    /// A matt black sample with a certificate: what the camera's face throws back.
    Black,
    /// A light trap in the sample's place: light that comes past the sample.
    Trap,
}

impl ScanKind {
    /// The name used in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::White => "white",
            Self::BlackGlass => "black-glass",
            Self::BlackGlassWedge => "black-glass-wedge",
            Self::Dark => "dark",
            Self::Flat => "flat",
            Self::Black => "black",
            Self::Trap => "trap",
        }
    }
}

/// The sample record of a session; every field may be empty.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SampleRecord {
    /// What is measured.
    pub kind: ScanKind,
    /// The laboratory's identifier.
    pub id: String,
    /// A name for people.
    pub name: String,
    /// Production batch.
    pub batch: String,
    /// Who ran the scan.
    pub operator: String,
    /// Anything else.
    pub note: String,
}
