//! A raw camera frame: counts as the sensor gave them, never demosaiced.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Colour channel of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Red.
    Red = 0,
    /// Green.
    Green = 1,
    /// Blue.
    Blue = 2,
}

/// Colour filter pattern, named by the 2 × 2 tile from the top left, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BayerPattern {
    /// Red green / green blue.
    Rggb,
    /// Blue green / green red.
    Bggr,
    /// Green red / blue green.
    Grbg,
    /// Green blue / red green.
    Gbrg,
}

impl BayerPattern {
    /// Channel of the pixel at (`column`, `row`).
    #[must_use]
    pub const fn channel(self, column: u32, row: u32) -> Channel {
        use Channel::{Blue, Green, Red};
        let tile = match self {
            Self::Rggb => [Red, Green, Green, Blue],
            Self::Bggr => [Blue, Green, Green, Red],
            Self::Grbg => [Green, Red, Blue, Green],
            Self::Gbrg => [Green, Blue, Red, Green],
        };
        tile[((row & 1) << 1 | (column & 1)) as usize]
    }
}

/// One raw frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Raw counts, row by row, `width * height` long.
    pub pixels: Vec<u16>,
    /// Exposure time the camera really took.
    pub exposure: Duration,
    /// Running number given by the camera; a gap is a dropped frame.
    pub sequence: u64,
    /// Camera time of the start of exposure, since the camera was opened.
    pub stamp: Duration,
    /// Sensor temperature, °C, where the camera tells it.
    pub sensor_temperature_c: Option<f64>,
}
