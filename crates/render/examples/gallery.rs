//! Draws every kind of picture for a handful of tables, easy ones and awkward ones, into a folder: `cargo run --release -p
//! gonio-render --example gallery -- DIR`.

use std::path::Path;

use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Flag, Grid, Meaning, Measured};
use gonio_optics::Angle;
use gonio_render::plots::{self, Compare, Curve, Difference, Lobe, Unfolded};
use gonio_render::report::{
    Block, ColourDifference, Estimate, Fact, Figure, KeyFigure, Notice, Parameter, Report, Section, Weight,
};
use gonio_render::sphere::{KnownCells, Spheres, spheres};
use gonio_render::{Picture, PictureError};

/// A repeatable disturbance in −1…1 of roughly normal shape.
fn noise(seed: u64) -> f32 {
    let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x51ed_270b;
    let mut sum = 0.0;
    for _ in 0..3 {
        x ^= x >> 29;
        x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x ^= x >> 32;
        sum += (x >> 40) as f32 / (1u64 << 24) as f32 - 0.5;
    }
    sum
}

fn noisy(model: &AshikhminShirleySimplified, spread: f32) -> Measured {
    let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let mut m = plots::model_table(&Measured::empty(Grid::sopp(), meaning), model, 4, 2);
    for i in 0..m.grid.len() {
        let [ti, to, phi] = m.grid.coordinates(i);
        let g = m.grid.geometry(ti, to, phi);
        let grazing = 1.0
            + 6.0 * (g.theta_o.degrees() as f32 / 90.0).powi(6)
            + 2.0 * (g.theta_i.degrees() as f32 / 90.0).powi(4);
        for c in 0..3 {
            let s = spread * grazing * (m.values[i][c] + 0.002);
            m.sigma[i][c] = s;
            m.values[i][c] += s * 1.7 * noise((i * 3 + c) as u64);
        }
        if g.theta_o.degrees() > 75.0 || g.theta_i.degrees() > 80.0 {
            m.flag[i] = Flag::Extrapolated;
        } else if (g.theta_i.degrees() - g.theta_o.degrees()).abs() < 6.0 && g.phi.degrees() > 172.0 {
            m.flag[i] = Flag::Filled;
        }
    }
    m
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let dir = std::env::args().nth(1).unwrap_or_else(|| "gallery".into());
    let dir = Path::new(&dir);
    std::fs::create_dir_all(dir)?;
    let paint = AshikhminShirleySimplified {
        diffuse: [0.28, 0.05, 0.04],
        specular: [0.06, 0.05, 0.05],
        exponent: 60.0,
    };
    let off = AshikhminShirleySimplified {
        diffuse: [0.30, 0.052, 0.04],
        specular: [0.055, 0.05, 0.05],
        exponent: 52.0,
    };
    let gloss = AshikhminShirleySimplified {
        diffuse: [0.01, 0.02, 0.10],
        specular: [0.3, 0.3, 0.3],
        exponent: 1300.0,
    };
    let black = AshikhminShirleySimplified { diffuse: [0.0; 3], specular: [0.0; 3], exponent: 10.0 };
    let mut holes = noisy(&paint, 0.02);
    for i in 0..holes.grid.len() {
        let [ti, to, phi] = holes.grid.coordinates(i);
        if (to + phi) % 11 < 2 || ti == 7 {
            holes.flag[i] = Flag::Invalid;
            holes.values[i] = [f32::NAN; 3];
        }
    }
    let mut zero = Measured::sampled(Grid::sopp(), &black);
    zero.sigma.fill([0.0; 3]);
    let tables = [
        ("paint", noisy(&paint, 0.02), &off),
        ("holes", holes, &paint),
        ("gloss", noisy(&gloss, 0.01), &gloss),
        ("black", zero, &black),
    ];
    for (name, table, model) in &tables {
        let save = |what: &str, p: &Picture| p.save_png(&dir.join(format!("{name}-{what}.png")));
        let title = format!("Sample “{name}”");
        save("unfolded", &plots::unfolded(table, &Unfolded { title: title.clone(), ..Unfolded::default() }))?;
        save(
            "compare",
            &plots::compare(table, *model, &Compare { title: title.clone(), ..Compare::default() }),
        )?;
        let delta = Compare { difference: Difference::DeltaE, ..Compare::default() };
        save("compare-delta-e", &plots::compare(table, *model, &delta))?;
        let curves = [
            Curve { label: "fitted Ashikhmin–Shirley", brdf: *model },
            Curve { label: "paint", brdf: &paint },
        ];
        save("lobe", &plots::lobe(table, &curves, &Lobe { title: title.clone(), ..Lobe::default() }))?;
        let balls =
            spheres(&KnownCells::new(table), *model, &Spheres { title: title.clone(), ..Spheres::default() });
        save("spheres", &balls.picture)?;
        if *name == "paint" {
            report(dir, table, model, balls.picture.clone())?;
        }
        save("coverage", &plots::coverage(table, &title))?;
        save("sigma", &plots::sigma(table, &title))?;
    }
    Ok(())
}

