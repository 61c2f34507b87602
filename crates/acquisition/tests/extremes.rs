//! What the reduction makes of frames at the extremes: nothing but noise, nothing but clipped pixels, anything at all.

mod forward;

use std::sync::Arc;
use std::time::Duration;

use gonio_acquisition::dark::DarkModel;
use gonio_acquisition::lamp::Scatter;
use gonio_acquisition::merge::merge;
use gonio_acquisition::sensor::Sensor;
use gonio_acquisition::{Options, PixelMap, Reducer, WhiteReference};
use gonio_brdf::{Flag, Measured};
use gonio_instrument::{Description, Exposure, Frame, Pose, PoseRecord, SampleRecord, builtin};
use proptest::prelude::*;

fn tiny() -> Description {
    builtin::description("tiny").expect("known").expect("readable")
}

fn record(d: &Description, tilt_deg: f64, times: &[f64], raw: impl Fn(usize, usize) -> u16) -> PoseRecord {
    let pose = Pose::from_degrees(tilt_deg, 0.0);
    let exposures = times.iter().enumerate().map(|(k, &t)| Exposure {
        frame: Frame {
            width: d.camera.size[0],
            height: d.camera.size[1],
            pixels: (0..d.camera.pixels()).map(|p| raw(k, p)).collect(),
            exposure: Duration::from_secs_f64(t),
            sequence: k as u64,
            stamp: Duration::ZERO,
            sensor_temperature_c: None,
        },
        lamp_monitor: 1.0,
        shutter_open: true,
    });
    PoseRecord { index: 0, commanded: pose, readback: pose, exposures: exposures.collect() }
}

fn white(pixels: usize) -> WhiteReference {
    WhiteReference {
        scale: vec![2e5; pixels],
        relative_variance: vec![1e-6; pixels],
        certificate_uncertainty: 0.005,
        lamp: Scatter::default(),
        lamp_share: Vec::new(),
        serial: String::new(),
        notes: Vec::new(),
        stray_relative: 0.0,
        own_light: 0.0,
        law: Vec::new(),
    }
}

fn reduce(d: &Description, record: &PoseRecord) -> (Measured, f64) {
    let map = Arc::new(PixelMap::new(d));
    let white = white(d.camera.pixels());
    let mut reducer =
        Reducer::new(map, white, SampleRecord::default(), Options::default()).expect("settings");
    let share = reducer.add_pose(record).expect("a pose").expect("light").saturated_share;
    (reducer.finish(), share)
}

fn finite(m: &Measured) {
    for (i, (v, s)) in m.values.iter().zip(&m.sigma).enumerate() {
        assert!(v.iter().chain(s).all(|x| x.is_finite()), "{:?}: {v:?} {s:?}", m.grid.coordinates(i));
        assert!(s.iter().all(|x| *x >= 0.0) && (m.flag[i] == Flag::Measured || v.iter().all(|x| *x >= 0.0)));
    }
}

#[test]
fn frames_without_any_counts_give_zeros_with_the_noise_of_reading() {
    let d = tiny();
    let black = d.camera.black_level as u16;
    for tilt in [0.0, 30.0, 60.0] {
        let (m, share) = reduce(&d, &record(&d, tilt, &[1e-3, 1e-1], |_, _| black));
        finite(&m);
        assert_eq!(share, 0.0);
        let seen: Vec<usize> = (0..m.grid.len()).filter(|&i| m.flag[i] == Flag::Measured).collect();
        assert!(seen.len() > 200, "{}", seen.len());
        for i in seen {
            assert!(m.values[i].iter().all(|v| *v == 0.0) && m.sigma[i].iter().all(|s| *s > 0.0));
        }
    }
}

#[test]
fn frames_that_are_clipped_everywhere_measure_nothing_and_say_so() {
    let d = tiny();
    let top = d.camera.top_code() as u16;
    let (m, share) = reduce(&d, &record(&d, 30.0, &[1e-3, 1e-1], |_, _| top));
    finite(&m);
    assert_eq!(share, 1.0);
    assert!(!m.flag.contains(&Flag::Measured));
}

#[test]
fn the_direction_back_to_the_lamp_lies_behind_the_opening_and_is_filled() {
    let d = tiny();
    let black = d.camera.black_level as u16;
    let (m, _) = reduce(&d, &record(&d, 30.0, &[1e-2], |_, _| black + 500));
    finite(&m);
    let ti = m.grid.theta_i_deg.iter().position(|t| *t == 30.0).expect("a row");
    let to = m.grid.theta_o_deg.iter().position(|t| *t == 30.0).expect("a node");
    let at = m.grid.index(ti, to, 0);
    assert_eq!(m.flag[at], Flag::Filled);
    let beside = m.grid.index(ti, to, 20);
    assert_eq!(m.flag[beside], Flag::Measured);
    assert!(m.sigma[at][1] / m.values[at][1] > m.sigma[beside][1] / m.values[beside][1]);
}

