//! How long pictures take, as ratios and in milliseconds: `cargo run --release -p gonio-render --example speed`.

use std::io::Write as _;
use std::time::Instant;

use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Grid, Meaning, Measured};
use gonio_optics::Angle;
use gonio_render::plots;
use gonio_render::report::{Fit, standard_figures};
use gonio_render::sphere::{KnownCells, Light, Sphere, sphere};

fn main() -> std::io::Result<()> {
    let paint =
        AshikhminShirleySimplified { diffuse: [0.28, 0.05, 0.04], specular: [0.06; 3], exponent: 60.0 };
    let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let table = plots::model_table(&Measured::empty(Grid::sopp(), meaning), &paint, 4, 2);
    let options = Sphere { size: 256, samples: 2, lights: vec![Light::aside()] };
    let mut out = std::io::stdout();
    let mut time = |what: &str, work: &mut dyn FnMut()| {
        work();
        let best = (0..3)
            .map(|_| {
                let start = Instant::now();
                work();
                start.elapsed()
            })
            .min()
            .unwrap_or_default();
        writeln!(out, "{what}: {:.1} ms", best.as_secs_f64() * 1e3)
    };
    time("ball of 256² from a table, 2 × 2 samples", &mut || {
        drop(sphere(&KnownCells::new(&table), &options))
    })?;
    time("ball of 256² from the model, 2 × 2 samples", &mut || drop(sphere(&paint, &options)))?;
    time("model averaged over 25,308 cells", &mut || drop(plots::model_table(&table, &paint, 4, 2)))?;
    time("all six pictures of a report", &mut || {
        drop(standard_figures(&table, Some(Fit { name: "fit", brdf: &paint })))
    })
}
