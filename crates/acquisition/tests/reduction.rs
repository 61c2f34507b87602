//! Frames of a compact forward model, reduced: what comes out is what went in, with an honest σ.

mod forward;

use std::sync::Arc;
use std::time::Instant;

use forward::{Noise, coarse, record};
use gonio_acquisition::{Options, PixelMap, Reducer, WhiteBuilder, WhiteReference};
use gonio_brdf::models::{AshikhminShirleySimplified, Lambert};
use gonio_brdf::{Brdf, Flag, Measured, average};
use gonio_instrument::{Certificate, Description, Pose, SampleRecord};

/// Electrons per second · sr.
const GAIN: f64 = 2.0e5;

fn white(
    map: &Arc<PixelMap>,
    d: &Description,
    options: &Options,
    noise: &mut Option<Noise>,
) -> WhiteReference {
    let diffuser = Lambert { diffuse: [0.98; 3] };
    let mut builder =
        WhiteBuilder::new(map.clone(), &Certificate::virtual_white(), Vec::new(), options).expect("builds");
    for (k, tilt) in [0.0, 25.0, 50.0, 70.0].into_iter().enumerate() {
        let t = 0.10 / f64::to_radians(tilt).cos();
        let r = record(d, &diffuser, k as u32, Pose::from_degrees(tilt, 0.0), GAIN, &[t, t, t, t], noise);
        builder.add_pose(&r).expect("adds");
    }
    builder.finish().expect("covers")
}

fn reduce(
    d: &Description,
    truth: &dyn Brdf,
    tilts: &[f64],
    options: Options,
    noise: &mut Option<Noise>,
) -> Measured {
    let map = Arc::new(PixelMap::new(d));
    let white = white(&map, d, &options, noise);
    let mut reducer = Reducer::new(map, white, SampleRecord::default(), options).expect("builds");
    for (k, &tilt) in tilts.iter().enumerate() {
        let r = record(
            d,
            truth,
            k as u32,
            Pose::from_degrees(tilt, 0.0),
            GAIN,
            &[0.0004, 0.003, 0.025, 0.2, 1.0],
            noise,
        );
        let start = Instant::now();
        let s = reducer.add_pose(&r).expect("adds").cloned();
        eprintln!("pose {k}: {:?} {s:?}", start.elapsed());
    }
    reducer.finish()
}

/// Errors of measured cells in units of σ and relative, with their place.
fn residuals(m: &Measured, truth: &dyn Brdf) -> Vec<([usize; 3], usize, f64, f64)> {
    let mut out = Vec::new();
    for i in 0..m.grid.len() {
        if m.flag[i] != Flag::Measured {
            continue;
        }
        let cell = m.grid.coordinates(i);
        let t = average::cell_mean(truth, &m.grid, m.meaning, cell, 6, 2);
        for c in [0, 1, 2] {
            let e = f64::from(m.values[i][c]) - t[c];
            out.push((cell, c, e / f64::from(m.sigma[i][c]), e / t[c]));
        }
    }
    out
}

fn shares(r: &[([usize; 3], usize, f64, f64)]) -> (f64, f64) {
    let within = |k: f64| r.iter().filter(|v| v.2.abs() <= k).count() as f64 / r.len() as f64;
    (within(1.0), within(3.0))
}

#[test]
fn a_lambertian_sample_gives_a_flat_table() {
    let d = coarse(4);
    let truth = Lambert { diffuse: [0.5, 0.3, 0.1] };
    let m = reduce(&d, &truth, &[0.0, 30.0, 60.0], Options::default(), &mut None);
    let r = residuals(&m, &truth);
    assert!(r.len() > 8000, "{}", r.len());
    let worst = r.iter().map(|v| v.3.abs()).fold(0.0, f64::max);
    // raw counts are whole numbers: that is all the noise there is
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn a_lobe_is_met_cell_by_cell_within_honest_uncertainty() {
    let d = coarse(2);
    let truth = AshikhminShirleySimplified { diffuse: [0.3, 0.2, 0.1], specular: [0.05; 3], exponent: 120.0 };
    let m = reduce(&d, &truth, &[30.0, 60.0], Options::default(), &mut Some(Noise(7)));
    let r = residuals(&m, &truth);
    let (one, three) = shares(&r);
    assert!(three >= 0.99 && (0.60..0.76).contains(&one), "1σ {one} 3σ {three}");
}
