//! How far a virtual instrument's camera and light depart from the ideal: the truth that a radiometric calibration has to find.
//!
//! Stands as `[radiometry]` in a misalignment file. Zero everywhere (and left-out fields) is a camera as the description has it, in a mirror
//! that throws no light where it should not.

use serde::{Deserialize, Serialize};

use crate::FileError;

/// Departures of sensor and light.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Imperfections {
    /// Relative error of the electrons per count.
    pub gain_error: f64,
    /// Relative error of the read noise.
    pub read_noise_error: f64,
    /// Added to the black level, counts.
    pub black_level_error: f64,
    /// a in `x = u (1 − a u)`: what a signal u (a share of the range) is read as.
    pub compression: f64,
    /// Standard deviation of the pixels' sensitivities, relative.
    pub pixel_response: f64,
    /// Pixels that answer to light with a fiftieth of what they should.
    pub dead_pixels: u32,
    /// Factor on the dark current, less one.
    pub dark_current_error: f64,
    /// Temperature step that doubles the dark current, K; 0 for the usual one.
    pub dark_doubling_k: f64,
    /// Temperature of the air, °C; left out for the usual one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient_c: Option<f64>,
    /// Share of all light that spreads evenly over the picture.
    pub veiling_glare: f64,
    /// Share of each point's light that goes into its tail: four Gaussians, each twice as wide as the one before and with half its light.
    pub tail_share: f64,
    /// Standard deviation of the narrowest of them on the sensor, mm.
    pub tail_radius_mm: f64,
    /// Diffuse reflectance of the camera's own face, which the mirror throws back onto the sample.
    pub face_reflectance: f64,
    /// Light that comes from the lamp past the sample, relative to a white sample in normal light.
    pub lamp_haze: f64,
}

impl Imperfections {
    /// Holds every number against what can be.
    ///
    /// # Errors
    /// [`FileError::Value`] with the first outside its range.
    pub fn check(&self) -> Result<(), FileError> {
        let ranges = [
            ("gain_error", self.gain_error, -0.9, 10.0),
            ("read_noise_error", self.read_noise_error, -1.0, 100.0),
            ("black_level_error", self.black_level_error, -1e4, 1e4),
            ("compression", self.compression, -0.3, 0.3),
            ("pixel_response", self.pixel_response, 0.0, 0.3),
            ("dark_current_error", self.dark_current_error, -1.0, 1e4),
            ("dark_doubling_k", self.dark_doubling_k, 0.0, 100.0),
            ("ambient_c", self.ambient_c.unwrap_or(20.0), -40.0, 60.0),
            ("veiling_glare", self.veiling_glare, 0.0, 0.3),
            ("tail_share", self.tail_share, 0.0, 0.3),
            ("tail_radius_mm", self.tail_radius_mm, 0.0, 10.0),
            ("face_reflectance", self.face_reflectance, 0.0, 1.0),
            ("lamp_haze", self.lamp_haze, 0.0, 1.0),
        ];
        match ranges.into_iter().find(|(_, v, low, high)| !(*low..=*high).contains(v)) {
            Some((name, found, low, high)) => Err(FileError::Value {
                field: format!("radiometry.{name}"),
                found: found.to_string(),
                expected: format!("{low} to {high}"),
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Misalignment;

    #[test]
    fn a_misalignment_file_holds_them_and_nonsense_is_named() {
        let read = |text: &str| Misalignment::from_toml(&format!("[radiometry]\n{text}"));
        let m = read("compression = 0.02\nambient_c = 31.0").expect("sound");
        let wanted = Imperfections { compression: 0.02, ambient_c: Some(31.0), ..Imperfections::default() };
        assert_eq!(m.radiometry, Some(wanted));
        for (text, word) in [
            ("veiling_glare = 0.9", "veiling_glare"),
            ("dark_doubling_k = nan", "dark_doubling_k"),
            ("glow = 1", "glow"),
        ] {
            let e = read(text).expect_err(text).to_string();
            assert!(e.contains(word), "{e}");
        }
        assert_eq!(Misalignment::from_toml("").expect("sound").radiometry, None);
    }
}
