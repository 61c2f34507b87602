//! `gonio calibrate radiometry`: what the camera's counts mean, from sessions of reference samples.

use std::path::{Path, PathBuf};

use gonio_acquisition::radiometry::chart::{self, Patch};
use gonio_acquisition::radiometry::{self, Calibrated, Input, RadiometryError, Settings};
use gonio_acquisition::reference;
use gonio_brdf::formats::{self, Loaded};
use gonio_instrument::radiometry::ColourCorrection;
use gonio_instrument::{Certificate, Description, ScanKind};
use gonio_optics::Geometry;
use gonio_recording::Session;
use serde::Deserialize;

use super::calibrate::{check_new, file_name};
use super::radiometry_report as told;
use crate::arguments::calibrate::RadiometryArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, beside, check_apart, read_text, write_whole};
use crate::{reduction, rig};

/// Pictures beside the output.
const PICTURES: [&str; 5] =
    ["photon-transfer.png", "linearity.png", "dark.png", "stray-light.png", "gloss.png"];

/// A session with what is read of it at once.
struct Opened {
    path: PathBuf,
    kind: ScanKind,
    certificate: Option<Certificate>,
    notes: Vec<String>,
    session: Session,
}

/// A chart file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChartFile {
    format: String,
    version: u32,
    /// Geometry at which patches are compared, degrees.
    #[serde(default = "forty_five")]
    theta_i_deg: f64,
    #[serde(default)]
    theta_o_deg: f64,
    #[serde(default = "ninety")]
    phi_deg: f64,
    #[serde(rename = "patch")]
    patches: Vec<PatchEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PatchEntry {
    name: String,
    lab: [f64; 3],
    table: PathBuf,
}

const fn forty_five() -> f64 {
    45.0
}

const fn ninety() -> f64 {
    90.0
}

/// `gonio calibrate radiometry`.
///
/// # Errors
/// [`Failure::Usage`] for sessions that cannot serve; [`Failure::Failed`] where what they show cannot be a camera's.
pub fn run(a: &RadiometryArguments, printer: Printer) -> Result<Outcome, Failure> {
    let inputs: Vec<&Path> = a.sessions.iter().map(PathBuf::as_path).collect();
    check_apart(&a.common.output, &inputs)?;
    check_new(&a.common.output)?;
    let pictures = PICTURES.map(|p| beside(&a.common.output, p));
    pictures.iter().try_for_each(|p| check_new(p))?;
    let (description, opened) = open(a)?;
    let colour = a.chart.as_deref().map(correction).transpose()?;
    let mut lost = Vec::new();
    for o in &opened {
        lost.extend(o.session.poses().filter_map(|p| p.err().map(|e| format!("{}: {e}", o.path.display()))));
    }
    let sessions: Vec<Input<'_>> = opened
        .iter()
        .map(|o| Input {
            name: file_name(&o.path),
            kind: o.kind,
            certificate: o.certificate.clone(),
            notes: o.notes.clone(),
            poses: Box::new(|| Box::new(o.session.poses().flatten())),
        })
        .collect();
    let mut c =
        radiometry::calibrate(&description, &sessions, &Settings { index: a.common.index }).map_err(|e| {
            match e {
                RadiometryError::NoGain { .. } => Failure::Failed(e.to_string()),
                _ => Failure::usage(e),
            }
        })?;
    let r = c.description.radiometry.get_or_insert_default();
    if colour.is_none() {
        r.notes.push(
            "colours are those of the camera's channels, not colorimetric: no chart was given".to_owned(),
        );
    }
    r.colour = colour;
    let drawn = told::pictures(&c);
    let text =
        c.description.to_toml().map_err(|e| Failure::failed("the description cannot be written", e))?;
    write_whole(&a.common.output, text.as_bytes())?;
    let mut written = Vec::new();
    for (path, picture) in pictures.iter().zip(drawn) {
        let Some(picture) = picture else { continue };
        write_whole(path, &picture.to_png().map_err(|e| Failure::failed("the picture cannot be made", e))?)?;
        written.push(path.clone());
    }
    finish(&c, a, &written, lost, printer)
}

