//! `gonio info`: what any file holds.

use std::path::Path;

use gonio_acquisition::budget;
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
    } else if let Some(stored) = crate::opening::paint(file)? {
        Ok(super::car_paint::describe(&stored.paint, &stored.notes))
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

/// `gonio info --budget`: the parts of a table's uncertainty.
///
/// # Errors
/// [`Failure::Usage`] for a file that is no measured table, or one that keeps no parts.
pub fn budget(file: &str, printer: Printer) -> Result<Outcome, Failure> {
    let path = Path::new(file);
    let formats::Loaded::Table(table) = formats::open(path).map_err(Failure::usage)? else {
        return Err(Failure::usage(format!(
            "{file} holds no measured table; give an .nc of `gonio scan --fit` or `gonio replay`"
        )));
    };
    let Some(s) = budget::summary(&table) else {
        return Err(Failure::usage(format!(
            "{file} keeps no parts of its uncertainty; compute it again from its session with `gonio replay`"
        )));
    };
    let attribute = |k: &str| table.attributes.get(k).cloned();
    let (factor, freedom) = (attribute("coverage_factor"), attribute("degrees_of_freedom"));
    let mut text =
        format!("relative standard uncertainty over {} measured values (r.m.s., median)\n", s.values);
    for l in &s.lines {
        text += &format!(
            "  {:<12} {:>8.3} % {:>8.3} %   {}\n",
            l.part,
            100.0 * l.relative_rms,
            100.0 * l.relative_median,
            l.sharing.words()
        );
    }
    for (name, value) in [("independent", s.independent), ("common", s.common), ("total", s.total)] {
        text += &format!("  {name:<12} {:>8.3} %\n", 100.0 * value);
    }
    text += &format!(
        "coverage factor {}, degrees of freedom {}\n",
        factor.as_deref().unwrap_or("1"),
        freedom.as_deref().unwrap_or("not told")
    );
    printer.result(
        &text,
        &json!({
            "content": "budget", "values": s.values, "independent": s.independent, "common": s.common, "total": s.total,
            "coverage_factor": factor, "degrees_of_freedom": freedom,
            "parts": s.lines.iter().map(|l| json!({
                "part": l.part, "relative_rms": l.relative_rms, "relative_median": l.relative_median,
                "common": l.sharing.is_common(), "sharing": l.sharing.words(),
            })).collect::<Vec<_>>(),
        }),
    );
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
            "calibration": d.calibration_record.as_ref().map(|r| json!({
                "version": r.version, "good": r.good, "sessions": r.sessions, "spots": r.spots, "edges": r.edges,
                "rejected": r.rejected, "spot_rms_px": r.spot_rms_px, "direction_deg": [r.theta_i_deg, r.theta_o_deg, r.light_view_deg], "aim_mm": r.aim_mm,
                "undetermined": r.undetermined,
            })),
            "radiometry": d.radiometry.as_ref().map(super::radiometry_report::summary),
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
