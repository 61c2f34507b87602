//! Frames to cells on one thread: five exposures of 2448 × 2048 × 3 sixteen-bit values, 150 MB, in one pass, against a copy of the same frames
//! (`memcpy`) and against a straightforward merge into two pictures that are gridded afterwards (`two passes`).
//!
//! The camera is a mosaic, so the three values of a place come as three poses of one tilt: the same bytes, and more places to weigh.
//! `cargo bench -p gonio-acquisition --bench throughput`; the three are run in turns, the last lines give minima, medians and ratios, by the wall's
//! clock and by the thread's own processor time, in which waiting for other programs does not count.
#![allow(clippy::print_stdout)] // the table is what this program is for

use std::hint::black_box;
use std::time::{Duration, Instant};

use gonio_acquisition::dark::{DarkFrames, DarkModel};
use gonio_acquisition::lamp::Scatter;
use gonio_acquisition::sensor::Sensor;
use gonio_acquisition::weights::Weights;
use gonio_acquisition::{PixelMap, Sweep, WhiteReference};
use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Brdf as _, Grid};
use gonio_instrument::{Exposure, Frame, Pose, PoseRecord, builtin};
use gonio_optics::{Angle, Vec3};
use rustix::time::{ClockId, clock_gettime};

const TURNS: usize = 25;
const TILT_DEG: f64 = 30.0;
const EXPOSURES_S: [f64; 5] = [3e-4, 2e-3, 1.5e-2, 0.1, 0.5];
const POSES: u64 = 3;
/// Electrons per second for 1/sr of a perfect lens.
const GAIN: f64 = 4e5;

/// Uniform in 0…1, one after the other.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A sum of four uniforms stands for a normal deviate.
    fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.next()).sum::<f64>() - 2.0) * 3f64.sqrt()
    }
}

fn frame(map: &PixelMap, rates: &[f32], t: f64, sequence: u64) -> Frame {
    let c = &map.description().camera;
    let (gain, black, top) = (c.electrons_per_count(), f64::from(c.black_level), f64::from(c.top_code()));
    let mut chance = Chance(0x9e37_79b9 + 7919 * sequence);
    let pixels = rates
        .iter()
        .map(|r| {
            let e = f64::from(*r) * t;
            let noisy = e + (e + c.read_noise_e * c.read_noise_e).sqrt() * chance.normal();
            (black + noisy / gain).round().clamp(0.0, top) as u16
        })
        .collect();
    Frame {
        width: c.size[0],
        height: c.size[1],
        pixels,
        exposure: Duration::from_secs_f64(t),
        sequence,
        stamp: Duration::ZERO,
        sensor_temperature_c: None,
    }
}

/// The straightforward way: rate and variance of every pixel in pictures of their own, then every list of the weights summed.
struct TwoPasses {
    dark: Vec<[f32; 2]>,
    hot: Vec<bool>,
    per_rate: Vec<f32>,
    rate: Vec<f32>,
    variance: Vec<f32>,
}

impl TwoPasses {
    fn run(&mut self, record: &PoseRecord, sensor: &Sensor, visible: &[bool], weights: &Weights) -> f64 {
        let frames: Vec<(&[u16], f32, f32)> = record
            .exposures
            .iter()
            .map(|e| {
                let t = e.frame.exposure.as_secs_f32();
                (e.frame.pixels.as_slice(), t, t * e.lamp_monitor as f32)
            })
            .collect();
        let gain = sensor.gain_e as f32;
        let zero = sensor.electrons(0) as f32;
        let read = sensor.read_variance_e2 as f32;
        for p in (0..self.rate.len()).filter(|&p| visible[p]) {
            let [mean, current] = self.dark[p];
            let each = || {
                frames.iter().filter(|f| f32::from(f.0[p]) < sensor.saturated).map(|(raw, t, x)| {
                    (gain * f32::from(raw[p]) + zero - mean - current * t, x, current.max(0.0) * t)
                })
            };
            let (mut signal, mut exposure) = (0.0, 0.0);
            for (s, x, _) in each() {
                signal += s;
                exposure += x;
            }
            let expected = (signal / exposure).max(0.0);
            let (mut num, mut den, mut square) = (0.0, 0.0, 0.0);
            for (s, x, d) in each() {
                let v = expected * x + d + read;
                let w = x / v;
                num += w * s;
                den += w * x;
                square += w * w * v;
            }
            let valid = den > 0.0 && !self.hot[p];
            self.rate[p] = if valid { num / den * self.per_rate[p] } else { f32::NAN };
            self.variance[p] = square / (den * den) * self.per_rate[p] * self.per_rate[p];
        }
        let mut total = 0.0;
        for bin in 0..weights.bins() {
            for channel in 0..3 {
                let (pixels, ws) = weights.list(bin, channel);
                let (mut value, mut variance, mut all) = (0.0, 0.0, 0.0);
                for (&p, &w) in pixels.iter().zip(ws) {
                    let f = self.rate[p as usize];
                    if f.is_finite() {
                        value += w * f;
                        variance += w * w * self.variance[p as usize];
                        all += w;
                    }
                }
                total += f64::from(value / all) + f64::from(variance);
            }
        }
        total
    }
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(bench);
}

