//! What comes out of the misaligned instrument once it is calibrated: colour differences by zone and paint, and whether σ is true.

use std::fmt::Write as _;
use std::path::Path;

use gonio_acquisition::Options;
use gonio_acquisition::fill::{Filling, Method};
use gonio_brdf::formats;
use gonio_brdf::models::{AshikhminShirleySimplified, Coat, Lambert};
use gonio_brdf::{Flag, Grid, Meaning, Measured, Model, ModelFile, average};
use gonio_instrument::{Description, Misalignment, builtin};
use gonio_optics::colour;
use gonio_sim::optics::Sample;

use crate::Figure;
use crate::bench_scan::BenchScan;

const SEED: u64 = 1;
/// Angles of incidence of the whole scan, degrees.
const WHOLE: [f64; 18] = [
    0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0,
];
/// Zones: name, flag, θo from and to (degrees), bound of the mean beyond 15° of the mirror direction.
const ZONES: [(&str, Flag, f64, f64, Option<f64>); 4] = [
    ("measured", Flag::Measured, 0.0, 75.0, Some(0.3)),
    ("filled", Flag::Filled, 0.0, 75.0, Some(0.6)),
    ("75 to 85°", Flag::Extrapolated, 75.1, 85.0, Some(1.0)),
    ("85 to 90°", Flag::Extrapolated, 85.1, 90.0, None),
];

/// A paint of the table.
pub enum Paint {
    /// A model, with a coat where it has one.
    Model(ModelFile),
    /// A measured table, interpolated.
    Table(Box<Measured>),
}

impl Paint {
    fn sample(&self) -> Sample {
        match self {
            Self::Model(file) => Sample::model(file.clone()),
            Self::Table(t) => Sample::table((**t).clone()),
        }
    }

    fn cell_mean(&self, grid: &Grid, meaning: Meaning, cell: [usize; 3]) -> [f64; 3] {
        match self {
            Self::Model(file) => average::model_cell_mean(file, grid, meaning, cell),
            Self::Table(t) => average::adaptive_cell_mean(&**t, grid, meaning, cell),
        }
    }

    const fn coated(&self) -> bool {
        matches!(self, Self::Model(ModelFile { coat: Some(_), .. }))
    }
}

fn metallic() -> Model {
    Model::AshikhminShirleySimplified(AshikhminShirleySimplified {
        diffuse: [0.06, 0.13, 0.32],
        specular: [0.3, 0.35, 0.4],
        exponent: 40.0,
    })
}

/// Matt, metallic, coated; the interference pigment where the real measurements are there.
pub fn paints() -> Vec<(&'static str, Paint)> {
    let file = |model, coat| Paint::Model(ModelFile { model, coat, fit: None });
    let mut out = vec![
        ("matt", file(Model::Lambert(Lambert { diffuse: [0.45, 0.2, 0.08] }), None)),
        ("metallic", file(metallic(), None)),
        ("coated", file(metallic(), Some(Coat { index: 1.5 }))),
    ];
    if let Some(folder) = std::env::var_os("GONIO_DATA") {
        let path = Path::new(&folder).join("rgl/cc_ibiza_sunset_rgb.bsdf");
        let loaded = formats::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        if let Some(table) = loaded.to_measured(&Grid::sopp()) {
            out.push(("interference", Paint::Table(Box::new(table))));
        }
    }
    out
}

/// A row of the table: paint, zone, beyond 15° or within, mean, 95th percentile, largest, cells.
pub struct Row {
    pub paint: String,
    pub zone: &'static str,
    pub beyond: bool,
    pub values: [f64; 3],
    pub cells: usize,
    pub bound: Option<f64>,
}

/// Ways to fill, each used everywhere.
const WAYS: [(&str, Filling); 4] = [
    ("plain", Filling::PLAIN),
    ("reciprocity, then plain", Filling::BARE),
    ("flake space", Filling::both(Method { reciprocity: false, flake_space: true })),
    ("reciprocity, then flake space", Filling::both(Method { reciprocity: true, flake_space: true })),
];

/// What the ways to fill give for one paint: mean beyond 15° of the mirror direction in holes, 75 to 85° and 85 to 90°, then that of holes within 15°;
/// and what is used.
pub struct Compared {
    pub paint: String,
    pub ways: [[f64; 4]; 4],
    pub used: String,
    pub kept: [f64; 4],
}

/// Colour differences of a table's cells against the truth in a zone, smallest first.
fn differences(table: &Measured, truth: &[[f64; 3]], zone: (Flag, f64, f64), beyond: bool) -> Vec<f64> {
    let (flag, low, high) = zone;
    let mut all: Vec<f64> = (0..table.grid.len())
        .filter(|&i| {
            let [ti, to, phi] = table.grid.coordinates(i);
            let theta_o = table.grid.theta_o_deg[to];
            let far = table.grid.geometry(ti, to, phi).from_mirror().degrees() > 15.0;
            // at θi = 90° nothing is lit
            table.flag[i] == flag
                && table.grid.theta_i_deg[ti] < 89.0
                && (low..=high).contains(&theta_o)
                && far == beyond
        })
        .map(|i| {
            let have = table.values[i].map(f64::from);
            colour::ciede2000(colour::lab_from_brdf(have), colour::lab_from_brdf(truth[i]))
        })
        .collect();
    all.sort_unstable_by(f64::total_cmp);
    all
}

