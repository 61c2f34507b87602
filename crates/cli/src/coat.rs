//! The clear coat as the command line asks for it and tells of it.

use std::collections::BTreeMap;

use gonio_acquisition::{ClearCoat, Options, Reducer, Verdict};
use gonio_brdf::Measured;
use gonio_optics::{Angle, fresnel};
use gonio_render::plots::{Chart, ChartPoint};
use gonio_render::report::{Block, Fact, Figure, Section, plus_minus, significant};
use serde_json::{Value, json};

use crate::arguments::{ClearCoatName, CoatArguments};
use crate::outcome::Failure;
use crate::results::Files;
use crate::{colours, isotropy};

const KIND: &str = "clear_coat";
const INDEX: &str = "coat_index";

impl ClearCoatName {
    const ALL: [(&'static str, Self, ClearCoat); 4] = [
        ("none", Self::None, ClearCoat::None),
        ("auto", Self::Auto, ClearCoat::Auto),
        ("single-pass", Self::SinglePass, ClearCoat::SinglePass),
        ("two-way", Self::TwoWay, ClearCoat::TwoWay),
    ];
}

/// Keeps what was asked for in the session, so that a replay does the same.
pub fn record(asked: &CoatArguments, provenance: &mut BTreeMap<String, String>) {
    if let Some((name, ..)) = ClearCoatName::ALL.iter().find(|a| Some(a.1) == asked.clear_coat) {
        provenance.insert(KIND.to_owned(), (*name).to_owned());
    }
    if let Some(index) = asked.coat_index {
        provenance.insert(INDEX.to_owned(), index.to_string());
    }
}

/// Settings of the reduction: what is asked for, else what the session recorded, else `auto`.
///
/// # Errors
/// [`Failure::Usage`] for an index that is none, or one given where nothing shall be separated.
pub fn options(
    asked: &CoatArguments,
    recorded: Option<&BTreeMap<String, String>>,
) -> Result<Options, Failure> {
    let earlier = |key: &str| recorded.and_then(|r| r.get(key));
    let clear_coat = match asked.clear_coat {
        Some(name) => ClearCoatName::ALL.iter().find(|a| a.1 == name).map(|a| a.2),
        None => earlier(KIND).and_then(|was| ClearCoatName::ALL.iter().find(|a| a.0 == was)).map(|a| a.2),
    }
    .unwrap_or_default();
    // an index that the scan was told goes with what the scan was told to do
    let coat_index = asked.coat_index.or_else(|| match asked.clear_coat {
        Some(_) => None,
        None => earlier(INDEX).and_then(|was| was.parse().ok()),
    });
    if clear_coat == ClearCoat::None && coat_index.is_some() {
        return Err(Failure::usage(
            "--coat-index goes with a coat that is separated; leave --clear-coat none out",
        ));
    }
    let options = Options { clear_coat, coat_index, ..Options::default() };
    options.check().map_err(Failure::usage)?;
    Ok(options)
}

/// Refuses to write a table without a base where one was asked for by name.
///
/// # Errors
/// [`Failure::Failed`]: what the poses show instead, and what would help.
pub fn insist(asked: &CoatArguments, reducer: &Reducer) -> Result<(), Failure> {
    match (asked.clear_coat, reducer.coat()) {
        (Some(ClearCoatName::SinglePass | ClearCoatName::TwoWay), Verdict::None(why)) => {
            Err(Failure::Failed(format!(
                "no clear coat was found: {why}; name its index with --coat-index, or say --clear-coat auto"
            )))
        }
        _ => Ok(()),
    }
}

/// What was found, for people and for programs.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// One line.
    pub line: String,
    /// As JSON.
    pub json: Value,
    /// What turning the sample showed, as JSON.
    pub isotropy: Value,
    /// What its colours are, as JSON.
    pub colours: Value,
}

impl Told {
    /// What the poses of a reducer say.
    #[must_use]
    pub fn of(reducer: &Reducer, table: &Measured, files: &Files) -> Self {
        let colours = colours::line(&table.attributes);
        Self {
            line: format!("{}\n{}\n{colours}", line(reducer), isotropy::line(reducer)),
            json: to_json(reducer),
            isotropy: isotropy::to_json(reducer, files),
            colours: colours::to_json(&table.attributes),
        }
    }
}

