//! A map from the eight geometries of portable instruments, judged by all geometries. Needs `GONIO_DATA`.
//!
//! The prior was learnt on the other 87 networks (`examples/learn_prior.rs`), so these 13 judge it. The state before: aspecular-only from the same six
//! geometries at 45°.

use gonio_brdf::{
    Brdf,
    maps::{Aspecular, FlakeFitOptions, FlakeMap, Region, Sample, portable_geometries},
};
use gonio_optics::{Angle, colour};
use gonio_tests::real_data;

use crate::Figure;
use crate::maps::{NETWORKS, mean_error, network, open};

/// All figures of multi-angle input.
pub fn figures() -> Vec<Figure> {
    let Some(data) = real_data("figures of multi-angle input") else {
        return vec![Figure::said("multi-angle", "GONIO_DATA is unset: did not run", "-", None, true)];
    };
    let (mut estimate, mut full, mut aspecular) = (0.0, 0.0, 0.0);
    let (mut within, mut twice, mut count, mut rank) = (0.0, 0.0, 0.0, 0.0);
    for name in NETWORKS {
        let loaded = open(&data, &network(name));
        let brdf = loaded.as_brdf().expect("a network has values");
        let region = Region::default();
        let judged = region.of_brdf(brdf, 3000, 1);
        let given: Vec<Sample> = portable_geometries()
            .iter()
            .map(|g| {
                let (light, view) = g.directions();
                Sample { light, view, value: brdf.eval(light, view), sigma: [0.0; 3], weight: 1.0 }
            })
            .collect();
        let map = FlakeMap::from_multi_angle(name, &given, 1.5).unwrap_or_else(|e| panic!("{name}: {e}"));
        let options = FlakeFitOptions { harmonics: 0, ..FlakeFitOptions::default() };
        let fitted = FlakeMap::fit(name, &region.of_brdf(brdf, 10_000, 0), &options)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let by = |b: &dyn Brdf| mean_error(&judged, |s| b.eval(s.light, s.view));
        estimate += by(&map) / 13.0;
        full += by(&fitted) / 13.0;
        aspecular += by(&Aspecular::from_brdf(brdf, Angle::from_degrees(45.0), region.largest)) / 13.0;
        // does a larger σ go with a larger error? ΔE of the more certain half against that of the less certain one
        let mut by_sigma: Vec<(f64, f64)> = Vec::new();
        for s in &judged {
            let (f, sigma) = (map.eval(s.light, s.view), map.sigma(s.light, s.view).expect("states σ"));
            for c in 0..3 {
                let z = (f[c].max(1e-6) / s.value[c].max(1e-6)).ln() / (sigma[c] / f[c].max(1e-6));
                within += f64::from(z.abs() < 1.0);
                twice += f64::from(z.abs() < 2.0);
                count += 1.0;
            }
            let error = colour::ciede2000(colour::lab_from_brdf(f), colour::lab_from_brdf(s.value));
            by_sigma.push((sigma[1] / f[1].max(1e-6), error));
        }
        by_sigma.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = by_sigma.len() / 2;
        let mean = |part: &[(f64, f64)]| part.iter().map(|p| p.1).sum::<f64>() / part.len() as f64;
        rank += mean(&by_sigma[half..]) / mean(&by_sigma[..half]) / 13.0;
    }
    vec![
        Figure::said(
            "mean ΔE from 8 geometries; full data, K = 0; aspecular-only",
            format!("{estimate:.2}; {full:.2}; {aspecular:.2}"),
            "below aspecular",
            Some(1),
            estimate < aspecular,
        ),
        Figure::within("share of values within one stated σ", within / count, 0.55, 0.85, Some(1)),
        Figure::within("share of values within two stated σ", twice / count, 0.88, 0.995, Some(1)),
        Figure::within(
            "ΔE of the less certain half over the more certain",
            rank,
            1.0,
            f64::INFINITY,
            Some(1),
        ),
    ]
}