fn bench() {
    let mut d = builtin::description("reference").expect("built in").expect("readable");
    d.camera.size = [2448, 2048];
    d.camera.pitch_um *= 0.5;
    let map = PixelMap::new(&d);
    let n = map.width() * map.height();
    let sensor = Sensor::new(&d.camera, 0.9, &[1.0]);
    let pose = Pose::from_degrees(TILT_DEG, 0.0);
    let view = map.view(pose);
    let light = Vec3::from_polar(view.theta_i, Angle::ZERO);
    let paint = AshikhminShirleySimplified {
        diffuse: [0.06, 0.13, 0.32],
        specular: [0.3, 0.35, 0.4],
        exponent: 40.0,
    };
    let rates: Vec<f32> = (0..n)
        .map(|p| {
            let v = view.sample_from_lab.apply(map.direction(p));
            if v.z <= 0.0 { 5.0 } else { (GAIN * paint.eval(light, v)[map.channel(p)] * light.z) as f32 }
        })
        .collect();
    let mut dark_frames = DarkFrames::default();
    for (k, t) in [2e-5, 2e-5, 0.5, 0.5].into_iter().enumerate() {
        let current: Vec<f32> = (0..n).map(|p| if p % 5003 == 17 { 4e3 } else { 3.0 }).collect();
        dark_frames.add(&frame(&map, &current, t, 900 + k as u64), &sensor);
    }
    let dark: DarkModel = dark_frames.model(&sensor, n);
    let white = WhiteReference {
        scale: vec![GAIN as f32; n],
        relative_variance: vec![1e-5; n],
        certificate_uncertainty: 0.0,
        lamp: Scatter::default(),
        lamp_share: Vec::new(),
        law: Vec::new(),
        stray_relative: 0.0,
        own_light: 0.0,
        serial: String::new(),
        notes: Vec::new(),
    };
    let records: Vec<PoseRecord> = (0..POSES)
        .map(|k| PoseRecord {
            index: k as u32,
            commanded: pose,
            readback: pose,
            exposures: EXPOSURES_S
                .iter()
                .enumerate()
                .map(|(j, &t)| Exposure {
                    frame: frame(&map, &rates, t, 10 * k + j as u64),
                    lamp_monitor: 1.0,
                    shutter_open: true,
                })
                .collect(),
        })
        .collect();
    let start = Instant::now();
    let weights = Weights::new(&map, &view, &Grid::sopp());
    let weighed = start.elapsed();
    let start = Instant::now();
    let sweep = Sweep::new(&map, &view, &weights, &white, light.z);
    let built = start.elapsed();
    println!(
        "weights of the tilt: {weighed:.1?}, runs of them: {built:.1?}, on one thread, once for all spins"
    );
    println!(
        "{} hot pixels; {:.1} % of the sensor see the sample, {:.1} % are merged; {} (pixel, cell) pairs, {} in lanes",
        dark.hot_pixels(),
        100.0 * sweep.visible_share(),
        100.0 * sweep.merged_share(),
        weights.len(),
        sweep.len()
    );
    let mut plain = TwoPasses {
        dark: (0..n).map(|p| (dark.at(p).0 as f32, dark.at(p).1 as f32).into()).collect(),
        hot: (0..n).map(|p| dark.is_hot(p)).collect(),
        per_rate: vec![(1.0 / (GAIN * light.z)) as f32; n],
        rate: vec![0.0; n],
        variance: vec![0.0; n],
    };
    let mut copies: Vec<Vec<u16>> =
        (0..POSES as usize * EXPOSURES_S.len()).map(|k| vec![k as u16; n]).collect();
    let mut times: [Vec<[f64; 2]>; 3] = Default::default();
    for _ in 0..TURNS {
        times[0].push(timed(|| {
            let frames = records.iter().flat_map(|r| &r.exposures);
            for (e, to) in frames.zip(&mut copies) {
                to.copy_from_slice(&e.frame.pixels);
            }
            black_box(&copies);
        }));
        times[1].push(timed(|| {
            for r in &records {
                black_box(plain.run(r, &sensor, &view.visible, &weights));
            }
        }));
        times[2].push(timed(|| {
            for r in &records {
                black_box(sweep.pose(r, &map, &sensor, &dark).expect("frames of this camera"));
            }
        }));
    }
    for (clock, by) in ["wall", "processor"].iter().enumerate() {
        let sorted = times.each_ref().map(|t| {
            let mut t: Vec<f64> = t.iter().map(|t| t[clock]).collect();
            t.sort_unstable_by(f64::total_cmp);
            t
        });
        for (name, t) in ["memcpy", "two passes", "one pass"].iter().zip(&sorted) {
            println!(
                "{by:<9} {name:<11} min {:6.1} ms, median {:6.1} ms, {:4.2} of memcpy (minima), {:4.2} (medians)",
                1e3 * t[0],
                1e3 * t[TURNS / 2],
                t[0] / sorted[0][0],
                t[TURNS / 2] / sorted[0][TURNS / 2]
            );
        }
    }
}

/// Seconds that something takes, by the wall's clock and of this thread's processor time.
fn timed(mut what: impl FnMut()) -> [f64; 2] {
    let processor = || {
        let t = clock_gettime(ClockId::ThreadCPUTime);
        t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
    };
    let (wall, used) = (Instant::now(), processor());
    what();
    [wall.elapsed().as_secs_f64(), processor() - used]
}
