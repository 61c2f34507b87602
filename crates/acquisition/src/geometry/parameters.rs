//! What a geometric calibration estimates, in one row: 25 departures of the instrument, and how the black glass lay on the holder.
//!
//! Each parameter has a mechanical tolerance, the standard deviation of its prior about the description's value. Inside the solver a parameter is its
//! departure from the prior's centre over that tolerance.

use gonio_instrument::Misalignment;

/// How the black glass lay on the holder: its normal against the spin axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Lean of the flat glass along the sample frame's x and y at spin 0, degrees.
    pub flat_lean_deg: [f64; 2],
    /// Angle of the wedge, degrees.
    pub wedge_deg: f64,
    /// Azimuth of the wedge's lean in the sample frame, degrees.
    pub wedge_azimuth_deg: f64,
}

impl Default for Glass {
    /// Flat, and a wedge of the middle of the range that serves.
    fn default() -> Self {
        Self { flat_lean_deg: [0.0; 2], wedge_deg: 21.5, wedge_azimuth_deg: 0.0 }
    }
}

/// Instrument and glass: what is estimated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Departures from the description.
    pub instrument: Misalignment,
    /// How the glass lay.
    pub glass: Glass,
}

/// One estimated number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name as it stands in files.
    pub name: &'static str,
    /// In words.
    pub words: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Standard deviation of the prior, in that unit.
    pub tolerance: f64,
}

const fn p(name: &'static str, words: &'static str, unit: &'static str, tolerance: f64) -> Parameter {
    Parameter { name, words, unit, tolerance }
}

/// Number of parameters.
pub const COUNT: usize = 29;

/// The parameters, in the order of every vector and matrix.
pub const PARAMETERS: [Parameter; COUNT] = [
    p("mirror_shift_x", "the mirror's place across (x)", "mm", 0.5),
    p("mirror_shift_y", "the mirror's place across (y)", "mm", 0.5),
    p("mirror_shift_z", "the mirror's place along its axis", "mm", 0.5),
    p("mirror_turn_x", "the mirror's turn about x", "deg", 0.3),
    p("mirror_turn_y", "the mirror's turn about y", "deg", 0.3),
    p("mirror_turn_z", "the mirror's turn about its axis", "deg", 0.3),
    p("mirror_b_error", "the mirror's semi-minor axis b", "mm", 0.2),
    p("camera_shift_x", "the pupil's place across (x)", "mm", 0.5),
    p("camera_shift_y", "the pupil's place across (y)", "mm", 0.5),
    p("camera_shift_z", "the pupil's place along the axis", "mm", 0.5),
    p("camera_turn_right", "the camera's turn about its right axis", "deg", 0.3),
    p("camera_turn_down", "the camera's turn about its down axis", "deg", 0.3),
    p("camera_turn_look", "the camera's turn about its line of sight", "deg", 0.3),
    p("focal_length_error", "the focal length", "relative", 0.02),
    p("principal_point_column", "the principal point's column", "px", 8.0),
    p("principal_point_row", "the principal point's row", "px", 8.0),
    p("k1", "the distortion k1", "1", 0.05),
    p("k2", "the distortion k2", "1", 0.02),
    p("lamp_direction_1", "the lamp's direction (first)", "deg", 0.25),
    p("lamp_direction_2", "the lamp's direction (second)", "deg", 0.25),
    p("tilt_axis_1", "the tilt axis (first)", "deg", 0.25),
    p("tilt_axis_2", "the tilt axis (second)", "deg", 0.25),
    p("spin_axis_1", "the spin axis (first)", "deg", 0.25),
    p("spin_axis_2", "the spin axis (second)", "deg", 0.25),
    p("tilt_zero", "the zero of the tilt", "deg", 0.7),
    p("flat_lean_x", "the lean of the flat glass (x)", "deg", 0.05),
    p("flat_lean_y", "the lean of the flat glass (y)", "deg", 0.05),
    p("wedge", "the angle of the wedge", "deg", 3.0),
    p("wedge_azimuth", "the azimuth of the wedge", "deg", 20.0),
];

