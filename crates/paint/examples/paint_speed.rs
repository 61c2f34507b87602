//! How fast slices are read from disk and a paint is evaluated: `cargo run --release -p gonio-paint --example paint_speed`.

use std::sync::Arc;
use std::time::Instant;

use gonio_brdf::{Brdf as _, Coat, models::CookTorranceLobe};
use gonio_optics::{Angle, Geometry};
use gonio_paint::btf_folder::{SliceFormat, read_btf_folder, write_btf_folder};
use gonio_paint::car_paint::{ColourTable, FlakeSlices, Flakes, Through, read_paint, write_paint};
use gonio_paint::{CarPaint, CarPaintParts, FlakeBtf};

fn angles(n: u32, step: f64) -> Vec<Angle> {
    (0..n).map(|k| Angle::from_degrees(f64::from(k) * step)).collect()
}

#[allow(clippy::print_stdout)] // an example that prints figures
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (half, incidence, side) = (24u32, 25u32, 128usize);
    let mut state = 1u64;
    let texels = (0..half as usize * incidence as usize * side * side)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let v = (state >> 40) as f32 / 16_777_216.0;
            [v * v * v, 0.8 * v * v * v, 0.1 * v]
        })
        .collect();
    let btf = FlakeBtf::new(angles(half, 1.7), angles(incidence, 1.6), [side, side], texels)?;
    let folder = std::env::temp_dir().join(format!("gonio-paint-speed-{}", std::process::id()));
    println!(
        "{half} × {incidence} slices of {side} × {side} texels, {} threads",
        rayon::current_num_threads()
    );
    for format in [SliceFormat::Exr, SliceFormat::ExrHalf, SliceFormat::Png] {
        let place = folder.join(format!("{format:?}"));
        write_btf_folder(&place, &btf, 0.02, Some(1.5), Through::TwoWay, format, true)?;
        let mut best = f64::INFINITY;
        for _ in 0..5 {
            let begun = Instant::now();
            let read = read_btf_folder(&place)?;
            best = best.min(begun.elapsed().as_secs_f64());
            assert_eq!(read.btf.size(), btf.size());
        }
        println!("  {format:?}: {:.0} ms to read", 1e3 * best);
    }
    std::fs::remove_dir_all(&folder)?;
    let chi = vec![[0.9f32, 1.0, 1.1]; 24 * 16];
    let paint = CarPaint::new(CarPaintParts {
        name: "speed".to_owned(),
        coat: Some(Coat { index: 1.5 }),
        diffuse: [0.02; 3],
        lobes: [0.4, 0.2, 0.08].map(|alpha| CookTorranceLobe { specular: [0.2; 3], alpha, r0: 0.5 }).to_vec(),
        colour: Some(ColourTable::new(angles(24, 1.7), angles(16, 2.6), chi)?),
        flakes: Some(Flakes::Slices(FlakeSlices::new(Arc::new(btf), 0.02)?)),
        ..CarPaintParts::default()
    })?;
    let begun = Instant::now();
    let bytes = write_paint(&paint, &serde_json::Map::new())?;
    let written = begun.elapsed();
    let begun = Instant::now();
    let (back, _) = read_paint(&bytes)?;
    println!(
        "file of {:.0} MB: {written:.0?} to write, {:.0?} to read, in memory",
        bytes.len() as f64 / 1e6,
        begun.elapsed()
    );
    assert_eq!(back.parts().name, paint.parts().name);
    let pairs: Vec<_> = (0..4096)
        .map(|k| {
            let u = |base: f64| (f64::from(k) * base).fract();
            Geometry::from_degrees(75.0 * u(0.754_877_666), 75.0 * u(0.569_840_29), 180.0 * u(0.381_966_011))
                .directions()
        })
        .collect();
    let lobes = gonio_brdf::models::CookTorrance { diffuse: [0.02; 3], lobes: paint.parts().lobes.clone() };
    let coat = Coat { index: 1.5 };
    let (mut mean, mut placed, mut model) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let mut sum = 0.0;
    for _ in 0..20 {
        let mut time = |best: &mut f64, f: &dyn Fn(usize) -> f64| {
            let begun = Instant::now();
            sum += (0..pairs.len()).map(f).sum::<f64>();
            *best = best.min(1e9 * begun.elapsed().as_secs_f64() / pairs.len() as f64);
        };
        time(&mut model, &|k| coat.base_through(&lobes, pairs[k].0, pairs[k].1)[1]);
        time(&mut mean, &|k| paint.eval(pairs[k].0, pairs[k].1)[1]);
        time(&mut placed, &|k| {
            paint.eval_at(pairs[k].0, pairs[k].1, [0.013 * k as f64, 0.029 * k as f64])[1]
        });
    }
    println!(
        "an evaluation, one thread: {mean:.0} ns mean, {placed:.0} ns with its own flakes; the same lobes under the coat alone {model:.0} ns (checksum {sum:.3e})"
    );
    Ok(())
}
