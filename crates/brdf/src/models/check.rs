//! Bounds of model parameters: what a file says must be usable before anything is computed with it.

use super::ModelError;
use crate::Rgb;

/// Checks the parameters of one model; the name goes into the messages.
pub(crate) struct Check(pub &'static str);

impl Check {
    fn error(&self, key: &'static str, found: f64, expected: &'static str) -> ModelError {
        ModelError::Value { model: self.0, key, found: found.to_string(), expected }
    }

    /// Every channel finite and not negative.
    pub(crate) fn colour(&self, key: &'static str, value: Rgb) -> Result<(), ModelError> {
        match value.into_iter().find(|v| !(v.is_finite() && *v >= 0.0)) {
            Some(v) => Err(self.error(key, v, "three finite numbers, none below 0")),
            None => Ok(()),
        }
    }

    /// Exponent of a lobe.
    pub(crate) fn exponent(&self, key: &'static str, value: f64) -> Result<(), ModelError> {
        let ok = (0.0..=MAX_EXPONENT).contains(&value);
        if ok { Ok(()) } else { Err(self.error(key, value, "0…1e9 (1e6 is nearly a mirror)")) }
    }

    /// Root-mean-square slope of a rough surface.
    pub(crate) fn alpha(&self, key: &'static str, value: f64) -> Result<(), ModelError> {
        let ok = (1e-4..=10.0).contains(&value);
        if ok {
            Ok(())
        } else {
            Err(self.error(key, value, "1e-4…10 (the rms slope; 1e-4 is nearly a mirror)"))
        }
    }

    /// Reflectance at normal incidence.
    pub(crate) fn r0(&self, key: &'static str, value: f64) -> Result<(), ModelError> {
        let ok = (0.0..=1.0).contains(&value);
        if ok { Ok(()) } else { Err(self.error(key, value, "0…1 (reflectance at normal incidence)")) }
    }

    /// Weight of a part of Lafortune's dot product, from `low` to 1.
    pub(crate) fn stretch(&self, key: &'static str, value: f64, low: f64) -> Result<(), ModelError> {
        if (low..=1.0).contains(&value) {
            return Ok(());
        }
        let expected = if low < 0.0 { "-1…1 (-1 mirrors)" } else { "0…1" };
        Err(self.error(key, value, expected))
    }

    /// Standard deviation of slope angles in degrees.
    pub(crate) fn slope_deg(&self, key: &'static str, value: f64) -> Result<(), ModelError> {
        let ok = (0.0..=90.0).contains(&value);
        if ok { Ok(()) } else { Err(self.error(key, value, "0…90 degrees (0 is Lambert)")) }
    }

    /// Refractive index of a coat.
    pub(crate) fn index(&self, key: &'static str, value: f64) -> Result<(), ModelError> {
        if value.is_finite() && value > 1.0 {
            Ok(())
        } else {
            Err(self.error(
                key,
                value,
                "a finite number above 1 (1.5 for clear coats); leave \"coat\" out for none",
            ))
        }
    }
}

/// Beyond this a lobe is narrower than f64 directions can tell.
const MAX_EXPONENT: f64 = 1e9;
