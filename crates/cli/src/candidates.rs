//! The table and the picture of a choice among models.

use gonio_fitter::auto::{Candidate, Chosen};
use gonio_render::plots::{Chart, ChartPoint};
use gonio_render::report::{Block, Figure, Section, significant};
use serde_json::{Value, json};

fn row(chosen: &Chosen, place: usize, c: &Candidate) -> [String; 6] {
    let number = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), |x| significant(x, 3));
    let all = c.held_out.and_then(|h| h.all);
    [
        format!("{}{}", if place == chosen.place { "▸ " } else { "" }, c.choice.name()),
        c.parameters.to_string(),
        number(all.map(|s| s.mean)),
        number(all.map(|s| s.p95)),
        number(c.nanoseconds),
        c.status.as_ref().map_or("not tried: a simpler one will do", |s| s.name()).to_owned(),
    ]
}

/// Column heads.
const HEAD: [&str; 6] = ["model", "parameters", "mean ΔE", "95 %", "ns", "status"];

/// The table for a terminal.
#[must_use]
pub fn table(chosen: &Chosen) -> String {
    let line = |cells: &[String; 6]| {
        let [name, parameters, mean, p95, ns, status] = cells;
        format!("  {name:<32}{parameters:>10} {mean:>8} {p95:>8} {ns:>7}  {status}\n")
    };
    let mut out = format!("candidates, ΔE (CIEDE2000) on what was held out: {}\n", chosen.held_out);
    out += &line(&HEAD.map(str::to_owned));
    for (i, c) in chosen.candidates.iter().enumerate() {
        out += &line(&row(chosen, i, c));
    }
    if !chosen.within {
        out += "  no candidate keeps the bound; the nearest was taken\n";
    }
    out
}

/// The `choice` key of a fit.
#[must_use]
pub fn to_json(chosen: &Chosen) -> Value {
    let candidates: Vec<Value> = chosen
        .candidates
        .iter()
        .map(|c| {
            json!({
                "model": c.choice.name(),
                "parameters": c.parameters,
                "delta_e": c.held_out,
                "status": c.status.as_ref().map(|s| s.name()),
                "nanoseconds": c.nanoseconds,
            })
        })
        .collect();
    json!({ "held_out": chosen.held_out, "within_bound": chosen.within, "candidates": candidates })
}

/// Table and picture for a report.
#[must_use]
pub fn section(chosen: &Chosen) -> Section {
    let rows = chosen.candidates.iter().enumerate().map(|(i, c)| row(chosen, i, c).to_vec()).collect();
    let said = if chosen.within {
        "The one with the fewest parameters within the bound was taken."
    } else {
        "None keeps the bound; the nearest was taken."
    };
    Section {
        heading: "Choice of the model".to_owned(),
        intro: format!(
            "Every candidate was fitted to part of the data and judged on the rest ({}). {said}",
            chosen.held_out
        ),
        blocks: vec![
            Block::Table {
                caption: "CIEDE2000 on held-out cells; ns: one evaluation from vectors on this machine"
                    .to_owned(),
                head: HEAD.map(str::to_owned).to_vec(),
                rows,
            },
            Block::Pictures(vec![picture(chosen)]),
        ],
    }
}

fn picture(chosen: &Chosen) -> Figure {
    let points = chosen
        .candidates
        .iter()
        .enumerate()
        .filter_map(|(i, c)| {
            Some(ChartPoint {
                name: format!("{} ({})", c.choice.name(), c.parameters),
                at: (c.nanoseconds?, c.mean()?),
                chosen: i == chosen.place,
            })
        })
        .collect();
    let chart = Chart {
        x_label: "time of one evaluation, ns".to_owned(),
        y_label: "mean ΔE on held-out cells".to_owned(),
        logarithmic: [true, true],
        points,
        ..Chart::default()
    };
    Figure {
        name: "candidates".to_owned(),
        picture: chart.draw(),
        caption: "Candidates by evaluation time and colour difference, parameters in brackets; the chosen one is filled."
            .to_owned(),
        alt: "Scatter of model candidates, evaluation time against colour difference.".to_owned(),
    }
}