fn mean(all: &[f64]) -> f64 {
    all.iter().sum::<f64>() / all.len().max(1) as f64
}

/// The differences of one paint on an instrument with `errors`, reduced by the description `known`, and how ways to fill compare.
pub fn rows(name: &str, paint: &Paint, known: &Description, errors: &Misalignment) -> (Vec<Row>, Compared) {
    let mut bench = BenchScan::new(known, errors, SEED);
    let white = bench.white(&WHOLE);
    let (table, reducer) = bench.table(&white, &paint.sample(), &WHOLE, Options::default());
    let truth: Vec<[f64; 3]> = (0..table.grid.len())
        .map(|i| paint.cell_mean(&table.grid, table.meaning, table.grid.coordinates(i)))
        .collect();
    let mut out = Vec::new();
    for (zone, flag, low, high, bound) in ZONES {
        for beyond in [true, false] {
            let all = differences(&table, &truth, (flag, low, high), beyond);
            let n = all.len();
            if n == 0 {
                continue;
            }
            let values = [mean(&all), all[(n - 1) * 95 / 100], all[n - 1]];
            // the bound of 75 to 85° is one of coated paints
            let bound = bound.filter(|_| beyond && (flag != Flag::Extrapolated || paint.coated()));
            out.push(Row { paint: name.to_owned(), zone, beyond, values, cells: n, bound });
        }
    }
    let filled = |t: &Measured| {
        [(1, true), (2, true), (3, true), (1, false)].map(|(k, beyond)| {
            let (_, flag, low, high, _) = ZONES[k];
            mean(&differences(t, &truth, (flag, low, high), beyond))
        })
    };
    let ways = WAYS
        .map(|(way, how)| filled(&reducer.finish_by(how).unwrap_or_else(|e| panic!("{name}, {way}: {e}"))));
    let used = table.attributes.get("filled_by").cloned().unwrap_or_default();
    (out, Compared { paint: name.to_owned(), ways, used, kept: filled(&table) })
}

/// The page `docs/accuracy.md`.
pub fn page(rows: &[Row], compared: &[Compared]) -> String {
    let mut text = "# Accuracy\n\nWritten by `make figures ONLY=accuracy`. The virtual instrument with the shipped misalignment, 1280 × 1024, 12 bit, all its noise, \
calibrated by `gonio calibrate geometry`; 18 angles of incidence, one spin. CIEDE2000 of every cell's mean against the truth's mean over the same \
bin and lamp, within and beyond 15° of the mirror direction; θi up to 85°.\n\n| paint | zone | | mean | 95 % | largest | cells | bound of the mean |\n|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for r in rows {
        let [mean, p95, most] = r.values;
        let _ = writeln!(
            text,
            "| {} | {} | {} 15° | {mean:.3} | {p95:.3} | {most:.3} | {} | {} |",
            r.paint,
            r.zone,
            if r.beyond { ">" } else { "≤" },
            r.cells,
            r.bound.map_or_else(|| "–".to_owned(), |b| format!("{b}")),
        );
    }
    text.push_str(
        "\n## Ways to fill\n\nThe same scans filled in four ways, mean CIEDE2000 beyond 15° of the mirror direction in holes (θo up to 75°), 75 to 85° and 85 to 90°, and in holes within 15°. \
*Plain*: holes by a thin plate in log f, the rim by the slope of log f, forgotten over 10°. *Reciprocity* first takes what was measured with light and view \
exchanged. *Flake space*: the same of the ratio to a flake map of all measured cells, which returns to 1. What is used is chosen by zone: under a coat flake space, \
holes by reciprocity first; without a coat reciprocity, then plain; where the measured cells themselves do not keep reciprocity (median departure above 5 %; the interference \
pigment's measured table departs by a quarter), flake space in holes but plain within 15° of the mirror direction and beyond 75°.\n\n| paint | way | holes | 75 to 85° | 85 to 90° | holes ≤ 15° |\n|---|---|---|---|---|---|\n",
    );
    for c in compared {
        let line = |text: &mut String, way: &str, [holes, rim, last, near]: [f64; 4]| {
            let _ = writeln!(text, "| {} | {way} | {holes:.3} | {rim:.3} | {last:.3} | {near:.3} |", c.paint);
        };
        for ((way, _), values) in WAYS.iter().zip(c.ways) {
            line(&mut text, way, values);
        }
        line(&mut text, &format!("**used** ({})", c.used), c.kept);
    }
    text
}

