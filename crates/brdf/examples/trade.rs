//! The price of each step from a 3-D table to a 1-D one: mean CIEDE2000 and ns per evaluation on measured effect coatings.
//!
//! `GONIO_DATA=… cargo run --release -p gonio-brdf --example trade [FILTER]` prints one line a material, means over all, and times measured in
//! the same run. Geometries: θ ≤ 75°, more than 15° from the mirror direction, uniform by solid angle; fitted and judged on different ones.
//! Colours are those of R = π f without the gloss of a lamp.
#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use gonio_brdf::maps::{
    Aspecular, ColourMap, FlakeFitOptions, FlakeMap, LookupTable, Region, Sample, Setting, Transform,
    colour_map,
};
use gonio_brdf::{Brdf, Rgb, formats};
use gonio_optics::{Angle, Vec3, colour, isoline::Method};

const INDEX: f64 = 1.5;
const FITTED: usize = 30_000;
const JUDGED: usize = 10_000;
const TIMED: usize = 20_000;
const BATCHES: usize = 15;
const NETWORKS: [&str; 13] = [
    "blue-metallic-paint",
    "blue-metallic-paint2",
    "color-changing-paint1",
    "color-changing-paint2",
    "color-changing-paint3",
    "gold-metallic-paint",
    "gold-metallic-paint2",
    "gold-metallic-paint3",
    "green-metallic-paint",
    "green-metallic-paint2",
    "red-metallic-paint",
    "silver-metallic-paint",
    "silver-metallic-paint2",
];

type Failure = Box<dyn std::error::Error>;

fn materials(data: &Path) -> Vec<(String, PathBuf)> {
    let mut all: Vec<_> =
        NETWORKS.iter().map(|n| ((*n).to_owned(), data.join(format!("nbrdf/merl_nbrdf.f32#{n}")))).collect();
    for file in ["rgl/cc_ibiza_sunset_rgb.bsdf", "rgl/satin_rosaline_rgb.bsdf", "mbsdf/carpaint_blue.mbsdf"] {
        all.push((file.to_owned(), data.join(file)));
    }
    all
}

/// Mean CIEDE2000 of what `f` says against the samples' own values.
fn mean_error(judged: &[Sample], f: impl Fn(&Sample) -> Rgb) -> f64 {
    let one = |s: &Sample| colour::ciede2000(colour::lab_from_brdf(f(s)), colour::lab_from_brdf(s.value));
    judged.iter().map(one).sum::<f64>() / judged.len() as f64
}

fn variants() -> Vec<(String, FlakeFitOptions)> {
    let mut out = Vec::new();
    let (log, root) = (Transform::Log, Transform::CubeRoot);
    let base = FlakeFitOptions { index: INDEX, transform: root, ..FlakeFitOptions::default() };
    for (tag, options, terms) in [
        ("D", FlakeFitOptions { transform: log, ..base }, 4),
        ("root", base, 4),
        ("flat-", FlakeFitOptions { edge: Setting::Fixed(0.0), ..base }, 3),
        ("64-", FlakeFitOptions { nodes: [64, 64], ..base }, 3),
        ("l3-", FlakeFitOptions { smoothness: Setting::Fixed(1e-3), ..base }, 3),
    ] {
        out.extend((0..terms).map(|k| (format!("{tag}{k}"), FlakeFitOptions { harmonics: k, ..options })));
    }
    out
}

/// All errors of one material, by name.
fn errors(brdf: &dyn Brdf) -> Result<Vec<(String, f64)>, Failure> {
    let region = Region::default();
    let judged = region.of_brdf(brdf, JUDGED, 1);
    let fitted = region.of_brdf(brdf, FITTED, 0);
    // what no map with both symmetries can follow: f against its mean over them
    let symmetric = |s: &Sample| {
        let turned = |d: Vec3| Vec3::new(d.x, -d.y, d.z);
        let all = [
            s.value,
            brdf.eval(s.view, s.light),
            brdf.eval(turned(s.light), turned(s.view)),
            brdf.eval(turned(s.view), turned(s.light)),
        ];
        [0, 1, 2].map(|c| 0.25 * all.iter().map(|f| f[c]).sum::<f64>())
    };
    let by = |m: &dyn Brdf| mean_error(&judged, |s| m.eval(s.light, s.view));
    let mut out = Vec::new();
    out.push(("asp".to_owned(), by(&Aspecular::from_brdf(brdf, Angle::from_degrees(45.0), region.largest))));
    out.push(("floor".to_owned(), mean_error(&judged, symmetric)));
    let direct = |s: &Sample| colour_map::at_equivalent(brdf, s, INDEX, Method::Clip, region.largest);
    out.push(("A-dir".to_owned(), mean_error(&judged, direct)));
    let mut map = ColourMap::from_brdf(brdf, INDEX, Method::Clip, region.largest, 128);
    for (tag, method) in [
        ("A", Method::Clip),
        ("B", Method::MapVector),
        ("B||", Method::MapVectorParallel),
        ("C", Method::UnitIndex),
    ] {
        map = map.with_method(method);
        out.push((tag.to_owned(), by(&map)));
    }
    for (tag, options) in variants() {
        out.push((tag, by(&FlakeMap::fit("trade", &fitted, &options)?)));
    }
    out.push(("3-D".to_owned(), by(&LookupTable::from_brdf(brdf, [19, 37, 36]))));
    Ok(out)
}

