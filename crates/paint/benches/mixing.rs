//! From slices on disk to a mixable paint, and mixtures realised a second.
//!
//! `cargo bench -p gonio-paint --bench mixing`
//!
//! Paints have 24 × 25 slices of 128 × 128 texels, EXR in half precision. Times are the least of several rounds, the files warm in the page cache. Golla & Klein name
//! 50 s for two paints and 103 s for three, and 28 frames a second while blending.

#![allow(clippy::print_stdout)]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use gonio_optics::Angle;
use gonio_paint::btf_folder::{SliceFormat, read_btf_folder, write_btf_folder};
use gonio_paint::car_paint::{ColourTable, FlakeSlices, Flakes, Through};
use gonio_paint::mixing::{Mixable, Part, Realisation};
use gonio_paint::statistics::{Cuboids, FlakeStatistics, StatisticsOptions, fidelity};
use gonio_paint::{CarPaint, CarPaintParts, FlakeBtf};

const SLICES: [usize; 2] = [24, 25];
const SIDE: usize = 128;

/// Ground with noise and flakes of a hue, their number and brightness by slice.
fn flakes(seed: u64) -> FlakeBtf {
    let angles =
        |n: usize| (0..n).map(|k| Angle::from_degrees(40.0 * k as f64 / (n - 1) as f64)).collect::<Vec<_>>();
    let mut state = seed;
    let mut unit = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as f32 + 0.5) / (1_u64 << 31) as f32
    };
    let hue = [0.3 + 0.2 * seed as f32, 0.8, 1.3 - 0.3 * seed as f32].map(|v| v.clamp(0.1, 1.0));
    let mut texels = Vec::with_capacity(SLICES[0] * SLICES[1] * SIDE * SIDE);
    for h in 0..SLICES[0] {
        for _ in 0..SLICES[1] {
            let fall = (-(h as f32 / 6.0)).exp();
            for _ in 0..SIDE * SIDE {
                let ground = (0.02 + 0.5 * fall) * (1.0 + 0.5 * (unit() + unit() - 1.0));
                let bright = if unit() < 0.01 + 0.05 * fall { 0.3 / unit().max(0.01) } else { 0.0 };
                let tint = unit();
                texels.push([0, 1, 2].map(|c: usize| {
                    hue[c] * (ground + bright * if c == 1 { 1.0 } else { 0.6 + 0.4 * tint })
                }));
            }
        }
    }
    FlakeBtf::new(angles(SLICES[0]), angles(SLICES[1]), [SIDE, SIDE], texels).expect("sound")
}

fn paint(folder: &Path) -> Arc<CarPaint> {
    let read = read_btf_folder(folder).expect("read");
    let angles = || (0..24).map(|k| Angle::from_degrees(1.7 * f64::from(k))).collect::<Vec<_>>();
    let colour = ColourTable::new(angles(), angles(), vec![[1.0, 0.9, 0.8]; 576]).expect("sound");
    let slices = FlakeSlices::new(Arc::new(read.btf), read.texel_mm).expect("sound");
    let parts = CarPaintParts {
        diffuse: [0.1; 3],
        colour: Some(colour),
        flakes: Some(Flakes::Slices(slices)),
        ..CarPaintParts::default()
    };
    Arc::new(CarPaint::new(parts).expect("sound"))
}

fn least(rounds: usize, mut work: impl FnMut()) -> f64 {
    (0..rounds)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let folders: Vec<_> = (1..=3)
        .map(|seed| {
            let path = folder.path().join(format!("paint{seed}"));
            write_btf_folder(&path, &flakes(seed), 0.05, None, Through::TwoWay, SliceFormat::ExrHalf, false)
                .expect("written");
            path
        })
        .collect();
    let options = StatisticsOptions::default();
    let rounds = 5;
    for count in [2, 3] {
        let t = least(rounds, || {
            let paints: Vec<_> = folders[..count].iter().map(|f| paint(f)).collect();
            Mixable::new(&paints, &options).expect("mixable");
        });
        println!("{count} paints, slices on disk to mixable: {t:.3} s");
    }
    let read = least(rounds, || drop(read_btf_folder(&folders[0]).expect("read")));
    println!("  of this, one paint read: {read:.3} s");
    let btf = read_btf_folder(&folders[0]).expect("read").btf;
    let take = least(rounds, || drop(FlakeStatistics::of(&btf, &options).expect("statistics")));
    println!("  of this, statistics of one paint: {take:.3} s");
    let paints: Vec<_> = folders.iter().map(|f| paint(f)).collect();
    for count in [2, 3] {
        let m = Mixable::new(&paints[..count], &options).expect("mixable");
        let mut r = Realisation::default();
        let mut w = 0.0;
        let mixes = 200;
        let t = least(7, || {
            for _ in 0..mixes {
                w = (w + 0.013) % 1.0;
                let weights = [1.0 - w, 0.7 * w, 0.3 * w];
                m.realise(&weights[..count], Part::Everything, &mut r);
            }
        }) / f64::from(mixes);
        println!(
            "{count} paints, {} paths in {} slices: {:.0} mixtures a second on one thread ({:.0} µs)",
            m.paths(),
            m.slices(),
            1.0 / t,
            t * 1e6
        );
        println!(
            "  {} bytes mixable, {} bytes of textures",
            m.bytes(),
            count * SLICES[0] * SLICES[1] * SIDE * SIDE * 12
        );
    }
    for cuboids in [Cuboids::Moments, Cuboids::Tight] {
        let s = FlakeStatistics::of(&btf, &StatisticsOptions { cuboids, ..options }).expect("statistics");
        let f = fidelity(&btf, &s);
        println!(
            "{cuboids:?}: bytes 1 : {:.0}; drawn against measured, largest of slices: mean Lab {:.3}, deviation {:.2} %, mean of slices: deviation {:.2} %, distance {:.3}, mean Y {:.2} %, sparkle density {:.5} → {:.5}, contrast {:.2} → {:.2}",
            f.raw_bytes as f64 / f.bytes as f64,
            f.largest(|s| s.mean),
            100.0 * f.largest(|s| s.deviation),
            100.0 * f.mean(|s| s.deviation),
            f.mean(|s| s.distance),
            100.0 * f.mean(|s| s.luminance),
            f.mean(|s| s.original.density),
            f.mean(|s| s.rebuilt.density),
            f.mean(|s| s.original.contrast),
            f.mean(|s| s.rebuilt.contrast),
        );
    }
}
