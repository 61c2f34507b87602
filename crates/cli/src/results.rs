//! What stands beside a session: table, model, report and pictures, after each capture and at the end.

use std::path::{Path, PathBuf};

use gonio_acquisition::closure::Check;
use gonio_acquisition::{PoseStatistics, Reducer};
use gonio_brdf::Measured;
use gonio_brdf::formats::{self, Loaded, Target};
use gonio_fitter::Fit;
use gonio_instrument::{LinkStatistics, SampleRecord};
use gonio_render::report::{Block, Fact, Section, significant};
use serde_json::{Value, json};

use crate::fitting::{self, Subject};
use crate::outcome::Failure;
use crate::output::{beside, check_free, shown, write_whole};
use crate::report::{self, Background};

/// The files that belong to a session.
#[derive(Clone, Debug)]
pub struct Files {
    /// Table.
    pub table: PathBuf,
    /// Table over four angles, of a sample that looks different when turned.
    pub azimuths: PathBuf,
    /// Model.
    pub model: PathBuf,
    /// Report.
    pub report: PathBuf,
    /// Pictures.
    pub pictures: PathBuf,
}

impl Files {
    /// Beside `S.mcap` or `S.nc`.
    #[must_use]
    pub fn beside(path: &Path) -> Self {
        Self {
            table: beside(path, "nc"),
            azimuths: beside(path, "azimuths.nc"),
            model: beside(path, "model.json"),
            report: beside(path, "report.html"),
            pictures: beside(path, "pictures"),
        }
    }

    /// Refuses to begin where one of them stands in the way.
    ///
    /// # Errors
    /// [`Failure::Usage`] naming it.
    pub fn check_free(&self, force: bool) -> Result<(), Failure> {
        for p in [&self.table, &self.azimuths, &self.model, &self.report] {
            check_free(p, force)?;
        }
        if self.pictures.exists() && !force {
            return Err(Failure::usage(format!(
                "{} exists; say --force to replace it",
                self.pictures.display()
            )));
        }
        Ok(())
    }

    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "table": shown(&self.table), "model": shown(&self.model), "report": shown(&self.report),
            "pictures": shown(&self.pictures),
        })
    }
}

/// Writes a table.
///
/// # Errors
/// [`Failure::Failed`] with path and reason.
pub fn write_table(path: &Path, table: &Measured) -> Result<(), Failure> {
    let content = Loaded::Table(Box::new(table.clone()));
    formats::save(path, &content, Target::Netcdf, true)
        .map(|_| ())
        .map_err(|e| Failure::Failed(e.to_string()))
}

/// Writes a fitted model.
///
/// # Errors
/// [`Failure::Failed`] with path and reason.
pub fn write_model(path: &Path, fit: &Fit) -> Result<(), Failure> {
    let text =
        fit.to_model_file().to_json().map_err(|e| Failure::failed("the model cannot be written", e))?;
    write_whole(path, text.as_bytes())
}

/// Fits a table by inverse variance, the way a scan does: the base under its coat, where one was separated.
///
/// # Errors
/// [`Failure::Usage`] for an unknown model.
pub fn fit(table: &Measured, model: &str) -> Result<Fit, Failure> {
    let subject = Subject::of_table(table.clone());
    let plain = fitting::options(model, None, 75.0, subject.has_sigma)?;
    let options = gonio_fitter::Options { coat: subject.coat(), ..plain };
    Ok(gonio_fitter::fit(&subject.observations, &options))
}

/// What a scan or a replay tells beside its table.
pub struct Story<'a> {
    /// Who and what.
    pub sample: &'a SampleRecord,
    /// Name of the instrument.
    pub instrument: &'a str,
    /// What each pose gave.
    pub poses: &'a [PoseStatistics],
    /// How the link has been doing, for a live scan.
    pub link: Option<LinkStatistics>,
    /// Stage and camera in words.
    pub devices: Vec<Fact>,
    /// What was found of a clear coat.
    pub coat: Option<Section>,
    /// Closure checks.
    pub closure: &'a [Check],
    /// Poses that are missing, in words.
    pub lost: &'a [String],
}

/// Writes table, model, report and pictures.
///
/// # Errors
/// [`Failure::Failed`] with path and reason.
pub fn write_all(files: &Files, table: &Measured, fit: &Fit, story: &Story<'_>) -> Result<(), Failure> {
    write_table(&files.table, table)?;
    write_model(&files.model, fit)?;
    let report = report::build(Some(table), Some(fit), background(story, table));
    report::save(&report, &files.report, Some(&files.pictures)).map(|_| ())
}

