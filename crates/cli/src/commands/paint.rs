//! `gonio paint`: mixtures of car paints, strips of them, the closest one, and what a paint holds.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use gonio_brdf::Coat;
use gonio_paint::btf_folder::{INDEX_NAME, read_btf_folder};
use gonio_paint::car_paint::{FlakeSlices, Flakes, write_paint};
use gonio_paint::mixing::{Mixable, Part};
use gonio_paint::statistics::{FlakeStatistics, StatisticsOptions, fidelity};
use gonio_paint::{CarPaint, CarPaintParts};
use serde_json::{Map, Value, json};

use crate::arguments::paint::{MixArguments, PaintCommand, Paints};
use crate::commands::{car_paint, paint_design, paint_sweep};
use crate::effect;
use crate::opening::{self, Stored};
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};

/// Does what was asked for.
///
/// # Errors
/// [`Failure`], with what would help.
pub fn run(command: &PaintCommand, printer: Printer) -> Result<Outcome, Failure> {
    match command {
        PaintCommand::Mix(a) => mix(a, printer),
        PaintCommand::Sweep(a) => paint_sweep::run(a, printer),
        PaintCommand::Design(a) => paint_design::run(a, printer),
        PaintCommand::Info { input } => info(input, printer),
    }
}

/// A car paint of any of its forms; a folder of slices is a paint of flakes alone.
///
/// # Errors
/// [`Failure::Usage`] for anything else.
pub(super) fn open(input: &str) -> Result<Stored, Failure> {
    let path = Path::new(input);
    if path.is_dir() || path.file_name().is_some_and(|n| n == INDEX_NAME) {
        let read = read_btf_folder(path).map_err(Failure::usage)?;
        for note in &read.notes {
            eprintln!("note: {note}");
        }
        let flakes = FlakeSlices::new(Arc::new(read.btf), read.texel_mm).map_err(Failure::usage)?;
        let paint = CarPaint::new(CarPaintParts {
            name: effect::title(input),
            coat: read.coat_index.map(|index| Coat { index }),
            through: read.through,
            flakes: Some(Flakes::Slices(flakes)),
            ..CarPaintParts::default()
        })
        .map_err(Failure::usage)?;
        return Ok(Stored { paint, notes: Map::new() });
    }
    match opening::paint(input)? {
        Some(stored) => Ok(stored),
        None => Err(Failure::usage(format!(
            "{input} is no car paint: give a .paint file, a row of a published table (FILE#NAME) or a folder of flake slices; of a measured BRDF make one: gonio fit {input} --model car-paint -o OUT.paint"
        ))),
    }
}

/// The paints made ready to be mixed, and how long reading and preparing took, s.
///
/// # Errors
/// [`Failure::Usage`] for paints that cannot be read or do not mix.
pub(super) fn mixable(paints: &Paints, count: usize) -> Result<(Mixable, [f64; 2]), Failure> {
    let begun = Instant::now();
    let opened = paints
        .inputs
        .iter()
        .take(count)
        .map(|i| open(i).map(|s| Arc::new(s.paint)))
        .collect::<Result<Vec<_>, _>>()?;
    let read = begun.elapsed().as_secs_f64();
    let options = StatisticsOptions { clusters: paints.clusters, ..StatisticsOptions::default() };
    let mixable = Mixable::new(&opened, &options).map_err(Failure::usage)?;
    Ok((mixable, [read, begun.elapsed().as_secs_f64() - read]))
}

/// Writes a paint with where it comes from.
///
/// # Errors
/// [`Failure::Failed`] with the system's reason.
pub(super) fn save(
    path: &Path,
    paint: &CarPaint,
    inputs: &[String],
    weights: &[f64],
    part: Part,
) -> Result<(), Failure> {
    let mut notes = Map::new();
    let names: Vec<String> = inputs.iter().map(|i| effect::title(i)).collect();
    notes.insert("mixed".to_owned(), json!({ "of": names, "weights": weights, "part": part.name() }));
    let bytes = write_paint(paint, &notes).map_err(|e| Failure::failed("the paint cannot be written", e))?;
    output::write_whole(path, &bytes)
}

/// What a mixable set of paints costs, for programs.
pub(super) fn cost(m: &Mixable, seconds: [f64; 2]) -> Value {
    json!({
        "slices": m.slices(), "paths": m.paths(), "bytes": m.bytes(),
        "raw_bytes": m.paints().iter().map(|p| raw_bytes(p)).sum::<usize>(),
        "read_seconds": seconds[0], "prepare_seconds": seconds[1],
    })
}

/// Bytes of a paint's textures in single precision, 0 without any.
fn raw_bytes(paint: &CarPaint) -> usize {
    match &paint.parts().flakes {
        Some(Flakes::Slices(s)) => s.btf().slices().len() * s.btf().size()[0] * s.btf().size()[1] * 12,
        _ => 0,
    }
}

