//! What was recorded in the guest is evaluated here: the paint found must be the paint that lay on the holder.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::files;

/// Name of the check in the verdict.
pub const NAME: &str = "paint-recovered";
/// The scans that it needs.
pub const NEEDS: [&str; 2] = ["scan-usb-white", "scan-usb-sample"];
/// Largest relative difference of a parameter.
const TOLERANCE: f64 = 0.02;

/// Evaluates the scans in `folder` with the program and compares the fit with `truth`, a model.json. Gives the largest relative difference.
///
/// # Errors
/// What is wrong, in words.
pub fn evaluate(gonio: &Path, folder: &Path, truth: &[u8]) -> Result<f64, String> {
    let truth: Value = serde_json::from_slice(truth).map_err(|e| format!("the truth: {e}"))?;
    let model = truth.get("model").and_then(Value::as_str).ok_or("the truth names no model")?;
    let table = folder.join("usb-sample.nc");
    let output = Command::new(gonio)
        .arg("replay")
        .arg(folder.join(files::SAMPLE))
        .arg("--reference")
        .arg(folder.join(files::WHITE))
        .arg("-o")
        .arg(&table)
        .arg(format!("--fit={model}"))
        .output()
        .map_err(|e| format!("{}: {e}", gonio.display()))?;
    if !output.status.success() {
        return Err(format!(
            "gonio replay ended with {}: {}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        ));
    }
    let path = table.with_extension("model.json");
    let found = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let found: Value = serde_json::from_slice(&found).map_err(|e| format!("{}: {e}", path.display()))?;
    let off = largest_difference(&found, &truth)?;
    if off > TOLERANCE {
        return Err(format!(
            "a parameter of the fit is off by {:.1} %: found {found}, put on the holder {truth}",
            100.0 * off
        ));
    }
    Ok(off)
}

/// Over all numbers of the truth.
fn largest_difference(found: &Value, truth: &Value) -> Result<f64, String> {
    let keys = truth.as_object().ok_or("the truth is no object")?;
    let mut largest: f64 = 0.0;
    let mut compared = 0;
    for (key, value) in keys {
        let (expected, got) = (numbers(value), found.get(key).map(numbers).unwrap_or_default());
        if expected.len() != got.len() {
            return Err(format!("the fit has {} numbers of {key}, the truth {}", got.len(), expected.len()));
        }
        compared += expected.len();
        largest = expected.iter().zip(&got).map(|(e, g)| ((g - e) / e).abs()).fold(largest, f64::max);
    }
    if compared == 0 {
        return Err("the truth has no numbers".to_owned());
    }
    Ok(largest)
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().filter_map(Value::as_f64).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_largest_difference_is_found_and_a_missing_number_told() {
        let truth = json!({"model": "m", "diffuse": [0.1, 0.2], "exponent": 100.0});
        let off =
            largest_difference(&json!({"model": "m", "diffuse": [0.1, 0.21], "exponent": 101.0}), &truth);
        assert!((off.expect("comparable") - 0.05).abs() < 1e-12);
        assert!(largest_difference(&json!({"diffuse": [0.1, 0.2]}), &truth).is_err());
    }
}