/// Place of the mirror's shift, and of the camera's.
pub(super) const MIRROR_SHIFT: usize = 0;
pub(super) const CAMERA_SHIFT: usize = 7;
/// Place of the tilt's zero; the errors of a single tilt act like it.
pub const TILT_ZERO: usize = 24;
/// Place of the wedge's azimuth; the errors of a single spin act like it.
pub const WEDGE_AZIMUTH: usize = 28;
/// Place of the wedge's angle.
pub const WEDGE: usize = 27;
/// Parameters that are the instrument's, the first ones.
pub const OF_INSTRUMENT: usize = 25;

/// A row of all parameters, in their own units.
pub type Row = [f64; COUNT];

impl Estimate {
    /// As a row.
    #[must_use]
    pub fn to_row(&self) -> Row {
        let (m, g) = (&self.instrument, &self.glass);
        let mut row = [0.0; COUNT];
        row[..3].copy_from_slice(&m.mirror_shift_mm);
        row[3..6].copy_from_slice(&m.mirror_turn_deg);
        row[6] = m.mirror_b_error_mm;
        row[7..10].copy_from_slice(&m.camera_shift_mm);
        row[10..13].copy_from_slice(&m.camera_turn_deg);
        row[13] = m.focal_length_error;
        row[14..16].copy_from_slice(&m.principal_point_px);
        row[16] = m.k1;
        row[17] = m.k2;
        row[18..20].copy_from_slice(&m.lamp_direction_deg);
        row[20..22].copy_from_slice(&m.tilt_axis_turn_deg);
        row[22..24].copy_from_slice(&m.spin_axis_turn_deg);
        row[TILT_ZERO] = m.tilt_zero_deg;
        row[25..27].copy_from_slice(&g.flat_lean_deg);
        row[WEDGE] = g.wedge_deg;
        row[WEDGE_AZIMUTH] = g.wedge_azimuth_deg;
        row
    }

    /// From a row.
    #[must_use]
    pub fn from_row(row: &Row) -> Self {
        let three = |k: usize| [row[k], row[k + 1], row[k + 2]];
        let two = |k: usize| [row[k], row[k + 1]];
        Self {
            instrument: Misalignment {
                mirror_shift_mm: three(0),
                mirror_turn_deg: three(3),
                mirror_b_error_mm: row[6],
                camera_shift_mm: three(7),
                camera_turn_deg: three(10),
                focal_length_error: row[13],
                principal_point_px: two(14),
                k1: row[16],
                k2: row[17],
                lamp_direction_deg: two(18),
                tilt_axis_turn_deg: two(20),
                spin_axis_turn_deg: two(22),
                tilt_zero_deg: row[TILT_ZERO],
                ..Misalignment::default()
            },
            glass: Glass {
                flat_lean_deg: two(25),
                wedge_deg: row[WEDGE],
                wedge_azimuth_deg: row[WEDGE_AZIMUTH],
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn a_row_holds_every_departure_that_is_of_geometry() {
        let all = builtin::misalignment().expect("readable");
        let glass = Glass { flat_lean_deg: [0.1, -0.2], wedge_deg: 20.0, wedge_azimuth_deg: 77.0 };
        let e = Estimate {
            instrument: Misalignment { tilt_repeatability_deg: 0.0, lamp_drift: 0.0, ..all },
            glass,
        };
        assert_eq!(Estimate::from_row(&e.to_row()), e);
        assert_eq!(PARAMETERS[TILT_ZERO].name, "tilt_zero");
        assert_eq!(PARAMETERS[WEDGE_AZIMUTH].name, "wedge_azimuth");
        assert_eq!(PARAMETERS[WEDGE].name, "wedge");
    }
}
