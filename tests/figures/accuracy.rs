//! What comes out of the misaligned instrument once it is calibrated: colour differences by zone and paint, and whether σ is true.

use std::fmt::Write as _;
use std::path::Path;

use gonio_acquisition::Options;
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

/// The differences of one paint on an instrument with `errors`, reduced by the description `known`.
pub fn rows(name: &str, paint: &Paint, known: &Description, errors: &Misalignment) -> Vec<Row> {
    let mut bench = BenchScan::new(known, errors, SEED);
    let white = bench.white(&WHOLE);
    let (table, _) = bench.table(&white, &paint.sample(), &WHOLE, Options::default());
    let mut out = Vec::new();
    for (zone, flag, low, high, bound) in ZONES {
        for beyond in [true, false] {
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
                    let truth = paint.cell_mean(&table.grid, table.meaning, table.grid.coordinates(i));
                    let have = table.values[i].map(f64::from);
                    colour::ciede2000(colour::lab_from_brdf(have), colour::lab_from_brdf(truth))
                })
                .collect();
            all.sort_unstable_by(f64::total_cmp);
            let n = all.len();
            if n == 0 {
                continue;
            }
            let values = [all.iter().sum::<f64>() / n as f64, all[(n - 1) * 95 / 100], all[n - 1]];
            // the bound of 75 to 85° is one of coated paints
            let bound = bound.filter(|_| beyond && (flag != Flag::Extrapolated || paint.coated()));
            out.push(Row { paint: name.to_owned(), zone, beyond, values, cells: n, bound });
        }
    }
    out
}

/// The page `docs/accuracy.md`.
pub fn page(rows: &[Row]) -> String {
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
    text
}

/// Accuracy by zone and paint; the page is written anew.
pub fn figures() -> Vec<Figure> {
    let errors = builtin::misalignment().expect("built in");
    let known = crate::geometry::calibrated();
    let mut all = Vec::new();
    for (name, paint) in paints() {
        all.extend(rows(name, &paint, &known, &errors));
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/accuracy.md");
    std::fs::write(&path, page(&all)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
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
        .collect()
}

/// z of the independent part with the common scale removed: root mean square, share within 1.96, values.
pub fn scores(known: &Description, errors: &Misalignment, paint: &Paint, tilts: &[f64]) -> (f64, f64, usize) {
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
            let independent: f64 = ["shot", "read", "dark", "reference"]
                .iter()
                .filter_map(|p| t.sigma_parts.get(*p))
                .map(|p| f64::from(p[i][c]).powi(2))
                .sum();
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

/// Whether the independent part of σ is true.
pub fn sigma() -> Vec<Figure> {
    let d = builtin::description("reference").expect("built in").expect("readable");
    let mut out = Vec::new();
    for (name, paint) in paints().into_iter().take(2) {
        let (rms, share, n) = scores(&d, &Misalignment::default(), &paint, &[20.0, 50.0]);
        out.push(Figure::within(
            format!("{name}: z of the independent part, r.m.s. of {n}"),
            rms,
            0.95,
            1.05,
            Some(SEED),
        ));
        out.push(Figure::within(format!("{name}: 95 % intervals that hold"), share, 0.93, 0.97, Some(SEED)));
    }
    out
}
