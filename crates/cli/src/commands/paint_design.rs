//! `gonio paint design`: the closest mixture.

use std::path::Path;

use gonio_brdf::{Brdf, formats::Loaded};
use gonio_optics::colour::{Lab, lab_from_brdf};
use gonio_optics::{Angle, Geometry};
use gonio_paint::design::{DesignOptions, Wanted, design};
use gonio_paint::mixing::Part;
use serde_json::json;

use crate::arguments::paint::{DesignArguments, SparkleName};
use crate::commands::paint::{mixable, save};
use crate::opening;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};

/// Aspecular angles of multi-angle instruments at 45° incidence, degrees.
const ASPECULAR_DEG: [f64; 6] = [-15.0, 15.0, 25.0, 45.0, 75.0, 110.0];

/// Searches, tells, writes.
///
/// # Errors
/// [`Failure::Usage`] for paints that do not mix or a target that cannot be read.
pub fn run(a: &DesignArguments, printer: Printer) -> Result<Outcome, Failure> {
    if let Some(path) = &a.output {
        output::check_free(path, a.force)?;
        let inputs: Vec<&Path> = a.paints.inputs.iter().map(Path::new).collect();
        output::check_apart(path, &inputs)?;
    }
    if !(0.0..=9.0).contains(&a.beyond) {
        return Err(Failure::usage(format!("--beyond {}: expected 0 (mixtures alone) to 9", a.beyond)));
    }
    let (geometries, target): (Vec<Geometry>, Vec<Lab>) = match (&a.lab, &a.target) {
        (Some(csv), _) => from_csv(csv)?,
        (None, Some(input)) => of_brdf(input)?,
        (None, None) => return Err(Failure::usage("give --target or --lab")),
    };
    let wanted: Vec<Wanted> = geometries
        .iter()
        .zip(&target)
        .map(|(g, lab)| {
            let (light, view) = g.directions();
            Wanted { light, view, lab: *lab }
        })
        .collect();
    let (m, seconds) = mixable(&a.paints, 16)?;
    let part = if a.sparkle == SparkleName::Held { Part::Hue } else { Part::Everything };
    let options = DesignOptions { range: [-a.beyond, 1.0 + a.beyond], part };
    let found = design(&m, &wanted, &options).map_err(Failure::usage)?;
    for note in &found.mixed.notes {
        eprintln!("note: {note}");
    }
    if let Some(path) = &a.output {
        save(path, &found.mixed.paint, &a.paints.inputs, &found.weights, part)?;
    }
    let mut text = String::new();
    for ((input, w), alone) in a.paints.inputs.iter().zip(&found.weights).zip(&found.alone) {
        text += &format!("  {w:8.4} {input}   (alone: mean ΔE {alone:.2})\n");
    }
    text += "  θi      θo      φ       ΔE00    wanted L* a* b*            mixture L* a* b*\n";
    for (((g, want), lab), d) in geometries.iter().zip(&target).zip(&found.lab).zip(&found.delta_e) {
        text += &format!(
            "  {:<7.2} {:<7.2} {:<7.2} {d:<7.3} {:8.2} {:8.2} {:8.2} {:8.2} {:8.2} {:8.2}\n",
            g.theta_i.degrees(),
            g.theta_o.degrees(),
            g.phi.degrees(),
            want.l,
            want.a,
            want.b,
            lab.l,
            lab.a,
            lab.b
        );
    }
    let largest = found.delta_e.iter().copied().fold(0.0, f64::max);
    text += &format!("mean ΔE {:.3}, max {largest:.3}; {} mixtures looked at", found.mean(), found.looked_at);
    let angles: Vec<_> = geometries
        .iter()
        .zip(&target)
        .zip(&found.lab)
        .zip(&found.delta_e)
        .map(|(((g, want), lab), d)| {
            json!({
                "theta_i_deg": g.theta_i.degrees(), "theta_o_deg": g.theta_o.degrees(), "phi_deg": g.phi.degrees(),
                "delta_e": d, "wanted_lab": [want.l, want.a, want.b], "lab": [lab.l, lab.a, lab.b],
            })
        })
        .collect();
    printer.result(
        &text,
        &json!({
            "inputs": a.paints.inputs, "weights": found.weights, "part": part.name(), "mean_delta_e": found.mean(), "max_delta_e": largest,
            "alone_mean_delta_e": found.alone, "angles": angles, "looked_at": found.looked_at, "notes": found.mixed.notes,
            "read_seconds": seconds[0], "prepare_seconds": seconds[1], "output": a.output.as_deref().map(shown),
        }),
    );
    Ok(Outcome::Done)
}

fn of_brdf(input: &str) -> Result<(Vec<Geometry>, Vec<Lab>), Failure> {
    let loaded = opening::open(input)?;
    let brdf: &dyn Brdf = match &loaded {
        Loaded::Table(t) => t,
        Loaded::Model(m) => m,
        Loaded::Function(f) => &*f.brdf,
        Loaded::Scattered(_) => {
            return Err(Failure::usage(format!(
                "{input} holds scattered geometries, nothing in between; give their Lab values with --lab, or fit a model first"
            )));
        }
    };
    let geometries: Vec<Geometry> = ASPECULAR_DEG
        .iter()
        .map(|aspecular| {
            // in the plane, from the mirror direction at −45° towards the light
            let view = aspecular - 45.0;
            let phi = if view < 0.0 { Angle::STRAIGHT } else { Angle::ZERO };
            Geometry { theta_i: Angle::from_degrees(45.0), theta_o: Angle::from_degrees(view.abs()), phi }
        })
        .collect();
    let lab = geometries
        .iter()
        .map(|g| {
            let (l, v) = g.directions();
            lab_from_brdf(brdf.eval(l, v))
        })
        .collect();
    Ok((geometries, lab))
}

fn from_csv(path: &Path) -> Result<(Vec<Geometry>, Vec<Lab>), Failure> {
    const HEADER: [&str; 6] = ["theta_i_deg", "theta_o_deg", "phi_deg", "l", "a", "b"];
    let text = output::read_text(path)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let wrong = |what: String| {
        Failure::usage(format!(
            "{}: {what}; expected the header {} and six numbers a row",
            path.display(),
            HEADER.join(",")
        ))
    };
    let header = reader.headers().map_err(|e| wrong(e.to_string()))?;
    if header.iter().ne(HEADER) {
        return Err(wrong(format!("the header is {}", header.iter().collect::<Vec<_>>().join(","))));
    }
    let (mut geometries, mut colours) = (Vec::new(), Vec::new());
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|e| wrong(e.to_string()))?;
        let numbers: Vec<f64> =
            record.iter().filter_map(|f| f.parse().ok()).filter(|n: &f64| n.is_finite()).collect();
        let &[i, o, phi, l, a, b] = numbers.as_slice() else {
            return Err(wrong(format!("row {} is {}", row + 1, record.iter().collect::<Vec<_>>().join(","))));
        };
        if !(0.0..=90.0).contains(&i) || !(0.0..=90.0).contains(&o) {
            return Err(wrong(format!(
                "row {}: polar angles of {i}° and {o}°, not within 0° … 90°",
                row + 1
            )));
        }
        let angle = Angle::from_degrees;
        geometries.push(Geometry { theta_i: angle(i), theta_o: angle(o), phi: angle(phi) });
        colours.push(Lab { l, a, b });
    }
    Ok((geometries, colours))
}
