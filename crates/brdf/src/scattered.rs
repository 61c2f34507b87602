//! Measurements at scattered geometries.

use gonio_optics::Geometry;

use crate::{Flag, Rgb};

/// One geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatteredPoint {
    /// Where.
    pub geometry: Geometry,
    /// f in 1/sr.
    pub value: Rgb,
    /// Standard uncertainty (k = 1), 1/sr, where it is known.
    pub sigma: Option<Rgb>,
    /// What is known of it.
    pub flag: Flag,
}

/// A set of scattered measurements, node values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scattered {
    /// In the order of the file.
    pub points: Vec<ScatteredPoint>,
}