/// As JSON: `separated`, and what was found or why nothing was.
#[must_use]
pub fn to_json(reducer: &Reducer) -> Value {
    match reducer.coat() {
        Verdict::Coat(fit) => json!({
            "separated": true, "index": fit.index, "index_sigma": fit.index_sigma, "r0": fit.r0(),
            "gloss_ratio": fit.ratio, "misfit": fit.misfit, "poses": fit.poses,
        }),
        Verdict::None(why) => json!({ "separated": false, "why": why }),
    }
}

/// In one line.
#[must_use]
pub fn line(reducer: &Reducer) -> String {
    match reducer.coat() {
        Verdict::Coat(fit) if fit.poses > 0 => format!(
            "clear coat of index {}, from the gloss of {} poses ({:.1} % of Fresnel's)",
            plus_minus(fit.index, (fit.index_sigma > 0.0).then_some(fit.index_sigma)),
            fit.poses,
            100.0 * fit.ratio
        ),
        Verdict::Coat(fit) => format!("clear coat of index {} as given", fit.index),
        Verdict::None(why) => format!("no clear coat separated: {why}"),
    }
}

/// The section of a report; `None` where no coat was looked for.
#[must_use]
pub fn section(reducer: &Reducer) -> Option<Section> {
    if reducer.gloss().is_empty() {
        return None;
    }
    let verdict = reducer.coat();
    let mut facts = vec![Fact::new("verdict", line(reducer))];
    if let Verdict::Coat(fit) = &verdict {
        facts.push(Fact::new("reflectance at normal incidence, R0", significant(fit.r0(), 4)));
        facts.push(Fact::new(
            "departure from Fresnel's curve",
            format!("{} %", significant(100.0 * fit.misfit, 2)),
        ));
    }
    let rows = reducer
        .gloss()
        .iter()
        .map(|g| {
            let expected = match &verdict {
                Verdict::Coat(fit) => significant(fresnel::dielectric(g.theta_i.cos(), fit.index), 4),
                Verdict::None(_) => "–".to_owned(),
            };
            vec![
                format!("{:.1}°", g.theta_i.degrees()),
                g.reflectance.map_or_else(
                    || if g.saturated > 0 { "saturated" } else { "not seen whole" }.to_owned(),
                    |f| plus_minus(f, Some(g.sigma)),
                ),
                expected,
                format!("{:+.3}°, {:+.3}°", g.offset[0].degrees(), g.offset[1].degrees()),
            ]
        })
        .collect();
    Some(Section {
        heading: "Clear coat".to_owned(),
        intro: "What stands above the base at the mirror direction, as a reflectance; its place is told in and across the plane of \
                incidence, beside where the calibration expects it. No inter-reflection inside the coat is modelled, so π f of the \
                base may exceed 1."
            .to_owned(),
        blocks: vec![
            Block::Facts(facts),
            Block::Pictures(vec![picture(reducer, &verdict)]),
            Block::Table {
                caption: "Gloss of each pose".to_owned(),
                head: ["θi", "reflectance", "Fresnel", "place"].map(str::to_owned).to_vec(),
                rows,
            },
        ],
    })
}

/// The gloss of all poses against Fresnel's curve.
fn picture(reducer: &Reducer, verdict: &Verdict) -> Figure {
    let points = reducer.gloss().iter().filter_map(|g| {
        let at = (g.theta_i.degrees(), g.reflectance?);
        Some(ChartPoint { name: String::new(), at, chosen: true })
    });
    let curve = |index: f64| -> Vec<(f64, f64)> {
        (0..=170)
            .map(|k| Angle::from_degrees(f64::from(k) * 0.5))
            .map(|t| (t.degrees(), fresnel::dielectric(t.cos(), index)))
            .collect()
    };
    let lines = match verdict {
        Verdict::Coat(fit) => vec![(format!("Fresnel, n = {:.4}", fit.index), curve(fit.index))],
        Verdict::None(_) => Vec::new(),
    };
    let chart = Chart {
        title: "Gloss at the mirror direction".to_owned(),
        x_label: "angle of incidence θi (degrees)".to_owned(),
        y_label: "reflectance".to_owned(),
        logarithmic: [false, true],
        lines,
        points: points.collect(),
        bound: None,
    };
    Figure {
        name: "gloss".to_owned(),
        picture: chart.draw(),
        caption: "What stands above the base at the mirror direction at each pose, and Fresnel's curve of the index found".to_owned(),
        alt: "Reflectance over the angle of incidence: points of the poses along a curve".to_owned(),
    }
}
