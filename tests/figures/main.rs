//! The figures the project promises: each is measured here and printed with its bound, seed and the command that reproduces it.
//!
//! `make figures` prints all of them, `make figures ONLY=cells` those of one group; the exit code is 1 on a miss.

mod accuracy;
mod bench_scan;
mod car_paint;
mod coat;
mod common;
mod convergence;
mod demo;
mod fits;
mod flake_scan;
mod geometry;
mod isolines;
mod look_up;
mod maps;
mod materials;
mod mixing;
mod models;
mod multi_angle;
mod noise;
mod paints;
mod published;
mod published_tables;
mod radiometry;
mod rays;
mod scans;
mod scene_choice;
mod scene_plans;
mod sopp_method;

use std::process::ExitCode;

/// One measured figure.
pub struct Figure {
    name: String,
    value: String,
    bound: String,
    seed: String,
    met: bool,
}

impl Figure {
    /// A figure that must not exceed its bound.
    fn at_most(name: impl Into<String>, value: f64, bound: f64, seed: Option<u64>) -> Self {
        Self {
            name: name.into(),
            value: format!("{value:.4e}"),
            bound: format!("≤ {bound}"),
            seed: seed.map_or_else(|| "-".to_owned(), |s| s.to_string()),
            met: value <= bound,
        }
    }

    /// A figure that must lie in a range.
    fn within(name: impl Into<String>, value: f64, low: f64, high: f64, seed: Option<u64>) -> Self {
        Self {
            name: name.into(),
            value: format!("{value:.4}"),
            bound: format!("{low} … {high}"),
            seed: seed.map_or_else(|| "-".to_owned(), |s| s.to_string()),
            met: (low..=high).contains(&value),
        }
    }

    /// A figure that is met or not, in words.
    fn said(
        name: impl Into<String>,
        value: impl Into<String>,
        bound: &str,
        seed: Option<u64>,
        met: bool,
    ) -> Self {
        Self {
            name: name.into(),
            value: value.into(),
            bound: bound.to_owned(),
            seed: seed.map_or_else(|| "-".to_owned(), |s| s.to_string()),
            met,
        }
    }
}

type Group = (&'static str, fn() -> Vec<Figure>);

const GROUPS: &[Group] = &[
    ("models", models::figures),
    ("materials", materials::figures),
    ("published", published::figures),
    ("sopp-method", sopp_method::figures),
    ("convergence", convergence::figures),
    ("intervals", fits::intervals),
    ("three-lobes", fits::three_lobes),
    ("fit-speed", fits::speed),
    ("demo", demo::figures),
    ("paints", paints::demo_paint),
    ("cells", paints::cells),
    ("exponents", paints::exponents),
    ("hard-pairs", paints::hard_pairs),
    ("replay", paints::replay),
    ("coat", coat::figures),
    ("flake-scan", flake_scan::figures),
    ("geometry", geometry::figures),
    ("radiometry", radiometry::figures),
    ("radiometry-reference", radiometry::reference),
    ("accuracy", accuracy::figures),
    ("sigma", accuracy::sigma),
    ("common-part", common::figures),
    ("isolines", isolines::figures),
    ("flake-maps", maps::figures),
    ("look-up-speed", look_up::figures),
    ("multi-angle", multi_angle::figures),
    ("scene-choice", scene_choice::figures),
    ("scene-plans", scene_plans::figures),
    ("rays", rays::figures),
    ("car-paint", car_paint::figures),
    ("mixing", mixing::figures),
    ("mixing-speed", mixing::speed),
];

#[allow(clippy::print_stdout)] // the table is what this program is for
fn main() -> ExitCode {
    let only = std::env::args().nth(1).filter(|o| !o.is_empty());
    if let Some(o) = &only
        && !GROUPS.iter().any(|g| g.0 == o)
    {
        let names: Vec<&str> = GROUPS.iter().map(|g| g.0).collect();
        eprintln!("no figures \"{o}\"; there are {}", names.join(", "));
        return ExitCode::from(2);
    }
    let mut missed = 0;
    for (group, figures) in GROUPS.iter().filter(|g| only.as_deref().is_none_or(|o| o == g.0)) {
        println!("\n{group}   (make figures ONLY={group})");
        for f in figures() {
            let mark = if f.met { "ok  " } else { "MISS" };
            println!("  {mark} {:<58} {:<28} bound {:<14} seed {}", f.name, f.value, f.bound, f.seed);
            missed += usize::from(!f.met);
        }
    }
    if missed == 0 {
        ExitCode::SUCCESS
    } else {
        println!("\n{missed} figures missed");
        ExitCode::FAILURE
    }
}
