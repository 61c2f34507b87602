//! The numbers of `maps::Prior::GENERAL`: those under which what 87 networks of MERL materials say, given their eight portable geometries, is most
//! probable. The 13 metallic and colour-changing paints take no part: they judge the result.
//!
//! `GONIO_DATA=… cargo run --release -p gonio-brdf --example learn_prior [STEPS]` prints the best numbers found by a seeded random walk.
#![allow(clippy::print_stdout)]

use std::path::PathBuf;

use gonio_brdf::maps::{FlakeMap, Prior, Region, Sample, portable_geometries};
use gonio_brdf::{Brdf, formats};

type Failure = Box<dyn std::error::Error>;

/// Mean over materials and values of −log density in octaves of f, of a heavy-tailed distribution; and the spread that takes 95 % of values within two σ.
fn misfit(materials: &[(Vec<Sample>, Vec<Sample>)], prior: &Prior) -> Option<(f64, f64)> {
    let (mut each, mut all) = (Vec::new(), Vec::new());
    for (given, judged) in materials {
        let map = FlakeMap::from_multi_angle_with("", given, 1.5, prior).ok()?;
        let mut sum = 0.0;
        for s in judged {
            let (f, sigma) = (map.eval(s.light, s.view), map.sigma(s.light, s.view)?);
            for c in 0..3 {
                let (f, value) = (f[c].max(1e-6), s.value[c].max(1e-6));
                let octaves = sigma[c] / f * std::f64::consts::LOG2_E;
                let z = (value / f).log2() / octaves;
                // heavy tails: a few materials unlike all others must not decide
                sum += octaves.ln() + 2.5 * (1.0 + z * z / 4.0).ln();
                all.push(z.abs());
            }
        }
        each.push(sum / (3.0 * judged.len() as f64));
    }
    let mean = each.iter().sum::<f64>() / each.len() as f64;
    all.sort_by(f64::total_cmp);
    let spread = 0.5 * all.get(all.len() * 95 / 100)?;
    Some((mean, spread))
}

fn main() -> Result<(), Failure> {
    let data = PathBuf::from(
        std::env::var_os("GONIO_DATA").ok_or("set GONIO_DATA to the folder of reference data")?,
    );
    let steps: usize = std::env::args().nth(1).map_or(Ok(400), |s| s.parse())?;
    let names = std::fs::read_to_string(data.join("nbrdf/merl_nbrdf.names.txt"))?;
    let judged_elsewhere = |n: &str| {
        n.contains("color-changing-paint") || (n.contains("metallic-paint") && !n.contains("pearl"))
    };
    let mut materials = Vec::new();
    for name in names.split_whitespace().filter(|n| !judged_elsewhere(n)) {
        let loaded = formats::open(&data.join(format!("nbrdf/merl_nbrdf.f32#{name}")))?;
        let brdf = loaded.as_brdf().ok_or("a network without values")?;
        let given = portable_geometries()
            .map(|g| {
                let (light, view) = g.directions();
                Sample { light, view, value: brdf.eval(light, view), sigma: [0.0; 3], weight: 1.0 }
            })
            .to_vec();
        materials.push((given, Region::default().of_brdf(brdf, 100, 5)));
    }
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut best = Prior::GENERAL;
    let mut least = misfit(&materials, &best).ok_or("no estimate")?;
    println!("{} materials, start {least:?}", materials.len());
    for step in 0..steps {
        let size = 0.5 * (1.0 - step as f64 / steps as f64) + 0.03;
        let mut p = best;
        for x in [
            &mut p.slope,
            &mut p.profile,
            &mut p.profile_length,
            &mut p.change,
            &mut p.change_flake_length,
            &mut p.change_inc_length,
            &mut p.own,
            &mut p.weight,
        ] {
            if random() < 0.4 {
                *x *= (size * (2.0 * random() - 1.0)).exp();
            }
        }
        if let Some(m) = misfit(&materials, &p).filter(|m| m.0 < least.0) {
            (best, least) = (p, m);
        }
    }
    println!("mean −log density {}", least.0);
    println!("{:#?}", Prior { spread: best.spread * least.1, ..best });
    Ok(())
}