/// Accuracy by zone and paint; the page is written anew.
pub fn figures() -> Vec<Figure> {
    let errors = builtin::misalignment().expect("built in");
    let known = crate::geometry::calibrated();
    let (mut all, mut compared) = (Vec::new(), Vec::new());
    for (name, paint) in paints() {
        let (rows, ways) = rows(name, &paint, &known, &errors);
        all.extend(rows);
        compared.push(ways);
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/accuracy.md");
    std::fs::write(&path, page(&all, &compared)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let coated = compared.iter().filter(|c| c.paint == "coated").map(|c| {
        Figure::at_most(
            format!(
                "coated: 75 to 85°, > 15°, mean ΔE over that of the plain continuation ({:.3})",
                c.ways[0][1]
            ),
            c.kept[1] / c.ways[0][1],
            0.5,
            Some(SEED),
        )
    });
    all.iter()
        .map(|r| {
            let [mean, p95, most] = r.values;
            Figure::said(
                format!(
                    "{}: {}, {} 15°, ΔE mean / 95 % / max of {}",
                    r.paint,
                    r.zone,
                    if r.beyond { ">" } else { "≤" },
                    r.cells
                ),
                format!("{mean:.3} / {p95:.3} / {most:.3}"),
                &r.bound.map_or_else(|| "stated".to_owned(), |b| format!("≤ {b}")),
                Some(SEED),
                r.bound.is_none_or(|b| mean <= b),
            )
        })
        .chain(coated)
        .collect()
}

/// Parts of σ that differ from cell to cell whatever the directions.
const INDEPENDENT: [&str; 4] = ["shot", "read", "dark", "reference"];

/// z of the independent part, made of `parts`, with the common scale removed: root mean square, share within 1.96, values.
pub fn scores(
    known: &Description,
    errors: &Misalignment,
    paint: &Paint,
    tilts: &[f64],
    parts: &[&str],
) -> (f64, f64, usize) {
    let mut bench = BenchScan::new(known, errors, SEED);
    let white = bench.white(tilts);
    let (t, _) = bench.table(&white, &paint.sample(), tilts, Options { fill: false, ..Options::default() });
    let mut pairs = Vec::new();
    for i in (0..t.grid.len()).filter(|&i| t.flag[i] == Flag::Measured) {
        let cell = t.grid.coordinates(i);
        let [ti, to, phi] = cell;
        // the cap is one cell, whatever its azimuth says
        if (to == 0 && phi > 0) || t.grid.geometry(ti, to, phi).from_mirror().degrees() <= 15.0 {
            continue;
        }
        let truth = paint.cell_mean(&t.grid, t.meaning, cell);
        for c in 0..3 {
            let independent: f64 =
                parts.iter().filter_map(|p| t.sigma_parts.get(*p)).map(|p| f64::from(p[i][c]).powi(2)).sum();
            pairs.push((f64::from(t.values[i][c]) / truth[c], independent.sqrt() / truth[c]));
        }
    }
    let weight = |s: f64| 1.0 / (s * s);
    let scale =
        pairs.iter().map(|p| p.0 * weight(p.1)).sum::<f64>() / pairs.iter().map(|p| weight(p.1)).sum::<f64>();
    let z: Vec<f64> = pairs.iter().map(|p| (p.0 / scale - 1.0) / p.1).collect();
    let n = z.len().max(1) as f64;
    let rms = (z.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
    (rms, z.iter().filter(|v| v.abs() <= 1.959_964).count() as f64 / n, z.len())
}

/// Whether the independent part of σ is true, on the aligned instrument and on the misaligned one as calibrated.
pub fn sigma() -> Vec<Figure> {
    let nominal = builtin::description("reference").expect("built in").expect("readable");
    let errors = builtin::misalignment().expect("built in");
    let calibrated = crate::geometry::calibrated();
    // what a calibration leaves open of the directions is another error of each cell; on the aligned instrument there is none
    let with_angle = [&INDEPENDENT[..], &["angle"]].concat();
    let mut out = Vec::new();
    for (on, d, errors, parts, tilts) in [
        ("aligned", &nominal, &Misalignment::default(), &INDEPENDENT[..], &[20.0, 50.0][..]),
        ("calibrated", &calibrated, &errors, &with_angle, &WHOLE),
    ] {
        for (name, paint) in paints().into_iter().take(2) {
            let (rms, share, n) = scores(d, errors, &paint, tilts, parts);
            out.push(Figure::within(
                format!("{name}, {on}: z of the independent part ({}), r.m.s. of {n}", parts.join(", ")),
                rms,
                0.95,
                1.05,
                Some(SEED),
            ));
            let held = format!("{name}, {on}: 95 % intervals that hold");
            out.push(Figure::within(held, share, 0.93, 0.97, Some(SEED)));
        }
    }
    out
}
