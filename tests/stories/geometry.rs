//! A misaligned virtual instrument looks at black glass, flat and on a wedge; the calibration, which shares no optics with it, finds its directions.

use std::sync::Arc;
use std::time::Duration;

use gonio_acquisition::geometry::edges::Edge;
use gonio_acquisition::geometry::{Problem, Settings, SpotFinder, horizon, solve, verdict};
use gonio_acquisition::merge::{Merged, MergedPose};
use gonio_acquisition::{Options, PixelMap};
use gonio_instrument::{Description, Exposure, Frame, Misalignment, Pose, PoseRecord, ScanKind, builtin};
use gonio_optics::{Angle, Vec3};
use gonio_sim::optics::sensor::{Conditions, NoiseKey};
use gonio_sim::optics::{Sample, Sensor, VirtualOptics};

use crate::command::Bench;

/// The reference optics before a camera of half the pixels a side.
fn half() -> Description {
    let mut d = builtin::description("reference").expect("built in").expect("readable");
    d.camera.size = d.camera.size.map(|n| n / 2);
    d.camera.pitch_um *= 2.0;
    d
}

/// A camera with pixels twice as large has its principal point half as many pixels off.
fn errors() -> Misalignment {
    let mut m = builtin::misalignment().expect("readable");
    m.principal_point_px = m.principal_point_px.map(|v| 0.5 * v);
    m.tilt_repeatability_deg = 0.0;
    m
}

fn expose(optics: &VirtualOptics, sensor: &Sensor, sample: &Sample, readback: Pose) -> PoseRecord {
    let actual = Pose { tilt: readback.tilt + Angle::from_degrees(errors().tilt_zero_deg), ..readback };
    let rates = optics.rate_map(actual, 0.0, sample);
    let pose = (readback.tilt.degrees() * 1e6, readback.spin.degrees() * 1e6);
    let key = NoiseKey {
        sample: sample.noise_key,
        pose: (pose.0 as i64, pose.1 as i64),
        exposure_ns: 20_000,
        shutter_open: true,
        repeat: 0,
    };
    let conditions = Conditions { exposure_s: 2e-5, lamp: 1.0, temperature_c: 35.0 };
    let frame = Frame {
        width: rates.width,
        height: rates.height,
        pixels: sensor.expose(&rates.rates, conditions, key),
        exposure: Duration::from_micros(20),
        sequence: 0,
        stamp: Duration::ZERO,
        sensor_temperature_c: Some(35.0),
    };
    let exposure = Exposure { frame, lamp_monitor: 1.0, shutter_open: true };
    PoseRecord { index: 0, commanded: readback, readback, exposures: vec![exposure] }
}

/// Largest errors of (θi, θo, angle between light and view), degrees, over pixels with θo up to 75°.
fn largest_errors(description: &Description) -> [f64; 3] {
    let m = errors();
    let optics = VirtualOptics::new(&half(), &m);
    let map = PixelMap::new(description);
    let sample = Sample::diffuser(0.5);
    let mut worst = [0.0f64; 3];
    for tilt in [5.0, 40.0, 70.0] {
        let (sample_from_lab, theta_i) = map.frame(Pose::from_degrees(tilt, 0.0));
        let light = Vec3::from_polar(theta_i, Angle::ZERO);
        for row in (5..half().camera.size[1]).step_by(29) {
            for column in (5..half().camera.size[0]).step_by(29) {
                let pose = Pose::from_degrees(tilt + m.tilt_zero_deg, 0.0);
                let Some(sight) = optics.trace_pixel(pose, &sample, column, row) else { continue };
                if sight.view.z < 75f64.to_radians().cos() {
                    continue;
                }
                let v = sample_from_lab.apply(map.direction((row * half().camera.size[0] + column) as usize));
                let off = [
                    theta_i.degrees() - sight.geometry.theta_i.degrees(),
                    v.angle_to(Vec3::Z).degrees() - sight.geometry.theta_o.degrees(),
                    light.angle_to(v).degrees() - sight.light.angle_to(sight.view).degrees(),
                ];
                for (w, o) in worst.iter_mut().zip(off) {
                    *w = w.max(o.abs());
                }
            }
        }
    }
    worst
}

