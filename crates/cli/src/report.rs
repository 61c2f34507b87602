//! What a measurement and its fit look like: the pictures, and the report that holds them.

use std::path::{Path, PathBuf};

use gonio_acquisition::budget;
use gonio_brdf::{Flag, Measured};
use gonio_fitter::{Fit, Spread};
use gonio_render::Report;
use gonio_render::plots::BudgetBars;
use gonio_render::report::{
    Block, ColourDifference, Estimate, Fact, Figure, Fit as StandardFit, KeyFigure, Notice, Parameter,
    Section, Weight, plus_minus, significant, standard_figures,
};

use crate::fitting;
use crate::outcome::Failure;

/// What a report tells of, beside table and fit. Every part may be empty.
#[derive(Default)]
pub struct Background {
    /// Title, usually the sample's name.
    pub title: String,
    /// Sample record and conditions.
    pub facts: Vec<Fact>,
    /// Further sections: poses, link, camera.
    pub sections: Vec<Section>,
    /// Sentences worth knowing.
    pub notices: Vec<Notice>,
}

/// Pictures and words for a table, a fit, or both.
#[must_use]
pub fn build(table: Option<&Measured>, fit: Option<&Fit>, background: Background) -> Report {
    let mut report = Report {
        title: if background.title.is_empty() { "Measurement".to_owned() } else { background.title },
        subtitle: "Bidirectional reflectance, f in 1/sr without the cosine; φ = 180° is the mirror side"
            .to_owned(),
        notices: background.notices,
        footer: format!("gonio {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    };
    if !background.facts.is_empty() {
        report.sections.push(Section {
            heading: "Sample and conditions".to_owned(),
            blocks: vec![Block::Facts(background.facts)],
            ..Section::default()
        });
    }
    if let Some(fit) = fit {
        report.key_figures = key_figures(fit);
        report.notices.extend(fit_notices(fit));
        report.sections.push(fit_section(fit));
    }
    if let Some(table) = table {
        report.notices.extend(table_notices(table));
        report.sections.push(pictures(table, fit));
    }
    report.sections.extend(background.sections);
    report
}

/// Writes `report.html` at `path` and every picture as PNG into `pictures`; returns the pictures' paths.
///
/// # Errors
/// [`Failure::Failed`] with path and reason.
pub fn save(report: &Report, path: &Path, pictures: Option<&Path>) -> Result<Vec<PathBuf>, Failure> {
    let html = report.to_html().map_err(|e| Failure::failed("the report cannot be made", e))?;
    crate::output::write_whole(path, html.as_bytes())?;
    match pictures {
        None => Ok(Vec::new()),
        Some(folder) => {
            std::fs::create_dir_all(folder)
                .map_err(|e| Failure::failed(&format!("folder {} cannot be made", folder.display()), e))?;
            report.save_pictures(folder).map_err(|e| Failure::failed("pictures cannot be written", e))
        }
    }
}

fn key_figures(fit: &Fit) -> Vec<KeyFigure> {
    let mut out = Vec::new();
    if let Some(p) = fit.parameter("exponent") {
        out.push(KeyFigure {
            label: "exponent n".to_owned(),
            value: plus_minus(p.value, p.sigma),
            note: "width of the lobe".to_owned(),
        });
    }
    if let Some(d) = fit.delta_e.beyond_15_deg {
        out.push(KeyFigure {
            label: "mean ΔE beyond 15° of the mirror direction".to_owned(),
            value: significant(d.mean, 2),
            note: format!("95 % below {}, at most {}", significant(d.p95, 2), significant(d.max, 2)),
        });
    }
    out.push(KeyFigure {
        label: "fit".to_owned(),
        value: fit.status.name().to_owned(),
        note: format!("{} cells, weights {}", fit.cells_used, fit.weights.name()),
    });
    out
}

fn fit_notices(fit: &Fit) -> Vec<Notice> {
    let weight = match fit.status.name() {
        "converged" => Weight::Note,
        "no-data" | "non-finite" => Weight::Failure,
        _ => Weight::Warning,
    };
    vec![Notice { weight, text: capitalised(&fitting::verdict(fit)) }]
}

fn capitalised(s: &str) -> String {
    let mut chars = s.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect::<String>() + ".")
}

fn table_notices(table: &Measured) -> Vec<Notice> {
    let share = |flag: Flag| {
        table.flag.iter().filter(|f| **f == flag).count() as f64 / table.flag.len().max(1) as f64 * 100.0
    };
    let mut out = Vec::new();
    let (filled, beyond, invalid) = (share(Flag::Filled), share(Flag::Extrapolated), share(Flag::Invalid));
    if filled + beyond > 0.0 {
        out.push(Notice {
            weight: Weight::Note,
            text: format!(
                "{filled:.1} % of the cells were filled where the instrument cannot see, {beyond:.1} % extrapolated beyond its \
                 limit; they are flagged and take no part in the fit."
            ),
        });
    }
    if invalid > 0.0 {
        out.push(Notice {
            weight: Weight::Warning,
            text: format!("{} % of the cells have no value.", significant(invalid, 2)),
        });
    }
    if !table.attributes.get("reference_notes").is_none_or(String::is_empty) {
        out.push(Notice {
            weight: Weight::Warning,
            text: format!("Reference: {}.", table.attributes["reference_notes"]),
        });
    }
    out
}

fn fit_section(fit: &Fit) -> Section {
    let parameters: Vec<Parameter> = fitting::grouped(fit)
        .into_iter()
        .map(|(name, values)| Parameter {
            name: match name.as_str() {
                "diffuse" => "diffuse, cd".to_owned(),
                "specular" => "specular, cs".to_owned(),
                "exponent" => "exponent, n".to_owned(),
                other => other.to_owned(),
            },
            estimates: values.iter().map(|p| Estimate { value: p.value, sigma: p.sigma }).collect(),
            unit: String::new(),
        })
        .collect();
    let differences: Vec<(String, ColourDifference)> = [
        ("within 15° of the mirror direction", fit.delta_e.within_15_deg),
        ("beyond 15°", fit.delta_e.beyond_15_deg),
        ("all", fit.delta_e.all),
    ]
    .into_iter()
    .filter_map(|(name, d)| d.map(|d| (name.to_owned(), colour_difference(d))))
    .collect();
    Section {
        heading: format!("Fit: {}", fitting::model_name(fit)),
        intro: "No starting value was chosen: the exponent was searched over its whole range, the colours solved for.".to_owned(),
        blocks: vec![
            Block::parameters(&parameters),
            Block::colour_differences(&differences),
            Block::Facts(vec![
                Fact::new("status", fit.status.name()),
                Fact::new("error, weighted", significant(fit.weighted_error, 4)),
                Fact::new("error, root mean square (1/sr)", significant(fit.unweighted_error, 4)),
                Fact::new("condition number", significant(fit.condition, 3)),
                Fact::new("cells used / left out", format!("{} / {}", fit.cells_used, fit.cells_left_out)),
            ]),
        ],
    }
}

fn colour_difference(d: Spread) -> ColourDifference {
    ColourDifference { mean: d.mean, p95: d.p95, max: d.max, cells: d.cells }
}

fn pictures(table: &Measured, fit: Option<&Fit>) -> Section {
    let budget = table.attributes.get("uncertainty_budget_relative_rms");
    let file = fit.map(Fit::to_model_file);
    let name = fit.map(fitting::model_name).unwrap_or_default();
    let fit = file.as_ref().map(|f| StandardFit { name: &name, brdf: f, coat: f.coat });
    Section {
        heading: "What was measured".to_owned(),
        intro: budget
            .map(|b| {
                format!("Parts of the uncertainty, relative, root mean square over measured cells: {b}.")
            })
            .unwrap_or_default(),
        blocks: vec![Block::Pictures(
            standard_figures(table, fit).into_iter().chain(budget_bars(table)).collect(),
        )],
    }
}

/// The parts of σ as bars, for tables that keep them.
fn budget_bars(table: &Measured) -> Option<Figure> {
    let s = budget::summary(table).filter(|s| s.values > 0)?;
    let bars = BudgetBars {
        title: "Where the uncertainty comes from".to_owned(),
        parts: s
            .lines
            .iter()
            .map(|l| (l.part.clone(), 100.0 * l.relative_rms, l.sharing.is_common()))
            .collect(),
        total: 100.0 * s.total,
    };
    let largest = s.lines.first().map(|l| l.part.clone()).unwrap_or_default();
    Some(Figure {
        name: "budget".to_owned(),
        picture: bars.draw(),
        caption: "Relative standard uncertainty, root mean square over the measured cells, part by part"
            .to_owned(),
        alt: format!("Bars of the parts of the uncertainty; the largest is {largest}"),
    })
}
