//! Car paints on the command line: fitted, converted, told of.

use std::path::Path;

use gonio_brdf::{Grid, Model, formats::Loaded};
use gonio_fitter::{CoatChoice, Weights};
use gonio_paint::btf_folder::read_btf_folder;
use gonio_paint::car_paint::{FlakeSlices, Flakes, Through, write_paint};
use gonio_paint::fit::{PaintOptions, Subject, fit_paint};
use gonio_paint::flake_floor::above_floor;
use gonio_paint::{CarPaint, CarPaintParts};
use serde_json::{Map, Value, json};

use crate::arguments::FitArguments;
use crate::opening::Stored;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};
use crate::{effect, fitting, opening};

/// Share of a slice's texels that lie below what counts as a flake.
const FLOOR: f64 = 0.05;

/// `gonio fit M --model car-paint`: lobes on brightness, χ over half angle and incidence, flakes where a folder of them is given.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read, [`Failure::Failed`] where nothing could be fitted.
pub fn fit(a: &FitArguments, input: &str, printer: Printer) -> Result<Outcome, Failure> {
    if a.report.is_some() || !a.export.is_empty() {
        return Err(Failure::usage(
            "--report and --export belong to models of model.json; render the paint instead",
        ));
    }
    if let Some(path) = &a.output {
        output::check_free(path, a.force)?;
        output::check_apart(path, &[Path::new(input)])?;
    }
    let loaded = opening::open(input)?;
    let subject = fitting::Subject::of(&loaded)?;
    let weights = Some(a.weights.map_or(Weights::LogRelative, Into::into));
    let plain = fitting::options("cook-torrance:3", weights, a.max_angle_deg, subject.has_sigma)?;
    let coat = match a.coat.as_str() {
        "auto" => subject.coat(),
        "none" => CoatChoice::None,
        "fit" => CoatChoice::Fitted,
        index => match index.parse::<f64>() {
            Ok(n) if n > 1.0 && n <= 4.0 => CoatChoice::Index(n),
            _ => {
                return Err(Failure::usage(format!(
                    "--coat {index}: expected auto, none, fit, or a refractive index above 1, at most 4"
                )));
            }
        },
    };
    let mut notes = Map::new();
    notes.insert("source".to_owned(), json!(effect::title(input)));
    let (flakes, flake_floors) = match a.flakes.as_deref() {
        Some(folder) => {
            let (flakes, floors) = flakes(folder, coat, &mut notes)?;
            (Some(flakes), (!a.keep_flake_level).then_some(floors))
        }
        None => (None, None),
    };
    let lobes = gonio_fitter::Options { coat, loss: a.loss.parse().map_err(Failure::usage)?, ..plain };
    let options =
        PaintOptions { name: effect::title(input), lobes, flakes, flake_floors, ..PaintOptions::default() };
    let table = match &loaded {
        Loaded::Scattered(_) => None,
        other => other.to_measured(&Grid::sopp()),
    };
    let measurement = match (&loaded, &table) {
        (Loaded::Scattered(s), _) => Subject::Scattered(s),
        (_, Some(t)) => Subject::Table(t),
        _ => return Err(Failure::usage(format!("{input} holds nothing that can be evaluated"))),
    };
    let fitted = fit_paint(&measurement, &options).map_err(|e| Failure::Failed(format!("{input}: {e}")))?;
    let plain = PaintOptions { colour_nodes: None, ..options };
    let compared = fit_paint(&measurement, &plain).ok().map(|f| f.errors.delta_e);
    let delta_e = fitted.errors.delta_e;
    let told = json!({
        "status": fitted.lobes.status.name(), "sentence": fitted.lobes.sentence(), "cells_used": fitted.lobes.cells_used,
        "delta_e": delta_e, "delta_e_of_lobes_alone": compared, "nodes_seen": fitted.nodes_seen,
        "flake_level": fitted.flake_level.map(|l| json!({ "p5": l.p5, "median": l.median, "p95": l.p95 })),
    });
    notes.insert("fit".to_owned(), told.clone());
    if let Some(path) = &a.output {
        save(path, &fitted.paint, &notes)?;
    }
    let mut text = format!("car-paint ({})\n", fitted.lobes.status.name());
    text += &lines(&fitted.paint);
    for (words, spread) in [
        ("beyond 15° of the mirror direction", delta_e.beyond_15_deg),
        ("within 15°", delta_e.within_15_deg),
        ("of three lobes with colours of their own, beyond 15°", compared.and_then(|c| c.beyond_15_deg)),
    ] {
        if let Some(d) = spread {
            text += &format!("  ΔE {words}: mean {:.2}, 95 % {:.2}, max {:.2}\n", d.mean, d.p95, d.max);
        }
    }
    text += &format!(
        "  {} cells; {:.0} % of the nodes of χ are seen by one; {}\n",
        fitted.lobes.cells_used,
        100.0 * fitted.nodes_seen,
        fitted.lobes.sentence()
    );
    if let Some(l) = fitted.flake_level {
        text += &format!(
            "  flake textures brought to the level of the measurement by factors of {:.2} (5 %), {:.2} (half), {:.2} (95 %)\n",
            l.p5, l.median, l.p95
        );
    }
    let paint = describe(&fitted.paint, &Map::new());
    printer.result(
        &text,
        &json!({ "input": input, "paint": paint, "fit": told, "output": a.output.as_deref().map(shown) }),
    );
    Ok(Outcome::Done)
}

