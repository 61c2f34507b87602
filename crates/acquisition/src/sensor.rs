//! From raw counts to electrons: black level and linearisation as a table, noise figures of the camera.

use gonio_instrument::description::CameraGeometry;

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
}

impl Sensor {
    /// The sensor of a camera; `saturation` is a share of the range above black, `linearity` as in
    /// [`crate::Options::linearity`].
    #[must_use]
    pub fn new(camera: &CameraGeometry, saturation: f64, linearity: &[f64]) -> Self {
        let (top, black) = (camera.top_code(), camera.black_level);
        let range = f64::from(top - black);
        let gain_e = camera.electrons_per_count();
        let electrons = (0..=top)
            .map(|raw| {
                let x = (f64::from(raw) - f64::from(black)) / range;
                let y = linearity.iter().rev().fold(0.0, |sum, c| (sum + c) * x);
                (y * range * gain_e) as f32
            })
            .collect();
        Self {
            electrons,
            clipped: top as u16,
            saturated: (f64::from(black) + saturation * range) as f32,
            gain_e,
            read_variance_e2: camera.read_noise_e * camera.read_noise_e + gain_e * gain_e / 12.0,
        }
    }

    /// Electrons above the nominal black level.
    #[must_use]
    pub fn electrons(&self, raw: u16) -> f64 {
        let last = self.electrons.len().saturating_sub(1);
        f64::from(self.electrons.get(usize::from(raw).min(last)).copied().unwrap_or(0.0))
    }
}
