//! What a radiometric calibration found of sensor, lamp and light, kept in the description of the instrument it belongs to.

use serde::{Deserialize, Serialize};

/// A number with its standard uncertainty (k = 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// The number.
    pub value: f64,
    /// Its standard uncertainty.
    pub sigma: f64,
}

impl Known {
    /// A number with its standard uncertainty.
    #[must_use]
    pub const fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma }
    }
}

/// A radiometric calibration. Parts that the sessions could not give are left out, and [`Radiometry::notes`] says so.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radiometry {
    /// Counts the radiometric calibrations of an instrument.
    pub version: u32,
    /// Whether everything that a reduction needs was found well enough.
    pub good: bool,
    /// The sessions it was made from, by file name.
    pub sessions: Vec<String>,
    /// What is missing, assumed or accepted, in words.
    pub notes: Vec<String>,
    /// Electrons per raw count, red, green, blue.
    pub electrons_per_count: [Known; 3],
    /// Read noise without the rounding to counts, electrons.
    pub read_noise_e: Known,
    /// Electrons above black at which the camera clips.
    pub full_well_e: Known,
    /// Whether a frame really reached it; otherwise the largest level seen.
    pub full_well_reached: bool,
    /// Raw count at and above which a pixel is clipped.
    pub clipped_at: u32,
    /// Raw count of a pixel without light at no exposure time.
    pub black_level: Known,
    /// Coefficients c1, c2, … of `y = c1 x + c2 x² + …` on counts above black over the nominal range.
    pub linearity: Vec<f64>,
    /// Their standard uncertainties.
    pub linearity_sigma: Vec<f64>,
    /// Level (share of the range), departure from a straight line before and after linearisation (share of the range).
    pub linearity_levels: Vec<[f64; 3]>,
    /// Dark current.
    pub dark: DarkCurrent,
    /// Pixels whose dark current is far above that of the others, by their place row by row.
    pub hot: Vec<u32>,
    /// Pixels that answer to light by less than half or more than twice what those around do, or not at all.
    pub dead: Vec<u32>,
    /// The lamp, session by session.
    pub lamp: Vec<LampStability>,
    /// The flat field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flat: Option<FlatField>,
    /// Black glass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gloss: Option<GlossScale>,
    /// Light that goes astray.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stray: Option<StrayLight>,
    /// From the camera's colours to linear Rec. 709.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourCorrection>,
}

/// Dark current of the usual pixel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DarkCurrent {
    /// Median over the pixels at [`DarkCurrent::temperature_c`], electrons per second.
    pub current_e_s: Known,
    /// Sensor temperature it belongs to, °C; left out where no frame tells one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Temperature step that doubles it, K; left out where the sessions do not differ enough in temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doubling_k: Option<Known>,
    /// Change of the black level with temperature, counts per K.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_per_k: Option<Known>,
    /// Largest departure of the dark signal from a straight line in the exposure, electrons.
    pub nonlinearity_e: f64,
    /// What each temperature gave.
    pub points: Vec<DarkPoint>,
}

/// The dark signal at one temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DarkPoint {
    /// °C.
    pub temperature_c: f64,
    /// Electrons per second.
    pub current_e_s: Known,
    /// Counts at no exposure time.
    pub black_level: Known,
}

/// The lamp's monitor over a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LampStability {
    /// The session, by file name.
    pub session: String,
    /// Poses.
    pub poses: u32,
    /// Change from the first to the last pose by a straight line, relative.
    pub drift: f64,
    /// Standard deviation about a steady drift, relative.
    pub scatter: f64,
    /// Standard deviation within a pose, relative.
    pub within: f64,
}

/// The white reference as the pixels see it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlatField {
    /// Serial number of the reference.
    pub serial: String,
    /// Median of k E0 g on the axis' étendue, red, green, blue, electrons per second · sr.
    pub scale: [f64; 3],
    /// Median relative standard uncertainty of a pixel's scale from noise.
    pub pixel_sigma: f64,
    /// Relative standard uncertainty that the certificate brings.
    pub certificate: f64,
    /// Pixels that have a scale, share of all.
    pub covered: f64,
    /// Standard deviation of the pixels' sensitivities about their surroundings, noise taken off, relative.
    pub pixel_response: Known,
}

/// Gloss of black glass against Fresnel's reflectance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlossScale {
    /// Refractive index that was assumed.
    pub index: f64,
    /// Measured over expected reflectance; 1 is perfect.
    pub scale: Known,
    /// Poses used.
    pub poses: u32,
    /// Radius of the lamp's image at half its level, degrees; left out where pixels are too coarse.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_angle_deg: Option<Known>,
    /// The lamp's profile: angle from the centre over α, level relative to a uniform disc.
    pub profile: Vec<[f64; 2]>,
}