#[test]
fn a_few_dozen_poses_of_black_glass_find_an_instrument_that_is_out_of_alignment() {
    let description = half();
    let optics = VirtualOptics::new(&description, &errors());
    let sensor = Sensor::new(&description, 3);
    let map = Arc::new(PixelMap::new(&description));
    let mut spots = Vec::new();
    let wedge = Sample::glass(1.567).on_wedge(Angle::from_degrees(21.3), Angle::from_degrees(180.0));
    for (kind, sample, tilts, spins) in [
        (ScanKind::BlackGlass, Sample::glass(1.567), vec![15.0, 30.0, 45.0, 60.0], 1),
        (ScanKind::BlackGlassWedge, wedge, vec![5.0, 25.0, 45.0], 8),
    ] {
        let mut finder = SpotFinder::new(map.clone(), &Options::default(), 1.567, [1.0; 3]);
        for tilt in tilts {
            for k in 0..spins {
                let readback = Pose::from_degrees(tilt, 45.0 * f64::from(k));
                let record = expose(&optics, &sensor, &sample, readback);
                if let Ok(spot) =
                    finder.find(&record, kind, &format!("{} {readback}", kind.name())).expect("frames")
                {
                    spots.push(spot);
                }
            }
        }
    }
    assert!(spots.len() >= 20, "only {} spots", spots.len());
    let settings = Settings::default();
    let problem = Problem { description: description.clone(), spots, edges: Vec::new() };
    let solution = solve(&problem, &settings).expect("enough spots");
    assert!(solution.converged && solution.rms_px < 0.1, "{}", solution.rms_px);
    let before = largest_errors(&description);
    let found =
        Description { calibration: Some(solution.estimate.instrument.clone()), ..description.clone() };
    let after = largest_errors(&found);
    let verdict = verdict::judge(&description, &solution, &settings);
    assert!(before[1] > 0.5 && before[2] > 0.5, "{before:?}");
    for (off, stated) in after.into_iter().zip(verdict.after.max_deg) {
        assert!(off < 0.2 && off < 5.0 * stated, "{after:?} {:?}", verdict.after);
    }

    // black glass does not tell where on the sample a pixel looks: near the horizon the lit share of its footprint is anyone's guess
    let guess = largest_lit_error(&found);
    assert!(guess > 0.3 && verdict.aim_mm > 0.1, "{guess} {}", verdict.aim_mm);
    // the fading of the light on a white sample does
    let (mut known, mut problem) = (found, problem);
    let mut solution = solution;
    for _ in 0..2 {
        problem.edges = fadings(&optics, &PixelMap::new(&known));
        problem.description.calibration = known.calibration.clone();
        solution = solve(&problem, &settings).expect("enough spots");
        known.calibration = Some(solution.estimate.instrument.clone());
    }
    let verdict = verdict::judge(&description, &solution, &settings);
    let (told, directions) = (largest_lit_error(&known), largest_errors(&known));
    assert!(told < 0.06 && verdict.aim_mm < 0.03, "{told} {}", verdict.aim_mm);
    assert!(
        directions.iter().zip(after).all(|(now, then)| *now < then.max(0.03)),
        "{directions:?} {after:?}"
    );
    assert!(problem.edges.len() >= 40 && solution.rejected().count() <= 5, "{}", problem.edges.len());
}

/// What a white sample shows of its horizon at five tilts, seen without noise. Half of each footprint found is lit indeed.
fn fadings(optics: &VirtualOptics, map: &PixelMap) -> Vec<Edge> {
    let white = Sample::diffuser(0.98);
    let mut out = Vec::new();
    for tilt in [0.0, 20.0, 40.0, 60.0, 75.0] {
        let readback = Pose::from_degrees(tilt, 0.0);
        let actual = Pose::from_degrees(tilt + errors().tilt_zero_deg, 0.0);
        let rates = optics.rate_map(actual, 0.0, &white).rates;
        let pixels = rates
            .iter()
            .map(|&rate| Merged { rate, shot: 1e-6 * rate * rate, read: 0.0, dark: 0.0, exposure: 1.0 })
            .collect();
        let merged = MergedPose { pixels, exposures: 1, saturated_share: 0.0, lamp_relative: 0.0 };
        for e in horizon::find(map, &merged, readback, [1.0; 3]) {
            let [u, v] = e.at_px;
            let lit = optics.trace_pixel(actual, &white, u as u32, v as u32).map_or(0.0, |s| s.lit);
            assert!((lit - 0.5).abs() < 0.1, "{}: {lit}", e.name());
            out.push(e);
        }
    }
    out
}

/// Largest error of the lit share of a footprint, over pixels with θo from 60 to 75°.
fn largest_lit_error(known: &Description) -> f64 {
    let (optics, map) = (VirtualOptics::new(&half(), &errors()), PixelMap::new(known));
    let sample = Sample::diffuser(0.5);
    let mut worst = 0.0f64;
    for tilt in [5.0, 25.0, 50.0] {
        let (sample_from_lab, theta_i) = map.frame(Pose::from_degrees(tilt, 0.0));
        let actual = Pose::from_degrees(tilt + errors().tilt_zero_deg, 0.0);
        for row in (5..half().camera.size[1]).step_by(13) {
            for column in (5..half().camera.size[0]).step_by(13) {
                let Some(sight) = optics.trace_pixel(actual, &sample, column, row) else { continue };
                if !(60.0..75.0).contains(&sight.geometry.theta_o.degrees()) {
                    continue;
                }
                let p = (row * half().camera.size[0] + column) as usize;
                worst = worst.max((map.lit_share(p, &sample_from_lab, theta_i.cos()) - sight.lit).abs());
            }
        }
    }
    worst
}

#[test]
fn sessions_that_cannot_calibrate_are_refused_with_what_would_serve() {
    let bench = Bench::new();
    bench.ok(&["scan", "--instrument", "tiny", "-o", "S.mcap"]);
    let sample = bench.run(&["calibrate", "geometry", "S.mcap", "-o", "I.toml"]);
    assert_eq!(sample.code, 2, "{}", sample.stderr);
    assert!(sample.stderr.contains("black-glass-wedge"), "{}", sample.stderr);
    bench.ok(&["scan", "--instrument", "tiny", "--kind", "white", "-o", "W.mcap"]);
    let few = bench.run(&["calibrate", "geometry", "W.mcap", "-o", "I.toml"]);
    assert_eq!(few.code, 1, "{}", few.stderr);
    assert!(few.stderr.contains("at least 8"), "{}", few.stderr);
    bench.write("I.toml", "mine");
    let kept = bench.run(&["calibrate", "geometry", "W.mcap", "-o", "I.toml"]);
    assert_eq!(kept.code, 2, "{}", kept.stderr);
    assert_eq!(bench.read("I.toml"), b"mine");
}