/// A report with one of everything, the numbers made up.
fn report(
    dir: &Path,
    table: &Measured,
    model: &AshikhminShirleySimplified,
    balls: Picture,
) -> Result<(), PictureError> {
    let words = |s: &str| s.to_owned();
    let rgb = |v: [f64; 3]| v.map(|value| Estimate { value, sigma: Some(value * 0.004) }).to_vec();
    let exponent = vec![Estimate { value: model.exponent, sigma: Some(0.21) }];
    let parameters = [
        Parameter { name: words("diffuse, cd"), estimates: rgb(model.diffuse), unit: String::new() },
        Parameter { name: words("specular, cs"), estimates: rgb(model.specular), unit: String::new() },
        Parameter { name: words("exponent, n"), estimates: exponent, unit: String::new() },
    ];
    let errors = [
        (
            words("within 15° of the mirror direction"),
            ColourDifference { mean: 1.31, p95: 2.94, max: 5.12, cells: 1480 },
        ),
        (words("beyond 15°"), ColourDifference { mean: 0.21, p95: 0.55, max: 1.9, cells: 16376 }),
    ];
    let figure = |name: &str, picture: Picture, caption: &str, alt: &str| Figure {
        name: name.into(),
        picture,
        caption: caption.into(),
        alt: alt.into(),
    };
    let curves = [Curve { label: "fitted Ashikhmin–Shirley", brdf: model }];
    let report = Report {
        title: words("Red metallic 0042"),
        subtitle: words("Batch A-7 <trial> · operator M. Weber & son · θᵢ 0–90° in 19 poses"),
        key_figures: [
            ("Exponent", "52.0 ± 0.2", "Ashikhmin–Shirley, simplified"),
            ("ΔE₀₀, mean", "0.21", "beyond 15° of the mirror direction"),
            ("Cells measured", "76 %", "20 % extrapolated"),
            ("Median σ/f", "2.1 %", "k = 1"),
        ]
        .map(|(a, b, c)| KeyFigure { label: words(a), value: words(b), note: words(c) })
        .to_vec(),
        notices: vec![
            Notice {
                weight: Weight::Note,
                text: words("The lamp drifted by 0.4 % during the scan; its monitor corrected it."),
            },
            Notice {
                weight: Weight::Warning,
                text: words(
                    "Pose 7 (θᵢ = 35°) is missing: its cells were filled from the neighbours. Run the scan again with --resume to measure it.",
                ),
            },
        ],
        sections: vec![
            Section {
                heading: words("Sample"),
                intro: String::new(),
                blocks: vec![Block::Facts(vec![
                    Fact::new("Name", "Red metallic 0042"),
                    Fact::new("Batch", "A-7 <trial>"),
                    Fact::new(
                        "Note",
                        "Three layers on steel; the coat is 40 µm thick; kept in the dark for two weeks before the measurement.",
                    ),
                ])],
            },
            Section {
                heading: words("Fit"),
                intro: words(
                    "Simplified Ashikhmin–Shirley, averaged over every cell and the lamp before it was compared.",
                ),
                blocks: vec![Block::parameters(&parameters), Block::colour_differences(&errors)],
            },
            Section {
                heading: words("Pictures"),
                intro: String::new(),
                blocks: vec![Block::Pictures(vec![
                    figure(
                        "lobe",
                        plots::lobe(table, &curves, &Lobe::default()),
                        "The lobe in the plane of incidence: points are measured, lines are fitted.",
                        "Five lobes, each peaking near its mirror direction.",
                    ),
                    figure(
                        "spheres",
                        balls,
                        "Balls rendered from the data and from the fit, and their colour difference.",
                        "Two red balls that look alike and a map of small differences.",
                    ),
                    figure(
                        "unfolded",
                        plots::unfolded(table, &Unfolded::default()),
                        "The whole measurement, unfolded.",
                        "Nineteen strips in dark red with a bright spot that moves down.",
                    ),
                ])],
            },
            Section {
                heading: words("Link and camera"),
                intro: String::new(),
                blocks: vec![Block::Facts(vec![
                    Fact::new("Frames sent", "12,345"),
                    Fact::new("Retransmitted", "3"),
                    Fact::new("Exposures", "114, 0.1 ms to 2.0 s"),
                ])],
            },
        ],
        footer: words("Made by the gallery of gonio-render; the numbers of this page are invented."),
    };
    report.save_html(&dir.join("report.html"))
}
