//! Virtual paints: what the scan and the fit find against what they are.

use gonio_brdf::average::cell_mean;
use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Flag, ModelFile};
use gonio_optics::colour::{ciede2000, lab_from_brdf};

use crate::Figure;
use crate::scans::{self, Made};

const CHANNELS: [&str; 3] = ["r", "g", "b"];

/// The paint of `gonio demo`.
fn standard() -> AshikhminShirleySimplified {
    let file = ModelFile::from_json(gonio::rig::DEMO_PAINT).expect("the demo paint");
    match file.model {
        gonio_brdf::Model::AshikhminShirleySimplified(p) => p,
        other => panic!("the demo paint is {}", other.name()),
    }
}

/// Relative errors of exponent, cd and cs (the largest of three channels).
fn recovered(name: &str, made: &Made, seed: u64) -> Vec<Figure> {
    let fit = made.scanned.fit.as_ref().expect("a fit");
    let value = |n: &str| fit.parameter(n).map_or(f64::NAN, |p| p.value);
    let worst = |what: &str, truth: [f64; 3]| {
        (0..3).map(|c| (value(&format!("{what}_{}", CHANNELS[c])) / truth[c] - 1.0).abs()).fold(0.0, f64::max)
    };
    vec![
        Figure::at_most(
            format!("{name}: exponent {}, relative error", made.truth.exponent),
            (value("exponent") / made.truth.exponent - 1.0).abs(),
            0.02,
            Some(seed),
        ),
        Figure::at_most(
            format!("{name}: cd, largest relative error"),
            worst("diffuse", made.truth.diffuse),
            0.01,
            Some(seed),
        ),
        Figure::at_most(
            format!("{name}: cs, largest relative error"),
            worst("specular", made.truth.specular),
            0.03,
            Some(seed),
        ),
    ]
}

/// The demo paint with six seeds.
pub fn demo_paint() -> Vec<Figure> {
    let p = standard();
    let mut out = vec![Figure::said(
        "demo paint",
        format!("cd {:?} cs {:?} n {}", p.diffuse, p.specular, p.exponent),
        "printed",
        None,
        true,
    )];
    for seed in 1..=6 {
        let made = scans::make(&format!("demo-{seed}"), p, seed);
        out.extend(recovered("demo paint", &made, seed));
    }
    out
}

/// Exponents from satin to mirror-like; the three channels hold weak, middle and strong body and lobe.
pub fn exponents() -> Vec<Figure> {
    let mut out = Vec::new();
    for exponent in [21.0, 120.0, 410.0, 1300.0] {
        let truth =
            AshikhminShirleySimplified { diffuse: [0.03, 0.2, 0.5], specular: [0.4, 0.1, 0.01], exponent };
        let made = scans::make(&format!("exponent-{exponent}"), truth, 1);
        out.extend(recovered("cd 0.03/0.2/0.5, cs 0.4/0.1/0.01", &made, 1));
        out.extend(compared(&format!("n {exponent}"), &made, 1));
    }
    out
}

/// Pairs in which one part hides the other: the stated intervals (three standard uncertainties) must hold the truth.
pub fn hard_pairs() -> Vec<Figure> {
    let mut out = Vec::new();
    for (cd, cs) in [(0.5, 0.001), (0.005, 0.4)] {
        let truth = AshikhminShirleySimplified { diffuse: [cd; 3], specular: [cs; 3], exponent: 120.0 };
        let made = scans::make(&format!("hard-{cd}"), truth, 1);
        let fit = made.scanned.fit.as_ref().expect("a fit");
        for name in
            ["exponent", "diffuse_r", "diffuse_g", "diffuse_b", "specular_r", "specular_g", "specular_b"]
        {
            let is = match name.split('_').next() {
                Some("exponent") => truth.exponent,
                Some("diffuse") => cd,
                _ => cs,
            };
            let (low, high) = fit.interval(name, 3.0).unwrap_or((f64::NAN, f64::NAN));
            let p = fit.parameter(name).map_or(f64::NAN, |p| p.value);
            out.push(Figure::said(
                format!("cd {cd}, cs {cs}: {name} is {is}"),
                format!("{p:.5} in [{low:.5}, {high:.5}]"),
                "holds it (3 σ)",
                Some(1),
                (low..=high).contains(&is),
            ));
        }
    }
    out
}