fn mix(a: &MixArguments, printer: Printer) -> Result<Outcome, Failure> {
    output::check_free(&a.output, a.force)?;
    let inputs: Vec<&Path> = a.paints.inputs.iter().map(Path::new).collect();
    output::check_apart(&a.output, &inputs)?;
    if a.weights.len() != a.paints.inputs.len() {
        return Err(Failure::usage(format!(
            "{} weights given for {} paints; give one weight for each, in their order",
            a.weights.len(),
            a.paints.inputs.len()
        )));
    }
    let (m, seconds) = mixable(&a.paints, usize::MAX)?;
    let part: Part = a.part.into();
    let mixed = m.mix(&a.weights, part).map_err(Failure::usage)?;
    for note in &mixed.notes {
        eprintln!("note: {note}");
    }
    save(&a.output, &mixed.paint, &a.paints.inputs, &a.weights, part)?;
    let text = format!(
        "{}\n{}  {} paths in {} slices, {:.2} MB to mix from; read {:.2} s, prepared {:.2} s; written to {}",
        mixed.paint.parts().name,
        car_paint::lines(&mixed.paint),
        m.paths(),
        m.slices(),
        m.bytes() as f64 / 1e6,
        seconds[0],
        seconds[1],
        a.output.display()
    );
    printer.result(
        &text,
        &json!({
            "inputs": a.paints.inputs, "weights": a.weights, "part": part.name(), "notes": mixed.notes, "mixable": cost(&m, seconds),
            "paint": car_paint::describe(&mixed.paint, &Map::new()), "output": shown(&a.output),
        }),
    );
    Ok(Outcome::Done)
}

fn info(input: &str, printer: Printer) -> Result<Outcome, Failure> {
    let Stored { paint, notes } = open(input)?;
    let mut text = format!("{}\n{}", paint.parts().name, car_paint::lines(&paint));
    let told = match &paint.parts().flakes {
        None => Value::Null,
        Some(Flakes::Statistics(s)) => {
            let s = s.statistics();
            text += &format!(
                "  {} slices, {} clusters, {:.2} MB\n",
                s.slices(),
                s.all_clusters().len(),
                s.bytes() as f64 / 1e6
            );
            json!({ "slices": s.slices(), "clusters": s.all_clusters().len(), "bytes": s.bytes() })
        }
        Some(Flakes::Slices(slices)) => {
            let s =
                FlakeStatistics::of(slices.btf(), &StatisticsOptions::default()).map_err(Failure::usage)?;
            let f = fidelity(slices.btf(), &s);
            text += &format!(
                "  {} slices of {} × {} texels, {:.1} MB; as statistics of 50 clusters {:.2} MB, 1 : {:.0}\n  drawn against measured, mean (largest) over slices: mean Lab {:.3} ({:.3}), deviation {:.2} % ({:.2} %), distance of the distributions {:.3} ({:.3})\n  sparkle: {:.3} % of the texels, {:.1} times as bright as the mean; drawn {:.3} %, {:.1} times\n",
                f.slices.len(),
                slices.btf().size()[0],
                slices.btf().size()[1],
                f.raw_bytes as f64 / 1e6,
                f.bytes as f64 / 1e6,
                f.raw_bytes as f64 / f.bytes as f64,
                f.mean(|s| s.mean),
                f.largest(|s| s.mean),
                100.0 * f.mean(|s| s.deviation),
                100.0 * f.largest(|s| s.deviation),
                f.mean(|s| s.distance),
                f.largest(|s| s.distance),
                100.0 * f.mean(|s| s.original.density),
                f.mean(|s| s.original.contrast),
                100.0 * f.mean(|s| s.rebuilt.density),
                f.mean(|s| s.rebuilt.contrast),
            );
            json!({
                "slices": f.slices.len(), "clusters": s.all_clusters().len(), "bytes": f.bytes, "raw_bytes": f.raw_bytes,
                "mean_lab": { "mean": f.mean(|s| s.mean), "largest": f.largest(|s| s.mean) },
                "deviation": { "mean": f.mean(|s| s.deviation), "largest": f.largest(|s| s.deviation) },
                "distance": { "mean": f.mean(|s| s.distance), "largest": f.largest(|s| s.distance) },
                "sparkle_density": { "measured": f.mean(|s| s.original.density), "drawn": f.mean(|s| s.rebuilt.density) },
                "sparkle_contrast": { "measured": f.mean(|s| s.original.contrast), "drawn": f.mean(|s| s.rebuilt.contrast) },
            })
        }
    };
    printer.result(
        &text,
        &json!({ "input": input, "paint": car_paint::describe(&paint, &notes), "statistics": told }),
    );
    Ok(Outcome::Done)
}
