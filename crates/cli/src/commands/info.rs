//! `gonio info`: what any file holds.

use std::path::Path;

use gonio_brdf::formats;
use gonio_instrument::{Description, Plan};
use serde_json::{Value, json};

use crate::outcome::{Failure, Outcome};
use crate::output::Printer;

/// First bytes of an MCAP file.
const MCAP: &[u8] = b"\x89MCAP";

/// Tells what a session, table, model, instrument description or plan holds.
///
/// # Errors
/// [`Failure::Usage`] for a file that cannot be read or is of no known kind.
pub fn run(file: &str, printer: Printer) -> Result<Outcome, Failure> {
    let path = Path::new(file);
    let beginning = beginning(path);
    let told = if beginning.starts_with(MCAP) {
        let info = gonio_recording::info(path).map_err(Failure::usage)?;
        serde_json::to_value(info)
    } else if path.extension().is_some_and(|e| e == "toml") {
        toml_file(path)?
    } else {
        let loaded = formats::open(path).map_err(Failure::usage)?;
        let mut summary = loaded.describe();
        if summary.format.is_none() {
            summary.format = formats::identify(path).ok();
        }
        serde_json::to_value(summary)
    }
    .map_err(|e| Failure::failed("the summary cannot be written", e))?;
    printer.result(&lines(&told, 0), &told);
    Ok(Outcome::Done)
}

fn beginning(path: &Path) -> Vec<u8> {
    use std::io::Read;
    let mut bytes = vec![0; 8];
    let read = std::fs::File::open(path).and_then(|mut f| f.read(&mut bytes)).unwrap_or(0);
    bytes.truncate(read);
    bytes
}

fn toml_file(path: &Path) -> Result<serde_json::Result<Value>, Failure> {
    let text = crate::output::read_text(path)?;
    if let Ok(d) = Description::from_toml(&text) {
        return Ok(Ok(json!({
            "content": "instrument", "name": d.name, "camera_size": d.camera.size,
            "poses": d.plan.poses().len(), "calibrated": d.calibration.is_some(),
        })));
    }
    match Plan::from_toml(&text) {
        Ok(p) => Ok(Ok(json!({
            "content": "plan", "poses": p.poses().len(), "tilt_deg": p.tilt_deg, "spin_deg": p.spin_deg,
        }))),
        Err(e) => Err(Failure::usage(format!(
            "{}: neither an instrument description nor a plan: {e}",
            path.display()
        ))),
    }
}

/// A JSON value as indented lines for people; empty parts are left out.
fn lines(value: &Value, depth: usize) -> String {
    let indent = "  ".repeat(depth);
    let Value::Object(map) = value else { return format!("{indent}{}\n", plain(value)) };
    map.iter()
        .filter(|(_, v)| !is_empty(v))
        .map(|(k, v)| match v {
            Value::Object(_) => format!("{indent}{}:\n{}", k.replace('_', " "), lines(v, depth + 1)),
            _ => format!("{indent}{}: {}\n", k.replace('_', " "), plain(v)),
        })
        .collect()
}

fn is_empty(v: &Value) -> bool {
    match v {
        Value::Null => true,
        Value::String(s) => s.is_empty(),
        Value::Array(a) => a.is_empty(),
        Value::Object(o) => o.is_empty(),
        _ => false,
    }
}

fn plain(v: &Value) -> String {
    match v {
        Value::String(s) => s.clone(),
        Value::Array(a) => a.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}
