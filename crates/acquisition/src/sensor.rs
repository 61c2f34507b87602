//! From raw counts to electrons: black level and linearisation as a table, noise figures of the camera.

use gonio_instrument::Description;
use gonio_instrument::description::CameraGeometry;

use crate::dark::DOUBLING_K;
use crate::options::Options;

/// What the merge needs to know of a sensor.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Electrons above the nominal black level for each raw value; raw values past the end are saturated.
    electrons: Vec<f32>,
    /// Raw value at and above which a pixel is clipped.
    pub clipped: u16,
    /// Raw value above which the mean of a neighbourhood counts as saturated.
    pub saturated: f32,
    /// Electrons per count.
    pub gain_e: f64,
    /// Variance of reading and of rounding to counts, electrons².
    pub read_variance_e2: f64,
    /// Temperature step that doubles the dark current, K.
    pub doubling_k: f64,
    /// Pixels that a calibration found hot or dead, in rising order.
    pub defects: Vec<u32>,
}

impl Sensor {
    /// The sensor of an instrument: as its radiometric calibration found it, else as its description has it. Coefficients of linearity among the options
    /// stand over the calibration's.
    #[must_use]
    pub fn of(d: &Description, options: &Options) -> Self {
        let Some(r) = &d.radiometry else {
            return Self::new(&d.camera, options.saturation, &options.linearity);
        };
        let linearity = if options.linearity == [1.0] { &r.linearity } else { &options.linearity };
        let gain_e = r.electrons_per_count.iter().map(|g| g.value).sum::<f64>() / 3.0;
        let mut out = Self::with(&d.camera, options.saturation, linearity, r.black_level.value, gain_e);
        out.clipped = out.clipped.min(r.clipped_at.min(u32::from(u16::MAX)) as u16);
        out.read_variance_e2 = r.read_noise_e.value.powi(2) + gain_e * gain_e / 12.0;
        out.doubling_k = r.dark.doubling_k.map_or(DOUBLING_K, |k| k.value);
        out.defects = r.hot.iter().chain(&r.dead).copied().collect();
        out.defects.sort_unstable();
        out.defects.dedup();
        out
    }

    /// The sensor of a camera; `saturation` is a share of the range above black, `linearity` as in
    /// [`crate::Options::linearity`].
    #[must_use]
    pub fn new(camera: &CameraGeometry, saturation: f64, linearity: &[f64]) -> Self {
        let black = f64::from(camera.black_level);
        Self::with(camera, saturation, linearity, black, camera.electrons_per_count())
    }

    fn with(camera: &CameraGeometry, saturation: f64, linearity: &[f64], black: f64, gain_e: f64) -> Self {
        let top = camera.top_code();
        let range = f64::from(top - camera.black_level);
        let electrons = (0..=top)
            .map(|raw| {
                let x = (f64::from(raw) - black) / range;
                let y = linearity.iter().rev().fold(0.0, |sum, c| (sum + c) * x);
                (y * range * gain_e) as f32
            })
            .collect();
        Self {
            electrons,
            clipped: top as u16,
            saturated: (black + saturation * range) as f32,
            gain_e,
            read_variance_e2: camera.read_noise_e * camera.read_noise_e + gain_e * gain_e / 12.0,
            doubling_k: DOUBLING_K,
            defects: Vec::new(),
        }
    }

    /// Electrons above the nominal black level.
    #[must_use]
    pub fn electrons(&self, raw: u16) -> f64 {
        let last = self.electrons.len().saturating_sub(1);
        f64::from(self.electrons.get(usize::from(raw).min(last)).copied().unwrap_or(0.0))
    }
}