/// Median ns per evaluation over batches.
fn time<D: Copy>(directions: &[(D, D)], f: impl Fn(D, D) -> f32) -> f64 {
    let mut each: Vec<f64> = (0..BATCHES)
        .map(|_| {
            let start = Instant::now();
            black_box(directions.iter().map(|&(l, v)| f(l, v)).sum::<f32>());
            start.elapsed().as_secs_f64() * 1e9 / directions.len() as f64
        })
        .collect();
    each.sort_by(f64::total_cmp);
    each[BATCHES / 2]
}

fn times(brdf: &dyn Brdf) -> Result<(), Failure> {
    // no region: the directions of a scene come in no order, so neighbours in the list must not be neighbours in the table
    let everywhere = Region { largest: Angle::from_degrees(89.0), from_mirror: Angle::ZERO };
    let double: Vec<_> = everywhere.directions(TIMED, 3).collect();
    let single: Vec<_> = double
        .iter()
        .map(|(l, v)| (l.to_array().map(|x| x as f32), v.to_array().map(|x| x as f32)))
        .collect();
    let table = LookupTable::from_brdf(brdf, [19, 37, 36]);
    let base = time(&single, |l, v| table.eval_single(l, v)[1]);
    let line = |tag: &str, ns: f64, bytes: usize| {
        println!(
            "{tag:>6} {ns:>8.1} ns {:>7.1} million/s {:>6.2} x table {bytes:>8} bytes",
            1e3 / ns,
            base / ns
        );
    };
    line("3-D", base, table.bytes());
    let map = ColourMap::from_brdf(brdf, INDEX, Method::Clip, Angle::from_degrees(75.0), 128);
    line("A", time(&double, |l, v| map.eval(l, v)[1] as f32), map.bytes());
    let fitted = Region::default().of_brdf(brdf, FITTED, 0);
    for (tag, options) in variants() {
        let map = FlakeMap::fit("trade", &fitted, &options)?;
        line(&tag, time(&single, |l, v| map.eval_single(l, v)[1]), map.bytes());
        let (light, view): (Vec<_>, Vec<_>) = single.iter().copied().unzip();
        let mut out = vec![[0.0; 3]; light.len()];
        let mut each: Vec<f64> = (0..BATCHES)
            .map(|_| {
                let start = Instant::now();
                map.eval_many(black_box(&light), black_box(&view), &mut out);
                black_box(&mut out);
                start.elapsed().as_secs_f64() * 1e9 / light.len() as f64
            })
            .collect();
        each.sort_by(f64::total_cmp);
        line("many", each[BATCHES / 2], map.bytes());
    }
    Ok(())
}

fn main() -> Result<(), Failure> {
    let data = PathBuf::from(
        std::env::var_os("GONIO_DATA").ok_or("set GONIO_DATA to the folder of reference data")?,
    );
    let filter = std::env::args().nth(1).unwrap_or_default();
    let mut sums: Vec<f64> = Vec::new();
    let mut count = 0.0;
    let mut last = None;
    for (name, path) in materials(&data).into_iter().filter(|(n, _)| n.contains(&filter)) {
        let loaded = formats::open(&path)?;
        let brdf = loaded.as_brdf().ok_or("a material without values between its measurements")?;
        let row = errors(brdf)?;
        if sums.is_empty() {
            let tags: Vec<_> = row.iter().map(|(t, _)| format!("{t:>6}")).collect();
            println!("{:>28} {}", "mean CIEDE2000", tags.join(" "));
            sums = vec![0.0; row.len()];
        }
        print_row(&name, row.iter().map(|(_, e)| *e));
        for (s, (_, e)) in sums.iter_mut().zip(&row) {
            *s += e;
        }
        count += 1.0;
        last = Some(loaded);
    }
    print_row("mean", sums.iter().map(|s| s / count));
    // the third column is fix A at the in-plane geometry itself, without a map's own error
    print_row("ratio of means to A-dir", sums.iter().map(|s| s / sums[2]));
    match last.as_ref().and_then(|l| l.as_brdf()) {
        Some(brdf) => times(brdf),
        None => Err(format!("no material has \"{filter}\" in its name").into()),
    }
}

fn print_row(name: &str, errors: impl Iterator<Item = f64>) {
    let cells: Vec<_> = errors.map(|e| format!("{e:>6.2}")).collect();
    println!("{name:>28} {}", cells.join(" "));
}