#[test]
fn light_at_the_horizon_gives_finite_values() {
    let d = tiny();
    let black = d.camera.black_level as u16;
    let row = record(&d, 90.0, &[1e-2], |_, p| black + (p % 7) as u16);
    let map = Arc::new(PixelMap::new(&d));
    let white = white(d.camera.pixels());
    let mut reducer =
        Reducer::new(map, white, SampleRecord::default(), Options::default()).expect("settings");
    reducer.add_pose(&row).expect("a row of the grid");
    finite(&reducer.finish());
}

#[test]
fn cells_that_one_pixel_of_each_colour_tells_have_its_value_and_its_noise() {
    let d = tiny();
    let map = Arc::new(PixelMap::new(&d));
    let pose = Pose::from_degrees(30.0, 0.0);
    let view = map.view(pose);
    let w = map.width();
    let seen = |p: usize| {
        let theta = view.sample_from_lab.apply(map.direction(p)).z.acos().to_degrees();
        view.visible[p] && (35.0..45.0).contains(&theta)
    };
    // a block of the mosaic, whose second green is left out
    let block = (0..map.height() / 2)
        .flat_map(|y| (0..w / 2).map(move |x| 2 * y * w + 2 * x))
        .find(|p| [*p, p + 1, p + w, p + w + 1].into_iter().all(seen))
        .expect("some of the sample is seen at 40°");
    let mut of_colour = [None; 3];
    for p in [block, block + 1, block + w, block + w + 1] {
        of_colour[map.channel(p)].get_or_insert(p);
    }
    let mut white = white(d.camera.pixels());
    for (p, k) in white.scale.iter_mut().enumerate() {
        if !of_colour.contains(&Some(p)) {
            *k = f32::NAN;
        }
    }
    let (black, t, counts) = (d.camera.black_level as u16, 1e-2, [400, 700, 1000]);
    let raw = |_, p: usize| black + counts[map.channel(p)];
    let row = record(&d, 30.0, &[t], raw);
    let table = |min_coverage: f64| {
        let options = Options { min_coverage, fill: false, ..Options::default() };
        let mut reducer =
            Reducer::new(map.clone(), white.clone(), SampleRecord::default(), options).expect("settings");
        reducer.add_pose(&row).expect("a pose");
        reducer.finish()
    };
    let m = table(0.05);
    let told: Vec<usize> = (0..m.grid.len()).filter(|&i| m.flag[i] == Flag::Measured).collect();
    assert!(!told.is_empty() && told.len() < 40, "{}", told.len());
    let cos = view.theta_i.cos();
    for i in told {
        for (c, counts) in counts.iter().enumerate() {
            let electrons = f64::from(*counts) * d.camera.electrons_per_count();
            let wanted = electrons / t / (2e5 * cos);
            let (value, sigma) = (f64::from(m.values[i][c]), f64::from(m.sigma[i][c]));
            assert!((value / wanted - 1.0).abs() < 1e-3, "{value} {wanted}");
            // one pixel's noise of light at the least, and that of the certificate
            assert!(sigma / value > 1.0 / electrons.sqrt() && sigma / value < 0.5, "{sigma} {value}");
        }
    }
    // asked for more than they cover, they are holes
    assert!(!table(0.9).flag.contains(&Flag::Measured));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn whatever_the_frames_hold_a_merged_pixel_is_a_number_or_says_that_it_is_none(
        seed in any::<u64>(),
        level in prop_oneof![Just(0u64), Just(64), Just(3700), Just(4095), 0u64..4096],
        span in prop_oneof![Just(1u64), Just(300), Just(4096)],
        times in prop::collection::vec(prop_oneof![Just(2e-5), Just(2.0), 2e-5..2.0f64], 1..6),
    ) {
        let d = tiny();
        let (map, sensor) = (PixelMap::new(&d), Sensor::new(&d.camera, 0.9, &[1.0]));
        let n = d.camera.pixels();
        let raw = |k: usize, p: usize| {
            let z = (seed ^ (k as u64) << 32 ^ p as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ z >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            (level + (z >> 33) % span).min(4095) as u16
        };
        let r = record(&d, 30.0, &times, raw);
        let merged = merge(&r, &map, &sensor, &DarkModel::none(n), &vec![true; n]).expect("merges");
        for (p, m) in merged.pixels.iter().enumerate() {
            prop_assert!(!m.rate.is_nan(), "{p}");
            // a pixel is lost only where every exposure clips it or its neighbourhood
            if m.is_valid() {
                prop_assert!(m.exposure > 0.0 && m.read > 0.0 && m.shot >= 0.0 && m.dark >= 0.0, "{m:?}");
                prop_assert!([m.shot, m.read, m.dark, m.exposure].iter().all(|v| v.is_finite()));
            } else {
                prop_assert!((0..times.len()).all(|k| f32::from(raw(k, p)) >= 0.8 * sensor.saturated));
            }
        }
    }
}
