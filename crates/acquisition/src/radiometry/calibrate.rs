//! From sessions to a radiometric calibration, each part from those that come before it.

use std::sync::Arc;

use gonio_instrument::radiometry::{LampStability, Radiometry};
use gonio_instrument::{Certificate, Description, PoseRecord, ScanKind};

use super::dark_current::DarkSeries;
use super::photon_transfer::PhotonTransfer;
use super::{RadiometryError, astray, references, response, stray_fit};
use crate::error::AcquisitionError;
use crate::lamp;
use crate::merge::check_frames;
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::sensor::Sensor;

/// Gain uncertainty above which a calibration is not good, relative.
const GOOD_GAIN: f64 = 0.03;
/// Misfit of the photon-transfer curve above which it is not.
const GOOD_CHI2: f64 = 4.0;

/// A session that a calibration is made from.
pub struct Input<'a> {
    /// Its file name.
    pub name: String,
    /// What it is of.
    pub kind: ScanKind,
    /// Certificate of its reference sample.
    pub certificate: Option<Certificate>,
    /// What was accepted of it though it should not have been.
    pub notes: Vec<String>,
    /// Its poses, from the first each time.
    #[allow(clippy::type_complexity)] // an iterator that can be begun again
    pub poses: Box<dyn Fn() -> Box<dyn Iterator<Item = PoseRecord> + 'a> + 'a>,
}

/// Settings of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Refractive index of the black glass.
    pub index: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { index: 1.567 }
    }
}

/// A calibration, with what its pictures show.
pub struct Calibrated {
    /// The description with the calibration in it.
    pub description: Description,
    /// The photon-transfer curve.
    pub transfer: PhotonTransfer,
    /// Dark current of each pixel, electrons per second.
    pub dark_map: Vec<f32>,
    /// Stray light as it was found.
    pub stray: Option<stray_fit::Found>,
    /// Gloss over Fresnel's reflectance: θi in degrees, ratio, relative uncertainty.
    pub gloss: Vec<[f64; 3]>,
}

impl Calibrated {
    /// The calibration itself.
    #[must_use]
    pub fn radiometry(&self) -> Radiometry {
        self.description.radiometry.clone().unwrap_or_default()
    }
}

/// Calibrates an instrument. A radiometric calibration that the description already holds takes no part, but for its version.
///
/// # Errors
/// [`RadiometryError`].
pub fn calibrate(
    description: &Description,
    inputs: &[Input<'_>],
    settings: &Settings,
) -> Result<Calibrated, RadiometryError> {
    let version = description.radiometry.as_ref().map_or(0, |r| r.version) + 1;
    let plain = Description { radiometry: None, ..description.clone() };
    let map = Arc::new(PixelMap::new(&plain));
    for input in inputs {
        // frames of another camera are told before anything is made of them
        if let Some(record) = (input.poses)().next() {
            check_frames(&record, &map).map_err(|e| in_session(input, e))?;
        }
    }
    let flat = inputs.iter().find(|i| i.kind == ScanKind::Flat).ok_or(RadiometryError::NoFlat)?;
    let nominal = Sensor::of(&plain, &Options::default());
    let mut dark = DarkSeries::default();
    for input in inputs {
        dark.add(&mut (input.poses)(), &nominal);
    }
    if dark.is_empty() {
        return Err(RadiometryError::NoDark);
    }
    let record = (flat.poses)().next().ok_or(RadiometryError::NoFlat)?;
    let mut radiometry = Radiometry {
        version,
        sessions: inputs.iter().map(|i| i.name.clone()).collect(),
        notes: inputs.iter().flat_map(|i| i.notes.iter().map(|n| format!("{}: {n}", i.name))).collect(),
        lamp: inputs.iter().filter_map(stability).collect(),
        hot: dark.hot(&nominal, map.width() * map.height()),
        ..Radiometry::default()
    };
    let response::Shown { transfer, spread, bend } = response::find(&record, &map, &dark, &mut radiometry)?;
    let mut described = Description { radiometry: Some(radiometry), ..description.clone() };
    let stray = astray::find(&mut described, inputs, settings.index, [spread, bend])?;
    let gloss = references::find(&mut described, inputs, settings)?;
    let r = described.radiometry.get_or_insert_default();
    let gain_relative = r.electrons_per_count.iter().map(|g| g.sigma / g.value).fold(0.0, f64::max);
    r.good = gain_relative < GOOD_GAIN && transfer.reduced_chi2 < GOOD_CHI2;
    if !r.good {
        r.notes.push(format!(
            "not good: gain uncertain by {:.1} % (at most {} %), misfit of the photon-transfer curve {:.1} (at most {GOOD_CHI2})",
            100.0 * gain_relative,
            100.0 * GOOD_GAIN,
            transfer.reduced_chi2
        ));
    }
    let dark_map = dark.map(&Sensor::of(&described, &Options::default()), map.width() * map.height());
    Ok(Calibrated { description: described, transfer, dark_map, stray, gloss })
}

pub(super) fn in_session(input: &Input<'_>, source: AcquisitionError) -> RadiometryError {
    RadiometryError::Session { session: input.name.clone(), source }
}

/// The lamp's monitor over a session.
pub(super) fn stability(input: &Input<'_>) -> Option<LampStability> {
    let (mut means, mut within) = (Vec::new(), Vec::new());
    for record in (input.poses)() {
        let lit: Vec<f64> =
            record.exposures.iter().filter(|e| e.shutter_open).map(|e| e.lamp_monitor).collect();
        if lit.is_empty() {
            continue;
        }
        means.push(lit.iter().sum::<f64>() / lit.len() as f64);
        within.push(lamp::scatter(&lit));
    }
    (!means.is_empty()).then(|| LampStability {
        session: input.name.clone(),
        poses: means.len() as u32,
        drift: lamp::drift(&means),
        scatter: lamp::scatter(&means),
        within: (within.iter().map(|w| w * w).sum::<f64>() / within.len() as f64).sqrt(),
    })
}