fn finish(
    c: &Calibrated,
    a: &RadiometryArguments,
    pictures: &[PathBuf],
    mut lost: Vec<String>,
    printer: Printer,
) -> Result<Outcome, Failure> {
    let r = c.radiometry();
    printer.result(
        &told::words(&r, c, &a.common.output),
        &told::to_json(&r, c, &a.common.output, pictures, &lost),
    );
    if !r.good {
        lost.push("the calibration is marked as not good; its notes say why".to_owned());
    }
    if lost.is_empty() { Ok(Outcome::Done) } else { Ok(Outcome::WithLoss(lost.join("; "))) }
}

fn open(a: &RadiometryArguments) -> Result<(Description, Vec<Opened>), Failure> {
    let mut opened = Vec::new();
    let mut recorded: Option<(PathBuf, Description)> = None;
    for path in &a.sessions {
        let session = Session::open(path).map_err(Failure::usage)?;
        let told = |e: &dyn std::fmt::Display| Failure::usage(format!("{}: {e}", path.display()));
        let kind = session.sample().map_err(|e| told(&e))?.kind;
        if kind == ScanKind::Sample {
            return Err(told(
                &"a session of kind sample, expected flat, dark, white, black-glass, black-glass-wedge, black or trap",
            ));
        }
        let instrument = session.instrument().map_err(|e| told(&e))?;
        if let Some((first, d)) = &recorded
            && (d.name != instrument.name || d.camera != instrument.camera || d.mirror != instrument.mirror)
        {
            return Err(told(&format!(
                "was recorded on instrument \"{}\", {} on \"{}\"; give sessions of one instrument",
                instrument.name,
                first.display(),
                d.name
            )));
        }
        recorded.get_or_insert_with(|| (path.clone(), instrument.clone()));
        let certificate = session.certificate().map_err(|e| told(&e))?;
        let notes = match &certificate {
            Some(c) => {
                let day = reduction::day_of(&session);
                reference::validate(c, &instrument, &instrument, &day, a.accept_stale)
                    .map_err(|e| told(&e))?
            }
            None => Vec::new(),
        };
        opened.push(Opened { path: path.clone(), kind, certificate, notes, session });
    }
    let description = match (&a.common.instrument, recorded) {
        (Some(name), Some((path, d))) => {
            let named = rig::instrument(name)?;
            if named.camera.size != d.camera.size || named.camera.bits != d.camera.bits {
                return Err(Failure::usage(format!(
                    "{name} has a camera of {:?} pixels and {} bits, {} was recorded with {:?} and {}; name the instrument of the sessions",
                    named.camera.size,
                    named.camera.bits,
                    path.display(),
                    d.camera.size,
                    d.camera.bits
                )));
            }
            named
        }
        (None, Some((_, d))) => d,
        (_, None) => return Err(Failure::usage("no session was given")),
    };
    Ok((description, opened))
}

/// The colour correction of a chart file.
fn correction(path: &Path) -> Result<ColourCorrection, Failure> {
    let wrong = |e: &dyn std::fmt::Display| Failure::usage(format!("chart {}: {e}", path.display()));
    let file: ChartFile = toml::from_str(&read_text(path)?).map_err(|e| wrong(&e))?;
    if file.format != "gonio-chart" || file.version != 1 {
        return Err(wrong(&format!(
            "expected format = \"gonio-chart\" and version = 1, found \"{}\" and {}",
            file.format, file.version
        )));
    }
    let at = Geometry::from_degrees(file.theta_i_deg, file.theta_o_deg, file.phi_deg);
    let mut patches = Vec::new();
    for p in file.patches {
        let table = path.with_file_name("").join(&p.table);
        let Loaded::Table(m) = formats::open(&table).map_err(|e| wrong(&e))? else {
            return Err(wrong(&format!("patch {}: {} holds no measured table", p.name, table.display())));
        };
        if m.attributes.contains_key("colour_matrix") {
            return Err(wrong(&format!(
                "patch {}: {} went through a colour matrix already; replay it with an instrument without one",
                p.name,
                table.display()
            )));
        }
        let camera = m.interpolate(at).map(|f| std::f64::consts::PI * f);
        patches.push(Patch { name: p.name, lab: p.lab, camera });
    }
    chart::find(&patches, &file_name(path)).map_err(|e| wrong(&e))
}
