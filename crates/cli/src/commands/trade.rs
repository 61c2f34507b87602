//! `gonio trade`: cost, size and colour difference of every representation, as a table, JSON, CSV, a picture and a report.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use gonio_brdf::formats::geometry_csv;
use gonio_optics::isoline::Method;
use gonio_render::Report;
use gonio_render::plots::pareto::size_in_words;
use gonio_render::plots::{Pareto, ParetoPoint};
use gonio_render::report::{Block, Fact, Figure, KeyFigure, Notice, Section, Weight, significant};
use gonio_tailor::{
    Candidate, ColourSpread, GeometrySet, Material, Options, Representation, Trade, TradeOptions, trade,
};
use serde_json::{Value, json};

use super::colormap::Drawn;
use crate::arguments::effect::TradeArguments;
use crate::effect;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};
use crate::{report, scenes};

/// Files in the folder, beside the pictures.
const FILES: [&str; 3] = ["trade.json", "trade.csv", "report.html"];

/// Compares, prints, writes the folder where asked.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or judged.
pub fn run(a: &TradeArguments, printer: Printer) -> Result<Outcome, Failure> {
    if a.scene.is_some() && a.geometries.is_some() {
        return Err(Failure::usage("--scene and --geometries both say what is judged: give one of them"));
    }
    if let Some(folder) = &a.output {
        check_folder(folder, &FILES, a.force)?;
    }
    let material = effect::material(&a.input)?;
    let seen = match &a.scene {
        Some(path) => {
            let (name, found) =
                scenes::gathered(scenes::open(path)?, 128, 4, scenes::sharpness(material.brdf()))?;
            Some((name, found.geometries()))
        }
        None => None,
    };
    let options = TradeOptions {
        build: effect::options(&a.map, &material)?,
        candidates: candidates(&a.only)?,
        geometries: match (&a.geometries, &seen) {
            (Some(path), _) => GeometrySet::List(geometry_csv::open_weighted(path).map_err(Failure::usage)?),
            (None, Some((_, list))) => GeometrySet::List(list.clone()),
            (None, None) => GeometrySet::All,
        },
    };
    let mut result = trade(&material, &options).map_err(|e| Failure::usage(format!("{}: {e}", a.input)))?;
    if let Some((name, _)) = &seen {
        result.judged = format!("local geometries of {name}, by their share in its pictures");
    }
    effect::say(&result.findings);
    let mut told = to_json(a, &result);
    let mut text = table(&result);
    if let Some(folder) = &a.output {
        let files = write(folder, a, &material, &options.build, &result, &told)?;
        let _ = write!(text, "\n{} and {} more files", folder.join(FILES[2]).display(), files.len() - 1);
        told["files"] = files.iter().map(|p| shown(p)).collect();
    }
    printer.result(&text, &told);
    Ok(Outcome::Done)
}

/// Refuses a folder that is a file or holds one of `files`.
///
/// # Errors
/// [`Failure::Usage`] naming it.
pub fn check_folder(folder: &Path, files: &[&str], force: bool) -> Result<(), Failure> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::usage(format!("{} is a file, expected the name of a folder", folder.display())));
    }
    match files.iter().map(|f| folder.join(f)).find(|p| p.exists()) {
        Some(there) if !force => Err(Failure::usage(format!(
            "{} exists and is not overwritten; choose another folder or say --force",
            there.display()
        ))),
        _ => Ok(()),
    }
}

/// Representations by their names; all where none is named.
///
/// # Errors
/// [`Failure::Usage`] for a name that is none.
pub fn candidates(only: &[String]) -> Result<Vec<Representation>, Failure> {
    if only.is_empty() {
        return Ok(Representation::all().collect());
    }
    let find = |name: &String| {
        Representation::all().find(|r| r.to_string() == *name).ok_or_else(|| {
            let known: Vec<String> = Representation::all().map(|r| r.to_string()).collect();
            Failure::usage(format!("--only {name}: expected one of {}", known.join(", ")))
        })
    };
    only.iter().map(find).collect()
}

/// The terminal's table.
fn table(t: &Trade) -> String {
    let mut out = format!(
        "{}, index {}: {} geometries ({}), {:.1} % beyond the critical angle\n\n{:<28} {:>9} {:>9} {:>9}   {:^20}   {:^20}\n{:<28} {:>9} {:>9} {:>9}   {:>6} {:>6} {:>6}   {:>6} {:>6} {:>6}\n",
        t.name,
        t.index,
        t.geometries,
        t.judged,
        100.0 * t.beyond_critical,
        "",
        "ns",
        "million",
        "",
        "ΔE beyond 15°",
        "ΔE within 15°",
        "",
        "each",
        "per s",
        "size",
        "mean",
        "95 %",
        "max",
        "mean",
        "95 %",
        "max"
    );
    let spread = |s: Option<ColourSpread>| match s {
        Some(s) => format!("{:>6.2} {:>6.2} {:>6.2}", s.mean, s.p95, s.max),
        None => format!("{:>6} {:>6} {:>6}", "–", "–", "–"),
    };
    for c in &t.candidates {
        let _ = writeln!(
            out,
            "{} {:<26} {:>9.1} {:>9.1} {:>9}   {}   {}",
            if c.on_front { "*" } else { " " },
            c.representation.to_string(),
            c.cost.median_ns,
            1e3 / c.cost.median_ns,
            size_in_words(c.bytes),
            spread(c.difference.beyond_15_deg),
            spread(c.difference.within_15_deg)
        );
    }
    out += "\n* on the front: nothing else is both faster and closer (mean beyond 15° of the mirror direction). Maps leave the gloss out, which shows within 15°.\n";
    for l in &t.left_out {
        let _ = writeln!(out, "left out: {}: {}", l.representation, l.reason);
    }
    if cfg!(debug_assertions) {
        out += "built without optimisation: these times are not those of a release\n";
    }
    out
}