/// Measured cells against the truth averaged over the same cells.
pub fn cells() -> Vec<Figure> {
    let made = scans::make("cells", standard(), 1);
    compared("demo paint", &made, 1)
}

fn compared(name: &str, made: &Made, seed: u64) -> Vec<Figure> {
    let t = &made.table;
    let (mut within, mut beyond) = (Vec::new(), Vec::new());
    let (mut one, mut three, mut count) = (0usize, 0usize, 0usize);
    for i in 0..t.grid.len() {
        if t.flag[i] != Flag::Measured {
            continue;
        }
        let cell = t.grid.coordinates(i);
        let g = t.grid.geometry(cell[0], cell[1], cell[2]);
        // fine enough for every exponent here: the rule is the plain product rule, not the one that the fit uses
        let near = g.from_mirror().degrees() < 25.0;
        let (nodes, rings) = if near { (12, 3) } else { (4, 1) };
        let truth = cell_mean(&made.truth, &t.grid, t.meaning, cell, nodes, rings);
        let value = t.values[i].map(f64::from);
        let d = ciede2000(lab_from_brdf(value), lab_from_brdf(truth));
        if g.from_mirror().degrees() <= 15.0 {
            within.push(d);
        } else {
            beyond.push(d);
        }
        for c in 0..3 {
            let z = (value[c] - truth[c]).abs() / f64::from(t.sigma[i][c]);
            one += usize::from(z <= 1.0);
            three += usize::from(z <= 3.0);
            count += 1;
        }
    }
    let share = |n: usize| 100.0 * n as f64 / count.max(1) as f64;
    let spread = |mut v: Vec<f64>| {
        v.sort_by(f64::total_cmp);
        let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
        let p95 = v.get((v.len() * 95 / 100).min(v.len().saturating_sub(1))).copied().unwrap_or(0.0);
        (mean, p95, v.last().copied().unwrap_or(0.0), v.len())
    };
    let (b, w) = (spread(beyond), spread(within));
    let words = |s: (f64, f64, f64, usize)| format!("{:.3} / {:.3} / {:.3} ({} cells)", s.0, s.1, s.2, s.3);
    vec![
        Figure::said(
            format!("{name}: ΔE beyond 15°, mean / 95th / max"),
            words(b),
            "mean ≤ 0.3",
            Some(seed),
            b.0 <= 0.3,
        ),
        Figure::said(
            format!("{name}: ΔE within 15°, mean / 95th / max"),
            words(w),
            "printed",
            Some(seed),
            true,
        ),
        Figure::within(
            format!("{name}: cells within 3 σ of the truth, %"),
            share(three),
            99.0,
            100.0,
            Some(seed),
        ),
        Figure::within(
            format!("{name}: cells within 1 σ of the truth, %"),
            share(one),
            60.0,
            76.0,
            Some(seed),
        ),
    ]
}

/// A replay against the live scan.
pub fn replay() -> Vec<Figure> {
    let made = scans::make("replayed", standard(), 1);
    let again = scans::path("again.nc");
    let words = [
        "gonio".into(),
        "replay".into(),
        made.session.clone().into_os_string(),
        "--reference".into(),
        scans::path("white-1.mcap").into_os_string(),
        "-o".into(),
        again.clone().into_os_string(),
        "--force".into(),
    ];
    let code = gonio::run(words);
    let same = code == std::process::ExitCode::SUCCESS
        && std::fs::read(&again).ok() == std::fs::read(made.session.with_extension("nc")).ok();
    vec![Figure::said(
        "replayed table against the live one",
        if same { "same bytes" } else { "differs" },
        "same bytes",
        Some(1),
        same,
    )]
}
