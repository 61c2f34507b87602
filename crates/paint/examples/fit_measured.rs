//! How close car paints come to measurements: three Cook–Torrance lobes with colours of their own against lobes on brightness with χ.
//!
//! `cargo run --release -p gonio-paint --example fit_measured -- FILE[=INDEX] …`, INDEX the coat's (none without).

use std::path::Path;
use std::time::Instant;

use gonio_brdf::{Grid, Measured, formats};
use gonio_fitter::{CoatChoice, Options, Weights};
use gonio_paint::fit::{PaintOptions, Subject, fit_paint};

#[allow(clippy::print_stdout)] // an example that prints a table
fn main() {
    println!(
        "{:<44} {:>8} {:>24} {:>24} {:>7}",
        "measurement", "weights", "3 lobes: mean/95%/max", "paint: mean/95%/max", "s"
    );
    for argument in std::env::args().skip(1) {
        let (file, coat) = match argument.split_once('=') {
            Some((file, n)) => (file.to_owned(), n.parse().map_or(CoatChoice::Fitted, CoatChoice::Index)),
            None => (argument, CoatChoice::None),
        };
        let table: Option<Measured> =
            formats::open(Path::new(&file)).ok().and_then(|loaded| loaded.to_measured(&Grid::sopp()));
        let Some(table) = table else {
            println!("{file}: no table");
            continue;
        };
        for (name, weights) in [("log", Weights::LogRelative), ("ngan", Weights::Ngan)] {
            let with = PaintOptions {
                lobes: Options { coat, weights, exponent_range: (1.0, 1e5), ..Options::default() },
                ..PaintOptions::default()
            };
            let plain = PaintOptions { colour_nodes: None, ..with.clone() };
            let subject = Subject::Table(&table);
            let begun = Instant::now();
            let told = |options: &PaintOptions| match fit_paint(&subject, options) {
                Ok(fit) => fit.errors.delta_e.beyond_15_deg.map_or_else(
                    || "no cells".to_owned(),
                    |e| format!("{:.2} / {:.2} / {:.2}", e.mean, e.p95, e.max),
                ),
                Err(e) => e.to_string(),
            };
            let (a, b) = (told(&plain), told(&with));
            let short =
                Path::new(&file).file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            println!("{short:<44} {name:>8} {a:>24} {b:>24} {:>7.1}", begun.elapsed().as_secs_f64());
        }
    }
}