fn to_json(a: &TradeArguments, t: &Trade) -> Value {
    let candidate = |c: &Candidate| {
        json!({
            "name": c.representation.to_string(), "ns": number(c.cost.median_ns), "ns_least": number(c.cost.least_ns),
            "arithmetic": c.arithmetic, "bytes": c.bytes, "delta_e": c.difference, "on_front": c.on_front,
        })
    };
    let left: Vec<Value> = t
        .left_out
        .iter()
        .map(|l| json!({ "name": l.representation.to_string(), "reason": l.reason }))
        .collect();
    json!({
        "input": a.input, "name": t.name, "index": t.index, "judged": t.judged, "geometries": t.geometries,
        "beyond_critical_share": t.beyond_critical, "largest_deg": a.map.largest_deg, "optimised": !cfg!(debug_assertions),
        "candidates": t.candidates.iter().map(candidate).collect::<Vec<_>>(), "left_out": left,
        "findings": effect::findings_json(&t.findings), "files": [],
    })
}

fn number(x: f64) -> Value {
    serde_json::Number::from_f64(x).map_or(Value::Null, Value::Number)
}

fn to_csv(t: &Trade) -> String {
    let mut out = String::from(
        "name,ns,ns_least,bytes,on_front,beyond_15_mean,beyond_15_p95,beyond_15_max,beyond_15_count,within_15_mean,within_15_p95,within_15_max,within_15_count\n",
    );
    for c in &t.candidates {
        let spread = |s: Option<ColourSpread>| {
            s.map_or_else(|| ",,,0".to_owned(), |s| format!("{},{},{},{}", s.mean, s.p95, s.max, s.count))
        };
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{}",
            c.representation,
            c.cost.median_ns,
            c.cost.least_ns,
            c.bytes,
            u8::from(c.on_front),
            spread(c.difference.beyond_15_deg),
            spread(c.difference.within_15_deg)
        );
    }
    out
}

fn write(
    folder: &Path,
    a: &TradeArguments,
    material: &Material,
    build: &Options,
    t: &Trade,
    told: &Value,
) -> Result<Vec<PathBuf>, Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::usage(format!("folder {} cannot be made: {e}", folder.display())))?;
    let [json, csv, html] = FILES.map(|f| folder.join(f));
    let pictures = report::save(&html_report(a, material, build, t), &html, Some(folder))?;
    output::write_whole(&csv, to_csv(t).as_bytes())?;
    let mut files = vec![json.clone(), csv, html];
    files.extend(pictures);
    let mut told = told.clone();
    told["files"] = files.iter().map(|p| shown(p)).collect();
    output::write_whole(&json, format!("{told:#}\n").as_bytes())?;
    Ok(files)
}

/// Colour group of a candidate in the picture.
pub const GROUPS: [&str; 4] = ["3-D table", "aspecular angle and colour maps", "flake maps", "fitted models"];

/// Colour group of a representation.
#[must_use]
pub const fn group(r: Representation) -> usize {
    match r {
        Representation::Table => 0,
        Representation::Aspecular | Representation::ColourMap(_) => 1,
        Representation::FlakeMap(_) => 2,
        Representation::Model(_) => 3,
    }
}

fn pareto(t: &Trade) -> Pareto {
    let point = |c: &Candidate| ParetoPoint {
        name: c.representation.to_string(),
        cost: c.cost.median_ns,
        error: c.difference.beyond_15_deg.or(c.difference.within_15_deg).map_or(f64::NAN, |s| s.mean),
        bytes: c.bytes,
        on_front: c.on_front,
        group: group(c.representation),
    };
    Pareto {
        title: format!("What accuracy costs: {}", t.name),
        cost_label: "ns per evaluation from vectors, one thread".to_owned(),
        error_label: "mean CIEDE2000 beyond 15° of the mirror direction".to_owned(),
        groups: GROUPS.map(str::to_owned).to_vec(),
        points: t.candidates.iter().map(point).collect(),
    }
}

