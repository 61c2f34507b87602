//! Statistics against the textures they come from.

use gonio_optics::{Angle, colour::lab_from_brdf};

use super::*;
use crate::FlakeBtf;

fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    ((*state >> 33) as f64 + 0.5) / (1_u64 << 31) as f64
}

/// Dark blue ground with noise, and a few per cent of flakes, some of them very bright and of another hue.
pub(crate) fn flaky(slices: [usize; 2], side: usize, seed: u64) -> FlakeBtf {
    let angles = |n: usize| (0..n).map(|k| Angle::from_degrees(3.0 * k as f64)).collect::<Vec<_>>();
    let mut state = seed;
    let mut texels = Vec::new();
    for slice in 0..slices[0] * slices[1] {
        let ground = 0.02 + 0.2 / (1.0 + slice as f64);
        for _ in 0..side * side {
            let noise = 1.0 + 0.4 * (unit(&mut state) + unit(&mut state) - 1.0);
            let mut f = [0.2 * ground * noise, 0.4 * ground * noise, ground * noise];
            if unit(&mut state) < 0.03 {
                let bright = (1.0 - unit(&mut state)).powi(-1).min(60.0) * 0.2;
                let tint = unit(&mut state);
                f = [f[0] + bright * tint, f[1] + bright * 0.8, f[2] + bright * (1.0 - 0.5 * tint)];
            }
            texels.push(f.map(|v| v as f32));
        }
    }
    FlakeBtf::new(angles(slices[0]), angles(slices[1]), [side, side], texels).expect("sound")
}

#[test]
fn lab_in_lanes_is_lab() {
    let values: Vec<[f32; 3]> = (0..3000)
        .map(|k| {
            let x = k as f32 / 3000.0;
            [x * x * x * 60.0 - 0.001, x * 0.3, (1.0 - x) * 5.0]
        })
        .collect();
    let mut lab = [0; 3].map(|_| vec![0.0f32; values.len()]);
    let [l, a, b] = &mut lab;
    lab_from_brdf_lanes(&values, [l, a, b]);
    for (k, v) in values.iter().enumerate() {
        let exact = lab_from_brdf(v.map(f64::from));
        for (found, exact) in [(lab[0][k], exact.l), (lab[1][k], exact.a), (lab[2][k], exact.b)] {
            assert!(
                (f64::from(found) - exact).abs() < 1e-3 * (1.0 + 0.01 * exact.abs()),
                "{v:?}: {found} {exact}"
            );
        }
        let back = brdf_from_lab([exact.l, exact.a, exact.b]);
        assert!(
            (0..3).all(|c| (back[c] - f64::from(v[c])).abs() < 1e-6 * (1.0 + back[c].abs())),
            "{v:?} {back:?}"
        );
    }
}

#[test]
fn boxes_keep_mean_and_deviation_and_tight_ones_do_not() {
    let btf = flaky([3, 2], 96, 5);
    let worst = |cuboids| {
        let s = FlakeStatistics::of(&btf, &StatisticsOptions { clusters: 50, cuboids }).expect("statistics");
        let (mut mean, mut deviation) = (0.0_f64, 0.0_f64);
        for (k, slice) in btf.slices().enumerate() {
            let n = slice.len() as f64;
            let lab: Vec<[f64; 3]> = slice
                .iter()
                .map(|t| {
                    let lab = lab_from_brdf(t.map(f64::from));
                    [lab.l, lab.a, lab.b]
                })
                .collect();
            for (c, [m, d]) in s.moments(k).into_iter().enumerate() {
                let exact = lab.iter().map(|v| v[c]).sum::<f64>() / n;
                let variance = lab.iter().map(|v| (v[c] - exact).powi(2)).sum::<f64>() / n;
                mean = mean.max((m - exact).abs());
                deviation = deviation.max((d / variance.sqrt() - 1.0).abs());
            }
        }
        (mean, deviation)
    };
    let (mean, deviation) = worst(Cuboids::Moments);
    assert!(mean < 1e-3 && deviation < 1e-4, "{mean} {deviation}");
    let (mean, deviation) = worst(Cuboids::Tight);
    assert!(mean > 0.1 || deviation > 0.02, "tight boxes keep the moments here as well: {mean} {deviation}");
}

