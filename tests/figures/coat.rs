//! A coated paint on the virtual instrument: index and gloss of its coat, and how near each zone of the table is to the truth.

use gonio::reduction;
use gonio_acquisition::{ClearCoat, Options, Verdict};
use gonio_brdf::models::{AshikhminShirleySimplified, Coat, Lambert};
use gonio_brdf::{Flag, Measured, Model, ModelFile, average};
use gonio_optics::colour;
use gonio_recording::Session;

use crate::Figure;
use crate::scans;

const SEED: u64 = 1;
const INDEX: f64 = 1.5;

/// Mean, 95th percentile and largest colour difference of the cells picked against the truth, and their number.
fn differences(table: &Measured, truth: &[[f64; 3]], pick: impl Fn(usize) -> bool) -> [f64; 4] {
    let mut all: Vec<f64> = (0..table.grid.len())
        .filter(|&i| pick(i))
        .map(|i| {
            let have = table.values[i].map(f64::from);
            colour::ciede2000(colour::lab_from_brdf(have), colour::lab_from_brdf(truth[i]))
        })
        .collect();
    all.sort_unstable_by(f64::total_cmp);
    let n = all.len();
    if n == 0 {
        return [f64::NAN, f64::NAN, f64::NAN, 0.0];
    }
    [all.iter().sum::<f64>() / n as f64, all[(n - 1) * 95 / 100], all[n - 1], n as f64]
}

fn beyond(table: &Measured, i: usize) -> bool {
    let [ti, to, phi] = table.grid.coordinates(i);
    table.grid.geometry(ti, to, phi).from_mirror().degrees() > 15.0
}

/// θi and θo of a cell, degrees.
fn polar(table: &Measured, i: usize) -> (f64, f64) {
    let [ti, to, _] = table.grid.coordinates(i);
    (table.grid.theta_i_deg[ti], table.grid.theta_o_deg[to])
}

/// All figures of coated paints.
pub fn figures() -> Vec<Figure> {
    let metallic = AshikhminShirleySimplified {
        diffuse: [0.06, 0.13, 0.32],
        specular: [0.3, 0.35, 0.4],
        exponent: 40.0,
    };
    let matt = Lambert { diffuse: [0.45, 0.2, 0.08] };
    [("metallic", Model::AshikhminShirleySimplified(metallic)), ("matt", Model::Lambert(matt))]
        .into_iter()
        .flat_map(|(name, model)| of_paint(name, model))
        .collect()
}

fn of_paint(name: &str, model: Model) -> Vec<Figure> {
    let file = ModelFile { model, coat: Some(Coat { index: INDEX }), fit: None };
    let (path, white) = scans::record(&format!("coated-{name}"), &file, SEED);
    let session = Session::open(&path).expect("a session");
    let instrument = session.instrument().expect("an instrument");
    let day = reduction::day_of(&session);
    let calibrated = reduction::calibrate(&[white], &instrument, &day, false).expect("a reference");
    let reduce =
        |options: &Options| reduction::reduce(&session, &calibrated, options, |_, _| {}).expect("reduced");
    let separated = reduce(&Options::default());
    let plain = reduce(&Options { clear_coat: ClearCoat::None, ..Options::default() }).table;
    let _ = std::fs::remove_file(&path);
    let Verdict::Coat(fit) = separated.reducer.coat() else {
        return vec![Figure::said(format!("{name}: the coat is found"), "no", "yes", Some(SEED), false)];
    };
    let table = separated.table;
    let truth: Vec<[f64; 3]> = (0..table.grid.len())
        .map(|i| average::model_cell_mean(&file, &table.grid, table.meaning, table.grid.coordinates(i)))
        .collect();
    let (low, high) = (INDEX - 0.005, INDEX + 0.005);
    let mut out = vec![
        Figure::within(format!("{name}: index of the coat"), fit.index, low, high, Some(SEED)),
        Figure::within(format!("{name}: gloss over Fresnel's"), fit.ratio, 0.98, 1.02, Some(SEED)),
    ];
    // θi = 90° lets no light into the coat
    let zone = |i: usize, flag: Flag, low: f64, high: f64| {
        let (ti, to) = polar(&table, i);
        table.flag[i] == flag && ti < 89.0 && (low..=high).contains(&to)
    };
    for (what, flag, low, high, bound) in [
        ("measured", Flag::Measured, 0.0, 75.0, Some(0.3)),
        ("filled", Flag::Filled, 0.0, 75.0, Some(0.6)),
        ("75-85 deg", Flag::Extrapolated, 75.1, 85.0, Some(1.0)),
        ("85-90 deg", Flag::Extrapolated, 85.1, 90.0, None),
    ] {
        for far in [true, false] {
            let bound = bound.filter(|_| far);
            let [mean, p95, max, n] =
                differences(&table, &truth, |i| zone(i, flag, low, high) && beyond(&table, i) == far);
            out.push(Figure::said(
                format!("{name}: {what}, {} 15°, ΔE mean / 95 % / max of {n}", if far { ">" } else { "≤" }),
                format!("{mean:.3} / {p95:.3} / {max:.3}"),
                &bound.map_or_else(|| "stated".to_owned(), |b| format!("≤ {b}")),
                Some(SEED),
                bound.is_none_or(|b| mean <= b),
            ));
        }
    }
    let grazing = |i: usize| zone(i, Flag::Extrapolated, 75.1, 85.0) && beyond(&table, i);
    let [ours, ..] = differences(&table, &truth, grazing);
    let [theirs, ..] = differences(&plain, &truth, grazing);
    out.push(Figure::at_most(
        format!("{name}: 75-85 deg, error over plain extrapolation's ({theirs:.2})"),
        ours / theirs,
        0.5,
        Some(SEED),
    ));
    for (what, flag) in
        [("measured", Flag::Measured), ("filled", Flag::Filled), ("extrapolated", Flag::Extrapolated)]
    {
        let cells = || (0..table.grid.len()).filter(|&i| zone(i, flag, 0.0, 90.0));
        let within = |i: usize| {
            let error = |c: usize| (f64::from(table.values[i][c]) - truth[i][c]).abs();
            (0..3).filter(|&c| error(c) <= 3.0 * f64::from(table.sigma[i][c])).count()
        };
        let share = cells().map(within).sum::<usize>() as f64 / (3 * cells().count()).max(1) as f64;
        let bounded = flag == Flag::Measured;
        out.push(Figure::said(
            format!("{name}: {what} cells within 3 σ"),
            format!("{share:.4}"),
            if bounded { "≥ 0.99" } else { "stated" },
            Some(SEED),
            !bounded || share >= 0.99,
        ));
    }
    out
}