fn html_report(a: &TradeArguments, material: &Material, build: &Options, t: &Trade) -> Report {
    let mut notices: Vec<Notice> =
        t.findings.iter().map(|f| Notice { weight: Weight::Warning, text: f.to_string() }).collect();
    notices.extend(t.left_out.iter().map(|l| Notice {
        weight: Weight::Note,
        text: format!("{} is left out: {}.", l.representation, l.reason),
    }));
    if cfg!(debug_assertions) {
        notices.push(Notice {
            weight: Weight::Warning,
            text: "Built without optimisation: these times are not those of a release.".to_owned(),
        });
    }
    let mut figures = vec![Figure {
        name: "pareto".to_owned(),
        picture: pareto(t).draw(),
        caption: "Error over cost; the area of a mark grows with the size of what a look-up reads. The line is the front: to its left and below \
                  nothing was found."
            .to_owned(),
        alt: format!("Mean colour difference over ns per evaluation for {} representations", t.candidates.len()),
    }];
    figures.extend(maps(material, build));
    Report {
        title: format!("Speed and accuracy: {}", t.name),
        subtitle: format!("{} geometries: {}", t.geometries, t.judged),
        key_figures: key_figures(t),
        notices,
        sections: vec![
            Section {
                heading: "Representations".to_owned(),
                intro: "Cost: median of interleaved rounds on this machine, one thread, directions given as vectors in no order. ΔE: CIEDE2000 on Lab of \
                        R = πf against the material itself."
                    .to_owned(),
                blocks: vec![rows(t), facts(a, t)],
            },
            Section {
                heading: "Pictures".to_owned(),
                intro: String::new(),
                blocks: vec![Block::Pictures(figures)],
            },
        ],
        footer: format!("gonio {}", env!("CARGO_PKG_VERSION")),
    }
}

/// The maps of the material, those that can be drawn.
fn maps(material: &Material, build: &Options) -> Vec<Figure> {
    let kinds = [
        (
            Representation::ColourMap(Method::Clip),
            "colour-map",
            "Kirchner's colour map: in-plane geometries, striped where only geometries out of the plane show the colours.",
        ),
        (
            Representation::FlakeMap(0),
            "flake-map",
            "The flake map: the same colours over what the flakes see. All geometries have a place here.",
        ),
    ];
    kinds
        .into_iter()
        .filter_map(|(representation, name, caption)| {
            let drawn = Drawn::new(material, representation, *build).ok()?;
            Some(Figure {
                name: name.to_owned(),
                picture: drawn.picture(None),
                caption: caption.to_owned(),
                alt: format!("{name} of {}", material.name),
            })
        })
        .collect()
}

fn key_figures(t: &Trade) -> Vec<KeyFigure> {
    let mean = |c: &&Candidate| c.difference.beyond_15_deg.map_or(f64::INFINITY, |s| s.mean);
    let mut out = Vec::new();
    let of = |label: &str, c: &Candidate| KeyFigure {
        label: label.to_owned(),
        value: c.representation.to_string(),
        note: format!(
            "{} ns, {}, mean ΔE {}",
            significant(c.cost.median_ns, 3),
            size_in_words(c.bytes),
            c.difference.beyond_15_deg.map_or_else(|| "–".to_owned(), |s| significant(s.mean, 2))
        ),
    };
    if let Some(c) = t.candidates.iter().min_by(|a, b| mean(a).total_cmp(&mean(b))) {
        out.push(of("closest", c));
    }
    if let Some(c) = t.candidates.iter().min_by(|a, b| a.cost.median_ns.total_cmp(&b.cost.median_ns)) {
        out.push(of("fastest", c));
    }
    out.push(KeyFigure {
        label: "beyond the critical angle".to_owned(),
        value: format!("{:.1} %", 100.0 * t.beyond_critical),
        note: "of the geometries have no in-plane equivalent".to_owned(),
    });
    out
}

fn rows(t: &Trade) -> Block {
    let head = [
        "Representation",
        "ns",
        "million/s",
        "size",
        "mean beyond 15°",
        "95 %",
        "max",
        "mean within 15°",
        "95 %",
        "max",
        "front",
    ];
    let spread = |s: Option<ColourSpread>| match s {
        Some(s) => [s.mean, s.p95, s.max].map(|x| significant(x, 3)),
        None => ["–", "–", "–"].map(str::to_owned),
    };
    Block::Table {
        caption: "Cost, size and CIEDE2000".to_owned(),
        head: head.map(str::to_owned).to_vec(),
        rows: t
            .candidates
            .iter()
            .map(|c| {
                let mut row = vec![
                    c.representation.to_string(),
                    significant(c.cost.median_ns, 3),
                    significant(1e3 / c.cost.median_ns, 3),
                    size_in_words(c.bytes),
                ];
                row.extend(spread(c.difference.beyond_15_deg));
                row.extend(spread(c.difference.within_15_deg));
                row.push(if c.on_front { "yes" } else { "" }.to_owned());
                row
            })
            .collect(),
    }
}

fn facts(a: &TradeArguments, t: &Trade) -> Block {
    Block::Facts(vec![
        Fact::new("refractive index of the coat", t.index.to_string()),
        Fact::new("largest polar angle of the maps", format!("{}°", a.map.largest_deg)),
        Fact::new("geometries judged", format!("{}: {}", t.geometries, t.judged)),
        Fact::new("beyond the critical angle", format!("{:.1} %", 100.0 * t.beyond_critical)),
    ])
}