#[test]
fn what_is_drawn_looks_like_the_texture() {
    let btf = flaky([2, 3], 128, 6);
    let s = FlakeStatistics::of(&btf, &StatisticsOptions::default()).expect("statistics");
    let f = fidelity(&btf, &s);
    assert!(f.largest(|s| s.mean) < 0.1, "{f:?}");
    assert!(f.largest(|s| s.deviation) < 0.02, "{f:?}");
    assert!(f.largest(|s| s.distance) < 0.5, "{f:?}");
    for s in &f.slices {
        assert!((s.rebuilt.density / s.original.density - 1.0).abs() < 0.25, "{s:?}");
        assert!((s.rebuilt.contrast / s.original.contrast - 1.0).abs() < 0.25, "{s:?}");
    }
    assert!(f.bytes * 50 < f.raw_bytes, "{} of {}", f.bytes, f.raw_bytes);
}

#[test]
fn steps_are_whole_and_clusters_few_whatever_the_slice() {
    let one = |texels: Vec<[f32; 3]>, clusters| {
        let side = [texels.len(), 1];
        let zero = || vec![Angle::from_degrees(0.0)];
        let btf = FlakeBtf::new(zero(), zero(), side, texels).expect("sound");
        FlakeStatistics::of(&btf, &StatisticsOptions { clusters, ..StatisticsOptions::default() })
            .expect("statistics")
    };
    for texels in [
        vec![[0.0; 3]],
        vec![[0.0; 3]; 700],
        vec![[-0.01, 0.0, 0.02]; 3],
        vec![[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [1e4, 0.0, 0.0]],
        (0..1500).map(|k| [k as f32 * 1e-3, 0.1, 0.0]).collect(),
        (0..1500).map(|k| [if k == 77 { 1e3 } else { 0.01 }; 3]).collect(),
    ] {
        for clusters in [1, 2, 7, 50, 500] {
            let s = one(texels.clone(), clusters);
            let list = s.clusters(0);
            assert!(!list.is_empty() && list.len() <= clusters);
            assert_eq!(list.iter().map(|c| usize::from(c.steps)).sum::<usize>(), STEPS);
            assert!(list.iter().all(|c| c.steps > 0 && (0..3).all(|k| c.low[k] <= c.high[k])));
            assert_eq!(s.inverse(0).len(), STEPS);
            assert!(s.inverse(0).is_sorted());
        }
    }
    let zero = || vec![Angle::from_degrees(0.0)];
    let btf = FlakeBtf::new(zero(), zero(), [1, 1], vec![[0.0; 3]]).expect("sound");
    let error = FlakeStatistics::of(&btf, &StatisticsOptions { clusters: 0, ..StatisticsOptions::default() });
    assert_eq!(error, Err(StatisticsError::Clusters { found: 0 }));
    let parts =
        FlakeStatistics::new(zero(), zero(), &[vec![Cluster { low: [0.0; 3], high: [1.0; 3], steps: 3 }]]);
    assert!(matches!(parts, Err(StatisticsError::Parts { what: "steps of a slice", .. })));
}

#[test]
fn a_texel_shows_the_same_in_every_frame_and_changes_over_once_between_slices() {
    let btf = flaky([4, 4], 64, 7);
    let s = FlakeStatistics::of(&btf, &StatisticsOptions::default()).expect("statistics");
    let numbers = RandomTexture::shared();
    let mut changes = 0;
    for y in 0..16 {
        for x in 0..16 {
            let texel = numbers.at(x, y);
            let shown: Vec<u32> =
                (0..100).map(|k| s.chosen((1, f64::from(k) / 100.0), (2, 0.0), texel)).collect();
            let turns = shown.windows(2).filter(|w| w[0] != w[1]).count();
            assert!(turns <= 1, "{shown:?}");
            changes += turns;
            assert_eq!(s.draw(shown[3], texel), s.draw(shown[3], texel));
        }
    }
    assert!(changes > 200);
}

#[test]
fn the_random_texture_takes_each_value_once() {
    let t = RandomTexture::new(32, 1, 9);
    for channel in 0..3 {
        let mut values: Vec<f32> = t.numbers().iter().map(|n| n[channel]).collect();
        values.sort_by(f32::total_cmp);
        for (k, v) in values.iter().enumerate() {
            assert!((v - (k as f32 + 0.5) / 1024.0).abs() < 1e-6);
        }
    }
    let pairs = t.numbers();
    let correlation: f32 =
        pairs.iter().map(|n| (n[0] - 0.5) * (n[1] - 0.5)).sum::<f32>() / pairs.len() as f32 * 12.0;
    assert!(correlation.abs() < 0.1, "{correlation}");
}