/// Writes what is known after a capture: table, model, and a report without pictures.
///
/// # Errors
/// [`Failure::Failed`] with path and reason.
pub fn write_so_far(
    files: &Files,
    reducer: &Reducer,
    model: &str,
    sample: &SampleRecord,
) -> Result<Fit, Failure> {
    let table = reducer.snapshot();
    let fit = fit(&table, model)?;
    write_table(&files.table, &table)?;
    write_model(&files.model, &fit)?;
    let story = Story {
        sample,
        instrument: "",
        poses: reducer.statistics(),
        link: None,
        devices: Vec::new(),
        coat: None,
        closure: &[],
        lost: &["the scan is still running".to_owned()],
    };
    let report = report::build(None, Some(&fit), background(&story, &table));
    report::save(&report, &files.report, None)?;
    Ok(fit)
}

fn background(story: &Story<'_>, table: &Measured) -> Background {
    let s = story.sample;
    let title = [s.name.as_str(), s.id.as_str()].into_iter().find(|t| !t.is_empty()).unwrap_or("Measurement");
    let facts = [
        ("sample", s.id.as_str()),
        ("name", &s.name),
        ("batch", &s.batch),
        ("operator", &s.operator),
        ("note", &s.note),
        ("instrument", story.instrument),
    ];
    let mut facts: Vec<Fact> =
        facts.into_iter().filter(|(_, v)| !v.is_empty()).map(|(k, v)| Fact::new(k, v)).collect();
    for (key, name) in [
        ("reference_serial", "white reference"),
        ("common_relative_uncertainty", "uncertainty common to all cells"),
        ("measured_cells", "cells measured"),
        ("hot_pixels", "hot pixels left out"),
    ] {
        if let Some(v) = table.attributes.get(key) {
            facts.push(Fact::new(name, v.clone()));
        }
    }
    facts.extend(story.devices.iter().cloned());
    let mut sections: Vec<Section> = story.coat.iter().cloned().collect();
    sections.extend(crate::closure::section(story.closure));
    if !story.poses.is_empty() {
        sections.push(pose_section(story.poses));
    }
    if let Some(link) = story.link {
        sections.push(link_section(&link));
    }
    let mut notices = crate::closure::notices(story.closure);
    notices.push(crate::colours::notice(&table.attributes));
    notices.extend(story.lost.iter().map(|l| gonio_render::report::Notice {
        weight: gonio_render::report::Weight::Warning,
        text: l.clone(),
    }));
    Background { title: title.to_owned(), facts, sections, notices }
}

fn pose_section(poses: &[PoseStatistics]) -> Section {
    let rows = poses
        .iter()
        .map(|p| {
            vec![
                format!("{:.1}°", p.theta_i_deg),
                format!("{:.1}°", p.spin_deg),
                p.exposures.to_string(),
                format!(
                    "{} – {}",
                    significant(p.exposure_s[0] * 1e3, 3),
                    significant(p.exposure_s[1] * 1e3, 3)
                ),
                format!("{:.1} %", 100.0 * p.coverage),
                format!("{:.2} %", 100.0 * p.saturated_share),
                format!("{} %", significant(100.0 * p.relative_sigma, 2)),
                format!("{:.4}", p.lamp_monitor),
            ]
        })
        .collect();
    Section {
        heading: "Poses and camera".to_owned(),
        blocks: vec![Block::Table {
            caption: "What each pose gave; noise is the median of σ/f of shot, read and dark noise in green"
                .to_owned(),
            head: ["θi", "spin", "exposures", "exposure (ms)", "coverage", "saturated", "noise", "lamp"]
                .map(str::to_owned)
                .to_vec(),
            rows,
        }],
        ..Section::default()
    }
}

fn link_section(l: &LinkStatistics) -> Section {
    Section {
        heading: "Link to the stage".to_owned(),
        blocks: vec![Block::Facts(vec![
            Fact::new("frames sent / received", format!("{} / {}", l.sent, l.received)),
            Fact::new("sent again", l.retransmitted.to_string()),
            Fact::new("corrupted", l.corrupted.to_string()),
            Fact::new("received twice", l.duplicates.to_string()),
            Fact::new("round trip", format!("{:.2} ms", l.round_trip.as_secs_f64() * 1e3)),
        ])],
        ..Section::default()
    }
}

/// The fit as one line.
#[must_use]
pub fn fit_line(fit: &Fit) -> String {
    match fit.parameter("exponent") {
        Some(n) => format!("{}: n = {}, {}", fit.model.name(), significant(n.value, 4), fit.status.name()),
        None => format!("{}: {}", fit.model.name(), fit.status.name()),
    }
}
