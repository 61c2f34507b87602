//! How long a pose takes to trace and a frame to expose at 1280 × 1024, beside a baseline run in the same process: drawing one normal number
//! per pixel on one thread.
//!
//! `cargo bench -p gonio-sim --bench optics`

use std::hint::black_box;
use std::time::Instant;

use gonio_brdf::{Grid, Measured, ModelFile};
use gonio_instrument::{Misalignment, Pose, builtin};
use gonio_sim::optics::sensor::{Conditions, NoiseKey};
use gonio_sim::optics::{Sample, Sensor, VirtualOptics};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Median of five runs, ms.
fn median_ms(mut run: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..5)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[2]
}

fn model(json: &str) -> Result<Sample, Box<dyn std::error::Error>> {
    Ok(Sample::model(ModelFile::from_json(json)?))
}

#[allow(clippy::print_stdout)] // the report is what this program is for
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let d = builtin::description("reference").ok_or("no built-in reference instrument")??;
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let pixels = d.camera.pixels();
    let baseline = median_ms(|| {
        let sum: f32 = (0..pixels)
            .map(|_| {
                let z: f32 = StandardNormal.sample(&mut rng);
                z
            })
            .sum();
        black_box(sum);
    });
    println!("{:<34}{baseline:>9.1} ms", "baseline: a normal number a pixel");
    let report = |name: &str, ms: f64| println!("{name:<34}{ms:>9.1} ms {:>7.1} × baseline", ms / baseline);
    let pose = Pose::from_degrees(45.0, 0.0);
    let lobe = model(
        r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.1,0.1],"specular":[0.1,0.1,0.1],"exponent":120}"#,
    )?;
    let samples = [
        ("trace: white", Sample::diffuser(0.98)),
        (
            "trace: lobe, exponent 120",
            model(
                r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.1,0.1],"specular":[0.1,0.1,0.1],"exponent":120}"#,
            )?,
        ),
        (
            "trace: lobe, exponent 1300",
            model(
                r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.1,0.1],"specular":[0.1,0.1,0.1],"exponent":1300}"#,
            )?,
        ),
        (
            "trace: the same, coated",
            model(
                r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.1,0.1],"specular":[0.1,0.1,0.1],"exponent":1300,"coat":{"index":1.5}}"#,
            )?,
        ),
        ("trace: measured table", Sample::table(Measured::sampled(Grid::sopp(), lobe.base.as_ref()))),
        ("trace: black glass", Sample::glass(1.567)),
    ];
    for (name, sample) in &samples {
        report(name, median_ms(|| drop(black_box(optics.rate_map(pose, 0.0, sample)))));
    }
    let sensor = Sensor::new(&d, 1);
    let map = optics.rate_map(pose, 0.0, &samples[0].1);
    for (name, exposure_s) in [("expose: 20 µs", 2e-5), ("expose: 1 ms", 1e-3), ("expose: 50 ms", 0.05)] {
        let conditions = Conditions { exposure_s, lamp: 1.0, temperature_c: 35.0 };
        let key = NoiseKey { sample: 0, pose: (0, 0), exposure_ns: 0, shutter_open: true, repeat: 0 };
        report(name, median_ms(|| drop(black_box(sensor.expose(&map.rates, conditions, key)))));
    }
    Ok(())
}
