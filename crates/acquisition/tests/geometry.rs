//! Geometric calibration on spots made by the prediction itself, with noise: what is put in must come out, what is wrong must be named.

use gonio_acquisition::geometry::{
    CalibrationError, Estimate, Glass, PARAMETERS, Problem, Settings, Spot, plans, predict, record, solve,
    verdict,
};
use gonio_acquisition::optics::Optics;
use gonio_instrument::{Description, ScanKind, builtin};

fn reference() -> Description {
    builtin::description("reference").expect("known").expect("readable")
}

fn truth() -> Estimate {
    let mut instrument = builtin::misalignment().expect("readable");
    (instrument.tilt_repeatability_deg, instrument.lamp_drift) = (0.0, 0.0);
    let glass = Glass { flat_lean_deg: [0.01, -0.02], wedge_deg: 20.4, wedge_azimuth_deg: 100.0 };
    Estimate { instrument, glass }
}

/// Normal numbers by the sum of twelve even ones (SplitMix64).
struct Noise(u64);

impl Noise {
    fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.even()).sum::<f64>() - 6.0
    }
}

/// Spots of the true instrument with `sigma` pixels of noise on each coordinate.
fn spots(kinds: &[ScanKind], sigma: f64, seed: u64) -> Vec<Spot> {
    let (d, t) = (reference(), truth());
    let optics = Optics::with(&d, &t.instrument);
    let mut noise = Noise(seed);
    let [w, h] = d.camera.size.map(f64::from);
    let mut out = Vec::new();
    for &kind in kinds {
        let limits = d.holder.tilt_limits_deg;
        let plan = if kind == ScanKind::BlackGlass {
            plans::flat(&d.plan, limits)
        } else {
            plans::wedge(&d.plan, limits)
        };
        for (k, pose) in plan.poses().into_iter().enumerate().step_by(2) {
            let Some(i) = predict::spot(&optics, &t.glass, kind, pose, d.lamp.half_angle()) else { continue };
            let [u, v] = i.centroid_px;
            if !(5.0..w - 5.0).contains(&u) || !(5.0..h - 5.0).contains(&v) {
                continue;
            }
            out.push(Spot {
                name: format!("{} pose {k}", kind.name()),
                kind,
                readback: pose,
                centre_px: [u + sigma * noise.normal(), v + sigma * noise.normal()],
                sigma_px: sigma,
                radii_px: i.radii_px,
                level: 1.0,
                misfit: 0.0,
                channels: [[1.0; 2]; 3],
            });
        }
    }
    out
}

fn settings() -> Settings {
    Settings {
        tilt_repeatability_deg: 1e-5,
        spin_repeatability_deg: 1e-5,
        centroid_floor_px: 0.0,
        ..Settings::default()
    }
}

const BOTH: [ScanKind; 2] = [ScanKind::BlackGlass, ScanKind::BlackGlassWedge];

#[test]
fn directions_of_a_misaligned_instrument_come_out_as_surely_as_is_said() {
    let description = reference();
    let problem =
        Problem { description: description.clone(), spots: spots(&BOTH, 0.02, 5), edges: Vec::new() };
    let s = solve(&problem, &settings()).expect("solves");
    assert!(s.converged && s.rejected().count() == 0, "{:?}", s.rejected().collect::<Vec<_>>());
    assert!((0.7..1.3).contains(&s.reduced_chi2), "{}", s.reduced_chi2);
    let v = verdict::judge(&description, &s, &settings());
    assert!(v.good && v.after.rms_deg.iter().all(|r| *r < 0.03), "{v:?}");
    assert!(v.before.rms_deg[1] > 20.0 * v.after.rms_deg[1]);
    // a fit that is stopped on its way comes back marked, however sure of itself its covariance is
    let hasty = Settings { most_steps: 1, ..settings() };
    let stopped = solve(&problem, &hasty).expect("solves");
    assert!(!stopped.converged && !verdict::judge(&description, &stopped, &hasty).good);
    // what is measured: directions against the sample's normal, and light against view
    let (found, real) =
        (Optics::with(&description, &s.estimate.instrument), Optics::with(&description, &truth().instrument));
    let mut worst = [0.0f64; 3];
    for (u, v) in [(300.0, 300.0), (640.0, 512.0), (900.0, 700.0), (200.0, 800.0)] {
        for tilt in [10.0, 40.0, 70.0] {
            let tilt = gonio_optics::Angle::from_degrees(tilt);
            let angles = |o: &Optics| {
                let d = o.view(u, v).expect("hits").direction;
                let n = o.normal(tilt);
                [o.lamp().angle_to(n), d.angle_to(n), o.lamp().angle_to(d)].map(|a| a.degrees())
            };
            for (w, (a, b)) in worst.iter_mut().zip(angles(&found).into_iter().zip(angles(&real))) {
                *w = w.max((a - b).abs());
            }
        }
    }
    for (k, w) in worst.iter().enumerate() {
        assert!(*w < 4.0 * v.after.max_deg[k], "{k}: {w} against {:?}", v.after);
    }
    // parameters the spots do determine are within four standard deviations
    let t = truth().to_row();
    for (k, p) in PARAMETERS.iter().enumerate() {
        let off = (s.row[k] - t[k]).abs() / s.sigma(k);
        assert!(off < 4.0, "{}: {off} sigma", p.name);
    }
    let kept = record::calibrated(&description, &s, &v, &settings(), vec!["a.mcap".to_owned()]);
    let again = Description::from_toml(&kept.to_toml().expect("writable")).expect("readable");
    assert_eq!(
        again.calibration_record.as_ref().map(|r| (r.version, r.covariance.len())),
        Some((1, 29 * 30 / 2))
    );
    assert_eq!(again.calibration, kept.calibration);
}

#[test]
fn an_outlier_is_thrown_out_and_named() {
    let mut spots = spots(&BOTH, 0.02, 6);
    let bad = spots[30].name.clone();
    spots[30].centre_px[0] += 0.8;
    let worse = spots[60].name.clone();
    spots[60].centre_px = [200.0, 200.0];
    let s =
        solve(&Problem { description: reference(), spots, edges: Vec::new() }, &settings()).expect("solves");
    let mut named: Vec<&str> = s.rejected().map(|r| r.name.as_str()).collect();
    named.sort_unstable();
    let mut expected = [bad.as_str(), worse.as_str()];
    expected.sort_unstable();
    assert_eq!(named, expected);
    assert!(s.converged && s.rms_px < 0.03, "{}", s.rms_px);
}

#[test]
fn flat_glass_alone_leaves_most_undetermined_and_says_which_poses_would_help() {
    let description = reference();
    let problem =
        Problem { description: description.clone(), spots: spots(&BOTH[..1], 0.02, 7), edges: Vec::new() };
    let s = solve(&problem, &settings()).expect("solves");
    let v = verdict::judge(&description, &s, &settings());
    assert!(!v.good, "{:?}", v.after);
    let undetermined = v.undetermined.len() + v.gauges;
    assert!(undetermined >= 15, "{undetermined}");
    let first = &v.undetermined[0];
    assert!(!first.words.is_empty() && first.poses.iter().any(|p| p.contains("wedge")), "{first:?}");
}

#[test]
fn too_few_spots_are_an_error_that_says_what_to_scan() {
    let mut few = spots(&BOTH, 0.02, 8);
    few.truncate(5);
    let e = solve(&Problem { description: reference(), spots: few, edges: Vec::new() }, &settings());
    assert_eq!(e.as_ref().err(), Some(&CalibrationError::TooFew { found: 5, needed: 8 }));
    assert!(e.expect_err("too few").to_string().contains("black-glass-wedge"));
}
