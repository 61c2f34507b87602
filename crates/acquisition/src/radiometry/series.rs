//! A flat series, sorted: at each exposure the lit frames and the dark ones, two of each at least.

use std::time::Duration;

use gonio_instrument::{Exposure, PoseRecord};

use super::RadiometryError;

/// Frames of one exposure.
#[derive(Debug)]
pub struct Level<'a> {
    /// The exposure.
    pub exposure: Duration,
    /// Lit.
    pub lit: Vec<&'a Exposure>,
    /// With the shutter closed.
    pub dark: Vec<&'a Exposure>,
}

impl Level<'_> {
    /// Mean of the lamp's monitor over the lit frames.
    #[must_use]
    pub fn lamp(&self) -> f64 {
        self.lit.iter().map(|e| e.lamp_monitor).sum::<f64>() / self.lit.len().max(1) as f64
    }

    /// Exposure times lamp, s.
    #[must_use]
    pub fn light_s(&self) -> f64 {
        self.exposure.as_secs_f64() * self.lamp()
    }
}

/// The levels of a record, the shortest exposure first.
///
/// # Errors
/// [`RadiometryError::NoPairs`] where no exposure was taken twice, [`RadiometryError::NoDark`] where lit exposures have no dark frames of their own.
pub fn levels(record: &PoseRecord) -> Result<Vec<Level<'_>>, RadiometryError> {
    let mut out: Vec<Level<'_>> = Vec::new();
    for e in &record.exposures {
        let exposure = e.frame.exposure;
        let at = out.partition_point(|l| l.exposure < exposure);
        if out.get(at).is_none_or(|l| l.exposure != exposure) {
            out.insert(at, Level { exposure, lit: Vec::new(), dark: Vec::new() });
        }
        if e.shutter_open && e.lamp_monitor > 0.0 {
            out[at].lit.push(e);
        } else if !e.shutter_open {
            out[at].dark.push(e);
        }
    }
    if !out.iter().any(|l| l.lit.len() >= 2) {
        return Err(RadiometryError::NoPairs { exposures: out.iter().filter(|l| !l.lit.is_empty()).count() });
    }
    if !out.iter().any(|l| l.lit.len() >= 2 && !l.dark.is_empty()) {
        return Err(RadiometryError::NoDark);
    }
    out.retain(|l| l.lit.len() >= 2 && !l.dark.is_empty());
    Ok(out)
}

/// Mean counts of frames, pixel by pixel.
#[must_use]
pub fn mean(frames: &[&Exposure], pixels: usize) -> Vec<f32> {
    let mut out = vec![0f32; pixels];
    for e in frames {
        for (o, &v) in out.iter_mut().zip(&e.frame.pixels) {
            *o += f32::from(v);
        }
    }
    let n = frames.len().max(1) as f32;
    out.iter_mut().for_each(|v| *v /= n);
    out
}
