//! Whether a sample looks the same when it is turned, and its table over four angles where it does not.

use gonio_acquisition::{Grain, Reducer};
use gonio_brdf::formats::{self, netcdf};
use serde_json::{Value, json};

use crate::outcome::Failure;
use crate::output::shown;
use crate::results::Files;

/// What turning the sample showed, in a line; empty where nothing was seen.
#[must_use]
pub fn line(reducer: &Reducer) -> String {
    reducer.isotropy().map(|i| format!("isotropy: {}", i.sentence())).unwrap_or_default()
}

/// The same for programs: null where nothing was seen.
#[must_use]
pub fn to_json(reducer: &Reducer, files: &Files) -> Value {
    let Some(i) = reducer.isotropy() else { return Value::Null };
    let table = (i.verdict == Grain::Anisotropic).then(|| shown(&files.azimuths));
    json!({
        "verdict": i.verdict.name(), "sentence": i.sentence(), "spins": i.spins, "variation": i.variation, "noise": i.noise,
        "smooth": i.smooth, "smooth_by_chance": i.smooth_by_chance, "table": table,
    })
}

/// Writes the table over four angles of a sample that looks different when turned; of others none.
///
/// # Errors
/// [`Failure::Failed`] with path and reason.
pub fn write_table(reducer: &Reducer, files: &Files) -> Result<(), Failure> {
    if reducer.isotropy().is_none_or(|i| i.verdict != Grain::Anisotropic) {
        return Ok(());
    }
    let bytes = netcdf::write_anisotropic(&reducer.azimuth_table())
        .map_err(|e| Failure::Failed(format!("{}: {e}", files.azimuths.display())))?;
    formats::write_file(&files.azimuths, &bytes, true).map_err(|e| Failure::Failed(e.to_string()))
}