/// Light that goes astray, and how to take it off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrayLight {
    /// Share of all light that spreads evenly over the picture.
    pub glare: Known,
    /// Share of each point's light in its tail.
    pub tail_share: Known,
    /// Standard deviation of the narrowest of the tail's four Gaussians on the sensor, mm.
    pub tail_radius_mm: Known,
    /// κ of the camera's own face: f is seen larger by κ R(v) S, R and S integrals of f (docs/calibration.md), 1/sr.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub face: Option<Known>,
    /// Light that comes past the sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub haze: Option<Haze>,
}

/// Light that comes past the sample, on a coarse grid over the picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Haze {
    /// Tiles across and down.
    pub tiles: [u32; 2],
    /// Electrons per second at the nominal lamp; red, green, blue of each tile, row by row.
    pub rates_e_s: Vec<[f32; 3]>,
    /// Standard uncertainty of a tile's rate, red, green, blue, electrons per second.
    pub sigma_e_s: [f64; 3],
}

/// A matrix from the camera's linear colours to linear Rec. 709 (D65), from a chart.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColourCorrection {
    /// Rows red, green, blue.
    pub matrix: [[f64; 3]; 3],
    /// Name of the chart's file.
    pub chart: String,
    /// Patches used.
    pub patches: u32,
    /// Mean colour difference left over the patches, CIEDE2000.
    pub delta_e_mean: f64,
    /// Largest.
    pub delta_e_max: f64,
}

impl Radiometry {
    /// Holds the numbers that a reduction uses against what can be: such a file may have been written by hand.
    ///
    /// # Errors
    /// [`crate::FileError::Value`] with the first outside its range.
    pub fn check(&self, pixels: usize) -> Result<(), crate::FileError> {
        let bad = |field: &str, found: String, expected: &str| {
            Err(crate::FileError::Value {
                field: format!("radiometry.{field}"),
                found,
                expected: expected.to_owned(),
            })
        };
        for g in self.electrons_per_count {
            if !(g.value > 0.0 && g.value.is_finite()) {
                return bad("electrons_per_count", g.value.to_string(), "a positive number");
            }
        }
        if !(self.read_noise_e.value >= 0.0 && self.read_noise_e.value.is_finite()) {
            return bad("read_noise_e", self.read_noise_e.value.to_string(), "not negative");
        }
        if !(self.black_level.value.is_finite() && self.black_level.value < f64::from(self.clipped_at)) {
            return bad("black_level", self.black_level.value.to_string(), "below clipped_at");
        }
        if self.linearity.is_empty() || self.linearity.iter().any(|c| !c.is_finite()) {
            return bad("linearity", format!("{:?}", self.linearity), "at least one finite coefficient");
        }
        if let Some(p) = self.hot.iter().chain(&self.dead).find(|p| **p as usize >= pixels) {
            return bad("hot", p.to_string(), "a pixel of the camera");
        }
        if let Some(s) = &self.stray {
            let shares = [s.glare.value, s.tail_share.value];
            if shares.iter().any(|v| !(-0.05..=0.5).contains(v)) {
                return bad("stray", format!("{shares:?}"), "shares of the light from 0 to 0.5");
            }
            if let Some(h) = &s.haze
                && (h.rates_e_s.len() != h.tiles[0] as usize * h.tiles[1] as usize || h.rates_e_s.is_empty())
            {
                return bad("stray.haze", h.rates_e_s.len().to_string(), "one rate for each tile");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Description, builtin};

    fn sound() -> Radiometry {
        Radiometry {
            version: 2,
            electrons_per_count: [Known::new(2.5, 0.01); 3],
            black_level: Known::new(64.2, 0.01),
            clipped_at: 4095,
            linearity: vec![1.0, 0.01],
            ..Radiometry::default()
        }
    }

    #[test]
    fn it_survives_in_a_description_and_nonsense_is_named() {
        let mut d = builtin::description("tiny").expect("known").expect("readable");
        d.radiometry = Some(sound());
        let text = d.to_toml().expect("writable");
        assert_eq!(Description::from_toml(&text).expect("readable"), d);
        let stray =
            StrayLight { haze: Some(Haze { tiles: [2, 2], ..Haze::default() }), ..StrayLight::default() };
        let none = [Known::new(0.0, 0.0); 3];
        for (bad, word) in [
            (Radiometry { electrons_per_count: none, ..sound() }, "electrons_per_count"),
            (Radiometry { linearity: Vec::new(), ..sound() }, "linearity"),
            (Radiometry { clipped_at: 10, ..sound() }, "black_level"),
            (Radiometry { hot: vec![1 << 30], ..sound() }, "hot"),
            (Radiometry { stray: Some(stray), ..sound() }, "haze"),
        ] {
            d.radiometry = Some(bad);
            let e = Description::from_toml(&d.to_toml().expect("writable")).expect_err(word).to_string();
            assert!(e.contains(word), "{e}");
        }
    }
}
