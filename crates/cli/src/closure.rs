//! Closure checks of a reduction: computed, as a section of the report, as JSON.

use std::path::PathBuf;

use gonio_acquisition::Reducer;
use gonio_acquisition::closure::{self, Check, Verdict};
use gonio_acquisition::coat::Gloss;
use gonio_acquisition::radiometry::gloss_scale;
use gonio_brdf::Measured;
use gonio_instrument::ScanKind;
use gonio_recording::Session;
use gonio_render::report::{Block, Notice, Section, Weight, significant};
use serde_json::{Value, json};

use crate::outcome::Failure;
use crate::reduction::{self, Calibrated};

/// Refractive index of black glass where the instrument's calibration names no other.
const BLACK_GLASS_INDEX: f64 = 1.567;

/// All checks of a table; `again` holds those of the sample put on the holder anew.
#[must_use]
pub fn checks(
    table: &Measured,
    reducer: &Reducer,
    calibrated: &Calibrated,
    again: &[Measured],
) -> Vec<Check> {
    let white = reducer.white();
    let lamp = reducer.lamp();
    let d = calibrated.map.description();
    let common = white.common_relative(d, lamp);
    let index = d.radiometry.as_ref().and_then(|r| r.gloss.as_ref()).map_or(BLACK_GLASS_INDEX, |g| g.index);
    let tables: Vec<&Measured> = std::iter::once(table).chain(again).collect();
    vec![
        closure::reciprocity(table),
        closure::white_cosine(white, reducer.angle_uncertainty(), lamp),
        closure::black_glass(&black_glass(calibrated), index, common),
        closure::first_pose(reducer.repeated(), lamp.sigma),
        closure::remounting(&tables),
    ]
}

/// What sessions of black glass among the references show; one that cannot be read shows nothing.
fn black_glass(calibrated: &Calibrated) -> Vec<Gloss> {
    let mut out = Vec::new();
    for path in &calibrated.others {
        let Ok(session) = Session::open(path) else { continue };
        if !session.sample().is_ok_and(|s| s.kind == ScanKind::BlackGlass) {
            continue;
        }
        match gloss_scale::glosses(&mut session.poses().flatten(), &calibrated.map, &calibrated.white) {
            Ok(found) => out.extend(found),
            Err(e) => tracing::warn!("{}: {e}", path.display()),
        }
    }
    out
}

/// Tables of further sessions of the same sample.
///
/// # Errors
/// As [`reduction::reduce`].
pub fn remounted(
    sessions: &[PathBuf],
    calibrated: &Calibrated,
    options: &gonio_acquisition::Options,
) -> Result<Vec<Measured>, Failure> {
    sessions
        .iter()
        .map(|path| {
            let session = Session::open(path).map_err(Failure::usage)?;
            Ok(reduction::reduce(&session, calibrated, options, |_, _| {})?.table)
        })
        .collect()
}

/// For programs.
#[must_use]
pub fn to_json(checks: &[Check]) -> Value {
    checks
        .iter()
        .map(|c| {
            json!({
                "name": c.name, "value": c.value, "expected": c.expected, "verdict": c.verdict.name(), "words": c.words,
            })
        })
        .collect()
}

/// For people, a line for each check that could be made.
#[must_use]
pub fn lines(checks: &[Check]) -> String {
    checks
        .iter()
        .filter(|c| c.verdict != Verdict::NotChecked)
        .map(|c| {
            format!(
                "closure, {}: {} % where {} % is expected: {}\n",
                c.name.replace('-', " "),
                percent(c.value),
                percent(c.expected),
                c.verdict.name()
            )
        })
        .collect()
}

fn percent(v: Option<f64>) -> String {
    v.map_or_else(String::new, |v| significant(100.0 * v, 2))
}

/// The section of the report.
#[must_use]
pub fn section(checks: &[Check]) -> Option<Section> {
    if checks.is_empty() {
        return None;
    }
    let rows = checks
        .iter()
        .map(|c| {
            vec![
                c.name.replace('-', " "),
                percent(c.value),
                percent(c.expected),
                c.verdict.name().replace('-', " "),
                c.words.clone(),
            ]
        })
        .collect();
    Some(Section {
        heading: "Closure checks".to_owned(),
        intro: "Laws that a measurement keeps whatever was measured. A check departs where it is off by more than its stated uncertainty explains."
            .to_owned(),
        blocks: vec![Block::Table {
            caption: "Found, and expected by the standard uncertainty (k = 1), in %".to_owned(),
            head: ["check", "found", "expected", "verdict", "what was compared"].map(str::to_owned).to_vec(),
            rows,
        }],
    })
}

/// Warnings for the head of the report.
#[must_use]
pub fn notices(checks: &[Check]) -> Vec<Notice> {
    checks
        .iter()
        .filter(|c| c.verdict == Verdict::Departs)
        .map(|c| Notice {
            weight: Weight::Warning,
            text: format!(
                "Closure check {} departs: {} % where its uncertainty lets expect {} %: {}.",
                c.name.replace('-', " "),
                percent(c.value),
                percent(c.expected),
                c.words
            ),
        })
        .collect()
}
