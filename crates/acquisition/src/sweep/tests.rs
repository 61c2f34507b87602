//! The one pass against the plain way: a picture of merged values, then every list summed pixel by pixel.

use std::time::Duration;

use gonio_brdf::Grid;
use gonio_instrument::{Exposure, Frame, Pose, PoseRecord, builtin};
use gonio_optics::Vec3;

use super::{Sweep, Swept};
use crate::cells::{PixelValue, per_rate, sum};
use crate::dark::{DarkFrames, DarkModel};
use crate::lamp::Scatter;
use crate::merge::shots::Shots;
use crate::merge::wide::{self, Plain, Task};
use crate::merge::{MergedPose, merge};
use crate::pixel_map::PixelMap;
use crate::reference::WhiteReference;
use crate::sensor::Sensor;
use crate::weights::Weights;

/// Uniform in 0…1, by place.
fn chance(seed: u64, p: usize) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (p as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 30)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z = (z ^ (z >> 27)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

struct Bench {
    map: PixelMap,
    white: WhiteReference,
    sensor: Sensor,
    dark: DarkModel,
    rates: Vec<f64>,
}

impl Bench {
    /// A sensor with hot pixels, a white reference with gaps, light that spans five decades about `spot`.
    fn new(linearity: &[f64], spot: Vec3, tilt_deg: f64) -> (Self, Pose) {
        let mut d = builtin::description("reference").expect("known").expect("readable");
        d.camera.size = d.camera.size.map(|n| n / 4);
        d.camera.pitch_um *= 4.0;
        let map = PixelMap::new(&d);
        let n = map.width() * map.height();
        let sensor = Sensor::new(&d.camera, 0.9, linearity);
        let white = WhiteReference {
            scale: (0..n)
                .map(|p| if chance(1, p) < 0.01 { f32::NAN } else { 1e5 * (1.0 + chance(2, p) as f32) })
                .collect(),
            relative_variance: (0..n).map(|p| 1e-5 * (1.0 + 0.2 * chance(3, p) as f32)).collect(),
            certificate_uncertainty: 0.0,
            lamp: Scatter::default(),
            lamp_share: Vec::new(),
            serial: String::new(),
            notes: Vec::new(),
            law: Vec::new(),
            stray_relative: 0.0,
            own_light: 0.0,
        };
        let pose = Pose::from_degrees(tilt_deg, 0.0);
        let view = map.view(pose);
        let rates = (0..n)
            .map(|p| {
                let v = view.sample_from_lab.apply(map.direction(p));
                let off = v.angle_to(spot.normalized()).degrees();
                500.0 + 3e8 * (-(off / 0.7).powi(2)).exp() + 3e4 * (-(off / 12.0).powi(2)).exp()
            })
            .collect();
        let mut out = Self { map, white, sensor, dark: DarkModel::none(n), rates };
        let hot = |p: usize| if chance(9, p) < 0.002 { 5e3 } else { 3.0 };
        let mut dark = DarkFrames::default();
        for (k, t) in [2e-5, 2e-5, 2e-5, 0.5, 0.5, 0.5].into_iter().enumerate() {
            dark.add(&out.frame(&|p| hot(p), t, 77 + k as u64), &out.sensor);
        }
        out.dark = dark.model(&out.sensor, n);
        assert!(out.dark.hot_pixels() > 20, "{}", out.dark.hot_pixels());
        (out, pose)
    }

    fn frame(&self, rate: &dyn Fn(usize) -> f64, t: f64, seed: u64) -> Frame {
        let c = &self.map.description().camera;
        let gain = c.electrons_per_count();
        let pixels = (0..self.map.width() * self.map.height())
            .map(|p| {
                let e = rate(p) * t;
                let noise = (chance(seed, p) + chance(seed + 1000, p) - 1.0) * (6.0 * (e + 9.0)).sqrt();
                (f64::from(c.black_level) + (e + noise) / gain).round().clamp(0.0, f64::from(c.top_code()))
                    as u16
            })
            .collect();
        Frame {
            width: c.size[0],
            height: c.size[1],
            pixels,
            exposure: Duration::from_secs_f64(t),
            sequence: seed,
            stamp: Duration::ZERO,
            sensor_temperature_c: None,
        }
    }

    fn record(&self, pose: Pose, times: &[f64]) -> PoseRecord {
        let exposures = times.iter().enumerate().map(|(k, &t)| Exposure {
            frame: self.frame(&|p| self.rates[p], t, k as u64),
            lamp_monitor: 1.0 + 0.003 * k as f64,
            shutter_open: true,
        });
        PoseRecord { index: 0, commanded: pose, readback: pose, exposures: exposures.collect() }
    }

    /// Holds the sweep against the plain way; how many lists saturate, and how many lost a pixel.
    fn hold(&self, pose: Pose, times: &[f64]) -> (usize, usize) {
        let (map, view) = (&self.map, self.map.view(pose));
        let weights = Weights::new(map, &view, &Grid::sopp());
        let sweep = Sweep::new(map, &view, &weights, &self.white, 0.8);
        let record = self.record(pose, times);
        let swept = sweep.pose(&record, map, &self.sensor, &self.dark).expect("sweeps");
        let merged = merge(&record, map, &self.sensor, &self.dark, &view.visible).expect("merges");
        assert_eq!(swept.saturated_share, merged.saturated_share);
        assert_eq!((swept.exposures, swept.lamp_relative), (merged.exposures, merged.lamp_relative));
        both_ways(&sweep, &Shots::of(&record, map.width(), &self.sensor, &self.dark).expect("light"));
        self.hold_picture(&sweep, &swept, &weights, &merged);
        let one = per_rate(map, &view, &self.white, 0.8);
        let plain: Vec<PixelValue> = (0..one.len())
            .map(|p| PixelValue::of(&merged.pixels[p], one[p], self.white.relative_variance[p]))
            .collect();
        let (mut saturated, mut gaps) = (0, 0);
        for bin in 0..weights.bins() {
            for c in 0..3 {
                let want = sum(&weights, &|p| plain[p], bin, c);
                let have = swept.sums[bin * 3 + c];
                // a saturated pixel of which the white reference knows nothing counts in no cell
                if want.saturated {
                    saturated += 1;
                    continue;
                }
                assert!(!have.saturated, "{bin} {c}");
                gaps += usize::from(want.valid < want.all);
                let near = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * b.abs() + 1e-30;
                let value = want.value.abs().max(want.shot.sqrt());
                assert!((have.value - want.value).abs() <= 3e-6 * value, "{bin} {c}: {have:?} {want:?}");
                for (a, b) in [(have.shot, want.shot), (have.read, want.read), (have.dark, want.dark)] {
                    assert!(near(a, b, 1e-5), "{bin} {c}: {have:?} {want:?}");
                }
                // the run's mean relative variance is within the span of its pixels'
                assert!(near(have.reference, want.reference, 0.2), "{bin} {c}: {have:?} {want:?}");
                assert!(near(have.w, want.w, 1e-6) && near(have.all, want.all, 1e-6), "{have:?} {want:?}");
                assert!((have.valid - want.valid).abs() <= 1e-6 * want.all, "{bin} {c}: {have:?} {want:?}");
            }
        }
        let seen = swept.window.rows().len() * swept.window.columns().len();
        for y in swept.window.rows() {
            for x in swept.window.columns() {
                let p = y * map.width() + x;
                let (have, want) = (swept.window.get(p), plain[p]);
                assert!(
                    have.f == want.f || (have.f.is_nan() && want.f.is_nan()),
                    "{p} of {seen}: {have:?} {want:?}"
                );
            }
        }
        (saturated, gaps)
    }
}

impl Bench {
    /// Holds a sweep against the sums of the picture that the merge alone gives.
    fn hold_picture(&self, sweep: &Sweep, swept: &Swept, weights: &Weights, merged: &MergedPose) {
        let picture = sweep.picture(merged, weights, &self.white.relative_variance);
        assert_eq!(picture.saturated_share, swept.saturated_share);
        assert_eq!((picture.exposures, picture.lamp_relative), (swept.exposures, swept.lamp_relative));
        for (list, (a, b)) in picture.sums.iter().zip(&swept.sums).enumerate() {
            assert!(!b.saturated || a.saturated || a.valid < a.all, "{list}: {a:?} {b:?}");
            if a.saturated {
                continue;
            }
            let value = a.value.abs().max(a.shot.sqrt());
            assert!((a.value - b.value).abs() <= 3e-6 * value, "{list}: {a:?} {b:?}");
            for (a, b) in [(a.shot, b.shot), (a.read, b.read), (a.dark, b.dark)] {
                assert!((a - b).abs() <= 1e-5 * a + 1e-30, "{list}: {a:e} {b:e}");
            }
            assert!((a.valid - b.valid).abs() <= 1e-6 * a.all, "{list}: {a:?} {b:?}");
        }
        assert_eq!(picture.window.rows(), swept.window.rows());
        for y in picture.window.rows() {
            for x in picture.window.columns() {
                let p = y * self.map.width() + x;
                let bits = |s: &Swept| {
                    let v = s.window.get(p);
                    [v.f, v.shot, v.read, v.dark, v.reference].map(f32::to_bits)
                };
                assert_eq!(bits(&picture), bits(swept), "{p}");
            }
        }
    }
}

/// Every band eight at a time and one after the other: the same to the last bit, which the shortest text of a number tells.
fn both_ways(sweep: &Sweep, shots: &Shots<'_>) {
    for band in &sweep.bands {
        let wide = wide::run(band.task(sweep, shots));
        let plain = band.task(sweep, shots).run(Plain);
        assert_eq!(format!("{wide:?}"), format!("{plain:?}"), "rows from {}", band.first_row);
    }
}

/// Towards the mirror direction, and aside of it.
const SPOTS: [Vec3; 2] = [Vec3 { x: -0.5, y: 0.0, z: 0.866 }, Vec3 { x: 0.1, y: 0.5, z: 0.8 }];

#[test]
fn one_pass_sums_as_the_plain_way_does() {
    for spot in SPOTS {
        let (bench, pose) = Bench::new(&[1.0], spot, 30.0);
        let (saturated, gaps) = bench.hold(pose, &[2e-5, 3e-4, 3e-3, 2e-2, 1e-1]);
        assert!(saturated == 0 && gaps > 500, "{saturated} {gaps}");
        // without the short ones the middle of the spot is lost
        let (saturated, _) = bench.hold(pose, &[2e-2, 1e-1]);
        assert!(saturated > 3, "{saturated}");
        // everything is
        let (saturated, _) = bench.hold(pose, &[200.0]);
        assert!(saturated > 5000, "{saturated}");
    }
}

#[test]
fn a_sensor_that_is_not_linear_goes_by_its_table() {
    let (bench, pose) = Bench::new(&[0.97, 0.03], SPOTS[0], 50.0);
    bench.hold(pose, &[2e-5, 3e-3, 1e-1]);
}