/// The textures of a folder, which must lie under the coat that is fitted with.
fn flakes(
    folder: &Path,
    coat: CoatChoice,
    notes: &mut Map<String, Value>,
) -> Result<(Flakes, Vec<gonio_brdf::Rgb>), Failure> {
    let read = read_btf_folder(folder).map_err(Failure::usage)?;
    for note in &read.notes {
        eprintln!("note: {note}");
    }
    let index = if let CoatChoice::Index(n) = coat { Some(n) } else { None };
    let same = match (index, read.coat_index) {
        (Some(a), Some(b)) => (a - b).abs() < 1e-6,
        (a, b) => a.is_none() && b.is_none(),
    };
    if !same {
        let words = |n: Option<f64>| n.map_or("no coat".to_owned(), |n| format!("a coat of index {n}"));
        return Err(Failure::usage(format!(
            "{}: its angles are under {}, the paint is fitted under {}; say --coat {}",
            folder.display(),
            words(read.coat_index),
            words(index),
            read.coat_index.map_or("none".to_owned(), |n| n.to_string())
        )));
    }
    if read.through == Through::RefractedOnly {
        return Err(Failure::usage(format!(
            "{}: its texels are as seen outside (refracted-only), a fitted paint keeps those of the base; divide T(θi)T(θo)/n² out",
            folder.display()
        )));
    }
    notes.insert("flakes".to_owned(), json!(folder.file_name().unwrap_or_default().to_string_lossy()));
    // what lies between the flakes is the base, which is fitted
    let (btf, floors) = above_floor(&read.btf, FLOOR).map_err(Failure::usage)?;
    let slices = FlakeSlices::new(std::sync::Arc::new(btf), read.texel_mm).map_err(Failure::usage)?;
    Ok((Flakes::Slices(slices), floors))
}

/// `gonio convert IN OUT.paint`: a row of published car paints, a paint, or a cook-torrance model.
///
/// # Errors
/// [`Failure::Usage`] for anything that is no paint.
pub fn convert(input: &str, output: &Path, printer: Printer) -> Result<Outcome, Failure> {
    let Stored { paint, mut notes } = match opening::paint(input)? {
        Some(found) => found,
        None => Stored { paint: of_model(input)?, notes: Map::new() },
    };
    notes.entry("source").or_insert_with(|| json!(effect::title(input)));
    save(output, &paint, &notes)?;
    printer.result(
        &format!("{}written to {}", lines(&paint), output.display()),
        &json!({ "input": input, "output": shown(output), "not_kept": Vec::<String>::new(), "paint": describe(&paint, &Map::new()) }),
    );
    Ok(Outcome::Done)
}

fn of_model(input: &str) -> Result<CarPaint, Failure> {
    let no = || {
        Failure::usage(format!(
            "{input} is no car paint: give a row of a published table (FILE#NAME) or a cook-torrance model.json, or fit one: gonio fit {input} --model car-paint -o OUT.paint"
        ))
    };
    let Loaded::Model(file) = opening::open(input)? else { return Err(no()) };
    let Model::CookTorrance(m) = file.model else { return Err(no()) };
    let parts = CarPaintParts {
        name: effect::title(input),
        coat: file.coat,
        diffuse: m.diffuse,
        lobes: m.lobes,
        ..CarPaintParts::default()
    };
    CarPaint::new(parts).map_err(Failure::usage)
}

fn save(path: &Path, paint: &CarPaint, notes: &Map<String, Value>) -> Result<(), Failure> {
    let bytes = write_paint(paint, notes).map_err(|e| Failure::failed("the paint cannot be written", e))?;
    output::write_whole(path, &bytes)
}

/// What a paint holds, for people.
#[must_use]
pub fn lines(paint: &CarPaint) -> String {
    let p = paint.parts();
    let three = |c: [f64; 3]| c.map(|v| format!("{v:.4}")).join(" ");
    let mut text = match p.coat {
        Some(c) => format!("  coat of index {}, {}\n", c.index, p.through.name()),
        None => "  no coat\n".to_owned(),
    };
    text += &format!("  diffuse {}\n", three(p.diffuse));
    for l in &p.lobes {
        text += &format!("  lobe    {}   alpha {:.4}   r0 {:.3}\n", three(l.specular), l.alpha, l.r0);
    }
    if let Some(chi) = &p.colour {
        text += &format!(
            "  colours at {} half angles × {} angles of incidence\n",
            chi.half().len(),
            chi.incidence().len()
        );
    }
    if let Some(f) = &p.flakes {
        text += &format!("  flakes as {}, texels of {:.3} mm\n", f.name(), f.texel_mm());
    }
    text
}

/// What a paint holds, for programs.
#[must_use]
pub fn describe(paint: &CarPaint, notes: &Map<String, Value>) -> Value {
    let p = paint.parts();
    let deg = |a: &[gonio_optics::Angle]| {
        json!([a.first().map(|a| a.degrees()), a.last().map(|a| a.degrees()), a.len()])
    };
    let chi = p
        .colour
        .as_ref()
        .map(|c| json!({ "half_deg": deg(c.half().angles()), "incidence_deg": deg(c.incidence().angles()) }));
    let flakes = p.flakes.as_ref().map(|f| json!({ "kind": f.name(), "texel_mm": f.texel_mm() }));
    json!({
        "content": "car-paint", "format": "car-paint", "name": p.name, "coat_index": p.coat.map(|c| c.index),
        "through": p.through.name(), "diffuse": p.diffuse,
        "lobes": p.lobes.iter().map(|l| json!({"specular": l.specular, "alpha": l.alpha, "r0": l.r0})).collect::<Vec<_>>(),
        "colour": chi, "flakes": flakes, "notes": notes,
    })
}
