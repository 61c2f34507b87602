//! Settings of the reduction. Every one of them stands in the attributes of the result.

use gonio_brdf::Grid;

use crate::error::AcquisitionError;

/// What is done about a clear coat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ClearCoat {
    /// Nothing: the table holds the surface as it is.
    None,
    /// Separated where its gloss is found.
    #[default]
    Auto,
    /// Separated, and the base divided by 1 − F(θi) named as the one wanted.
    SinglePass,
    /// Separated, and the base divided by T(θi) T(θo)/n² named as the one wanted.
    TwoWay,
}

impl ClearCoat {
    /// The form of the base in the attributes of a table that was separated.
    #[must_use]
    pub const fn separated(self) -> &'static str {
        match self {
            Self::SinglePass => "single-pass",
            Self::None | Self::Auto | Self::TwoWay => "two-way",
        }
    }
}

/// How raw frames become a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The grid.
    pub grid: Grid,
    /// Cells whose θo lies beyond are not taken from the frames but extrapolated, degrees.
    pub limit_deg: f64,
    /// How far a pose's θi may be from its row, degrees; the distance counts as an angle error.
    pub row_tolerance_deg: f64,
    /// Standard uncertainty of a direction, degrees: what remains after geometric calibration.
    pub angle_uncertainty_deg: f64,
    /// Smallest visible share of a bin, on one side of the plane of incidence, for which it counts as measured.
    pub min_coverage: f64,
    /// Neighbourhood mean above which a pixel counts as saturated, as a share of the range above black.
    pub saturation: f64,
    /// Coefficients c1, c2, … of the sensor's linearisation `y = c1 x + c2 x² + …` on counts above black over their
    /// range; `[1.0]` is a linear sensor.
    pub linearity: Vec<f64>,
    /// Whether holes are filled and grazing angles extrapolated.
    pub fill: bool,
    /// Whether a clear coat is looked for and separated.
    pub clear_coat: ClearCoat,
    /// Refractive index of the coat where it is known; otherwise it is found from the gloss.
    pub coat_index: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            grid: Grid::sopp(),
            limit_deg: 75.0,
            row_tolerance_deg: 1.0,
            angle_uncertainty_deg: 0.005,
            min_coverage: 0.9,
            saturation: 0.9,
            linearity: vec![1.0],
            fill: true,
            clear_coat: ClearCoat::Auto,
            coat_index: None,
        }
    }
}

impl Options {
    /// Holds every setting against its range.
    ///
    /// # Errors
    /// [`AcquisitionError::Setting`] naming the setting.
    pub fn check(&self) -> Result<(), AcquisitionError> {
        let within = |name, v: f64, low: f64, high: f64, expected| {
            if (low..=high).contains(&v) {
                Ok(())
            } else {
                Err(AcquisitionError::Setting { name, found: v.to_string(), expected })
            }
        };
        within("limit_deg", self.limit_deg, 10.0, 85.0, "10 to 85 degrees")?;
        within("row_tolerance_deg", self.row_tolerance_deg, 0.0, 2.5, "0 to 2.5 degrees")?;
        within("angle_uncertainty_deg", self.angle_uncertainty_deg, 0.0, 5.0, "0 to 5 degrees")?;
        within("min_coverage", self.min_coverage, 0.05, 1.0, "0.05 to 1")?;
        if let Some(index) = self.coat_index {
            within("coat_index", index, 1.01, 3.0, "a refractive index of 1.01 to 3")?;
        }
        within("saturation", self.saturation, 0.1, 0.99, "0.1 to 0.99")?;
        let [ni, no, np] = self.grid.shape();
        if ni == 0 || no < 2 || np < 2 {
            return Err(AcquisitionError::Setting {
                name: "grid",
                found: format!("{ni} x {no} x {np}"),
                expected: "at least 1 x 2 x 2 nodes",
            });
        }
        if self.linearity.is_empty() || self.linearity.iter().any(|c| !c.is_finite()) {
            return Err(AcquisitionError::Setting {
                name: "linearity",
                found: format!("{:?}", self.linearity),
                expected: "at least one finite coefficient",
            });
        }
        Ok(())
    }
}
