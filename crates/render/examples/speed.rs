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
    let mut time = |what: &str, work: &mut dyn FnMut() -> usize| {
        // the result is used, so that the work is done
        let size = work();
        let best = (0..3)
            .map(|_| {
                let start = Instant::now();
                assert_eq!(work(), size);
                start.elapsed()
            })
            .min()
            .unwrap_or_default();
        writeln!(out, "{what}: {:.1} ms", best.as_secs_f64() * 1e3)
    };
    let ball = KnownCells::new(&table);
    time("ball of 256² from a table, 2 × 2 samples", &mut || sphere(&ball, &options).values.len())?;
    time("ball of 256² from the model, 2 × 2 samples", &mut || sphere(&paint, &options).values.len())?;
    time("model averaged over 25,308 cells", &mut || plots::model_table(&table, &paint, 4, 2).values.len())?;
    let fit = Fit { name: "fit", brdf: &paint, coat: None };
    time("all six pictures of a report", &mut || standard_figures(&table, Some(fit)).len())
}
