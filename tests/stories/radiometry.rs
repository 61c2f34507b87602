//! A virtual instrument whose sensor and light depart from its description; the calibration, which shares neither with it, finds each number within the
//! uncertainty that it states.

use std::time::Duration;

use gonio_acquisition::radiometry::{Calibrated, Input, RadiometryError, Settings, calibrate, plans};
use gonio_acquisition::reference_plan::white_plan;
use gonio_acquisition::{PixelMap, geometry};
use gonio_brdf::Flag;
use gonio_brdf::formats::{self, Loaded};
use gonio_instrument::radiometry::Known;
use gonio_instrument::{
    Certificate, Description, Exposure, Frame, Imperfections, Misalignment, Plan, PoseRecord, ScanKind,
    builtin,
};
use gonio_sim::Truth;
use gonio_sim::optics::sensor::{Conditions, NoiseKey};
use gonio_sim::optics::{Sample, Sensor, VirtualOptics};

use crate::command::Bench;

fn tiny() -> Description {
    builtin::description("tiny").expect("built in").expect("readable")
}

/// What is wrong with the instrument.
fn wrong() -> Imperfections {
    Imperfections {
        gain_error: 0.05,
        read_noise_error: 0.3,
        black_level_error: 1.6,
        compression: 0.02,
        pixel_response: 0.01,
        dead_pixels: 12,
        dark_current_error: 1.0,
        dark_doubling_k: 6.0,
        veiling_glare: 0.012,
        tail_share: 0.02,
        tail_radius_mm: 0.12,
        face_reflectance: 0.06,
        lamp_haze: 5e-4,
        ..Imperfections::default()
    }
}

/// The virtual instrument.
struct Instrument {
    d: Description,
    optics: VirtualOptics,
    sensor: Sensor,
}

impl Instrument {
    fn new(i: Imperfections, seed: u64) -> Self {
        let d = tiny();
        let sensor = Sensor::new(&d, seed).with_imperfections(&i);
        let errors = Misalignment { radiometry: Some(i), ..Misalignment::default() };
        Self { optics: VirtualOptics::new(&d, &errors), sensor, d }
    }

    /// The poses of a scan. Without a series of its own the plan's poses get exposures a factor 4 apart over the camera's range.
    fn scan(&self, kind: ScanKind, plan: &Plan, temperature_c: f64) -> Vec<PoseRecord> {
        let truth = Truth::from_bytes(br#"{"model":"lambert","diffuse":[0.5,0.5,0.5]}"#).expect("a model");
        let sample = Sample::of_kind(kind, &truth, &Certificate::virtual_white()).expect("a sample");
        let [shortest, longest] = self.d.camera.exposure_s;
        let series: Vec<f64> = match plan.exposure_s.is_empty() {
            false => plan.exposure_s.clone(),
            true => {
                (0..9).map(|k| shortest * 4f64.powi(k)).chain([longest]).filter(|t| *t <= longest).collect()
            }
        };
        let mut sequence = 0;
        let poses = plan.poses();
        poses
            .iter()
            .enumerate()
            .map(|(index, &pose)| {
                let rates = match kind {
                    ScanKind::Dark => Vec::new(),
                    _ => self.optics.rate_map(pose, 0.0, &sample).rates,
                };
                let mut exposures = Vec::new();
                for &exposure_s in &series {
                    for lit in [false, true] {
                        let dark_too = kind == ScanKind::Flat || kind == ScanKind::Dark || index == 0;
                        if (lit && kind == ScanKind::Dark) || (!lit && !dark_too) {
                            continue;
                        }
                        for repeat in 0..u64::from(plan.repeats.max(2)) {
                            let key = NoiseKey {
                                sample: sample.noise_key + (temperature_c * 100.0) as u64 * 16,
                                pose: ((pose.tilt.degrees() * 1e6) as i64, index as i64),
                                exposure_ns: (exposure_s * 1e9) as u64,
                                shutter_open: lit,
                                repeat,
                            };
                            let lamp = if lit { 1.0 } else { 0.0 };
                            let conditions = Conditions { exposure_s, lamp, temperature_c };
                            let [width, height] = self.d.camera.size;
                            let pixels = self.sensor.expose(if lit { &rates } else { &[] }, conditions, key);
                            sequence += 1;
                            let frame = Frame {
                                width,
                                height,
                                pixels,
                                exposure: Duration::from_secs_f64(exposure_s),
                                sequence,
                                stamp: Duration::ZERO,
                                sensor_temperature_c: Some(temperature_c),
                            };
                            exposures.push(Exposure { frame, lamp_monitor: 1.0, shutter_open: lit });
                        }
                    }
                }
                PoseRecord { index: index as u32, commanded: pose, readback: pose, exposures }
            })
            .collect()
    }

    fn plan(&self, kind: ScanKind) -> Plan {
        let (d, map) = (&self.d, PixelMap::new(&self.d));
        match kind {
            ScanKind::Flat => plans::flat(&d.plan, d),
            ScanKind::Trap => plans::trap(&d.plan),
            ScanKind::BlackGlass => geometry::plans::flat(&d.plan, d.holder.tilt_limits_deg),
            ScanKind::Dark => Plan { tilt_deg: vec![0.0], repeats: 4, ..d.plan.clone() },
            _ => white_plan(&map, &d.plan),
        }
    }
}

fn input<'a>(name: &str, kind: ScanKind, poses: &'a [PoseRecord]) -> Input<'a> {
    Input {
        name: name.to_owned(),
        kind,
        certificate: match kind {
            ScanKind::White => Some(Certificate::virtual_white()),
            ScanKind::Black => Some(Certificate::virtual_black()),
            _ => None,
        },
        notes: Vec::new(),
        poses: Box::new(|| Box::new(poses.iter().cloned())),
    }
}

const KINDS: [ScanKind; 6] =
    [ScanKind::Flat, ScanKind::Dark, ScanKind::White, ScanKind::Black, ScanKind::BlackGlass, ScanKind::Trap];

fn calibrated(instrument: &Instrument) -> Calibrated {
    let mut sessions: Vec<(ScanKind, Vec<PoseRecord>)> =
        KINDS.iter().map(|&k| (k, instrument.scan(k, &instrument.plan(k), 35.0))).collect();
    sessions.push((ScanKind::Dark, instrument.scan(ScanKind::Dark, &instrument.plan(ScanKind::Dark), 43.0)));
    let inputs: Vec<Input<'_>> = sessions.iter().map(|(k, p)| input(k.name(), *k, p)).collect();
    calibrate(&instrument.d, &inputs, &Settings::default()).expect("a calibration")
}

/// What was found off its truth.
#[derive(Default)]
struct Found(Vec<String>);

impl Found {
    /// Within three standard uncertainties, and these no larger than told.
    fn within(&mut self, name: &str, found: Known, truth: f64, largest_sigma: f64) {
        told(name, found, truth);
        if (found.value - truth).abs() > 3.0 * found.sigma || found.sigma > largest_sigma {
            self.0.push(format!("{name}: {found:?}, truth {truth}, sigma at most {largest_sigma}"));
        }
    }

    fn end(self) {
        assert!(self.0.is_empty(), "{:#?}", self.0);
    }
}

fn told(name: &str, found: Known, truth: f64) {
    gonio_tests::say(&format!(
        "{name}: {:.6} ± {:.6}, truth {truth:.6}, z = {:.2}",
        found.value,
        found.sigma,
        (found.value - truth) / found.sigma
    ));
}

#[test]
fn every_number_is_found_within_its_uncertainty() {
    let mut found = Found::default();
    let w = wrong();
    let instrument = Instrument::new(w.clone(), 5);
    let c = calibrated(&instrument);
    let r = c.radiometry();
    let (d, sensor) = (&instrument.d, &instrument.sensor);
    let gain = sensor.electrons_per_count();
    for (k, name) in ["red", "green", "blue"].iter().enumerate() {
        found.within(&format!("gain {name}"), r.electrons_per_count[k], gain, 0.02 * gain);
    }
    found.within("read noise", r.read_noise_e, sensor.read_noise_e(), 0.1);
    found.within("black level", r.black_level, 64.0 + w.black_level_error, 0.05);
    let usual: Vec<f64> =
        sensor.dark_reference().iter().map(|v| f64::from(*v)).filter(|v| *v < 100.0).collect();
    let mean = usual.iter().sum::<f64>() / usual.len() as f64;
    found.within("dark current", r.dark.current_e_s, mean, 0.2);
    found.within("doubling", r.dark.doubling_k.expect("two temperatures"), w.dark_doubling_k, 0.3);
    // the signal that reads as the top code
    let range = f64::from(d.camera.top_code() - d.camera.black_level);
    let x = (f64::from(d.camera.top_code()) - 64.0 - w.black_level_error) / range;
    let u = (1.0 - (1.0 - 4.0 * w.compression * x).sqrt()) / (2.0 * w.compression);
    assert!(r.full_well_reached);
    found.within("full well", r.full_well_e, u * range * gain, 0.02 * range * gain);
    // linearity: y of what is read is what was there
    for (k, level) in [0.1, 0.3, 0.5, 0.7, 0.9].iter().enumerate() {
        let read = level * (1.0 - w.compression * level);
        let y: f64 = r.linearity.iter().enumerate().map(|(j, c)| c * read.powi(j as i32 + 1)).sum();
        assert!((y - level).abs() < 1e-3, "{k}: {y} of {level}, {:?}", r.linearity);
    }
    let worst = |k: usize| r.linearity_levels.iter().map(|l| l[k].abs()).fold(0.0, f64::max);
    assert!(worst(1) > 2e-3 && worst(2) < 6e-4, "{:?}", r.linearity_levels);
    assert_eq!(r.hot.iter().map(|p| *p as usize).collect::<Vec<_>>(), sensor.hot_pixels());
    let truly_dead: Vec<u32> =
        (0..sensor.response().len() as u32).filter(|p| sensor.response()[*p as usize] < 0.1).collect();
    assert!(
        r.dead.len() >= 3 && r.dead.iter().all(|p| truly_dead.contains(p)),
        "{:?} {truly_dead:?}",
        r.dead
    );
    let flat = r.flat.as_ref().expect("a flat field");
    found.within("pixel response", flat.pixel_response, w.pixel_response, 2e-3);
    let gloss = r.gloss.as_ref().expect("black glass");
    found.within("gloss scale", gloss.scale, 1.0, 0.02);
    let stray = r.stray.as_ref().expect("stray light");
    found.within("glare", stray.glare, w.veiling_glare, 2e-3);
    found.within("tails", stray.tail_share, w.tail_share, 5e-3);
    let kappa = instrument.optics.stray().expect("stray light").kappa;
    found.within("face", stray.face.expect("black and white"), kappa, 0.3 * kappa);
    let haze = stray.haze.as_ref().expect("a trap");
    let map = PixelMap::new(d);
    let truth = instrument.optics.stray().expect("stray light");
    let (w, h) = (map.width(), map.height());
    let off: Vec<f64> = (0..w * h)
        .step_by(97)
        .map(|p| {
            let t = truth.haze((p % w) as f64 / w as f64, (p / w) as f64 / h as f64);
            gonio_acquisition::radiometry::stray::haze_at(haze, &map, p) - t
        })
        .collect();
    let rms = (off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64).sqrt();
    gonio_tests::say(&format!(
        "haze: off by {rms:.2} e/s of {:.1}, stated {:.2}",
        truth.haze(0.5, 0.5),
        haze.sigma_e_s
    ));
    assert!(rms < 0.05 * truth.haze(0.5, 0.5), "{rms}");
    found.end();
    assert!(r.good, "{:?}", r.notes);
    let text = c.description.to_toml().expect("writable");
    assert_eq!(Description::from_toml(&text).expect("readable").radiometry, c.description.radiometry);
}

#[test]
fn a_camera_as_described_is_found_as_described() {
    let mut found = Found::default();
    let c = calibrated(&Instrument::new(Imperfections::default(), 9));
    let r = c.radiometry();
    let stray = r.stray.expect("stray light");
    let gain = tiny().camera.electrons_per_count();
    found.within("gain", r.electrons_per_count[1], gain, 0.02 * gain);
    found.within("glare", stray.glare, 0.0, 1e-3);
    found.within("tails", stray.tail_share, 0.0, 3e-3);
    found.within("face", stray.face.expect("black and white"), 0.0, 5e-3);
    found.end();
    assert!(r.dead.is_empty() && r.linearity[1].abs() < 5e-3, "{:?} {:?}", r.dead, r.linearity);
}

#[test]
fn what_cannot_calibrate_is_refused_with_what_would_serve() {
    let instrument = Instrument::new(Imperfections::default(), 2);
    let settings = Settings::default();
    let flat = instrument.scan(ScanKind::Flat, &instrument.plan(ScanKind::Flat), 35.0);
    let told = |poses: &[PoseRecord], kind| {
        let e = calibrate(&instrument.d, &[input("S.mcap", kind, poses)], &settings).err().expect("refused");
        (e.to_string(), e)
    };
    assert!(matches!(told(&flat, ScanKind::White).1, RadiometryError::NoFlat));
    let without = |keep: &dyn Fn(&Exposure) -> bool| -> Vec<PoseRecord> {
        let mut poses = flat.clone();
        poses.iter_mut().for_each(|p| p.exposures.retain(keep));
        poses
    };
    assert!(matches!(told(&without(&|e| e.shutter_open), ScanKind::Flat).1, RadiometryError::NoDark));
    let mut seen = std::collections::BTreeSet::new();
    let single = {
        let mut poses = flat.clone();
        poses[0].exposures.retain(|e| seen.insert((e.frame.exposure, e.shutter_open)));
        poses
    };
    assert!(matches!(told(&single, ScanKind::Flat).1, RadiometryError::NoPairs { exposures: 14 }));
    let saturated = without(&|e| e.frame.exposure > Duration::from_millis(45));
    assert!(matches!(told(&saturated, ScanKind::Flat).1, RadiometryError::Saturated { .. }));
    let mut strange = flat.clone();
    strange[0].exposures[0].frame.width = 80;
    assert!(told(&strange, ScanKind::Flat).0.contains("S.mcap: pose 0 holds a frame of 80 x 128"));
    // with the flat series alone everything else is named as missing
    let c = calibrate(&instrument.d, &[input("F.mcap", ScanKind::Flat, &flat)], &settings)
        .expect("a calibration");
    let notes = c.radiometry().notes.join("; ");
    for word in ["trap", "black-glass", "--kind white", "--kind black", "doubles the dark current"] {
        assert!(notes.contains(word), "{word}: {notes}");
    }
}

const SENSOR: &str = "[radiometry]\ngain_error = 0.05\nread_noise_error = 0.3\nblack_level_error = 1.6\ncompression = 0.02\npixel_response = 0.01\n\
                      dark_current_error = 1.0\nveiling_glare = 0.012\ntail_share = 0.02\ntail_radius_mm = 0.12\nface_reflectance = 0.1\nlamp_haze = 5e-4\n";
const GREY: &str = r#"{"model":"lambert","diffuse":[0.1,0.1,0.1]}"#;

/// Mean departure of the measured cells from the grey, relative.
fn off_grey(bench: &Bench, table: &str) -> f64 {
    let Loaded::Table(m) = formats::open(&bench.path(table)).expect("a table") else { panic!("no table") };
    let measured = (0..m.flag.len()).filter(|&i| m.flag[i] == Flag::Measured);
    let off: Vec<f64> =
        measured.map(|i| f64::from(m.values[i][1]) * std::f64::consts::PI / 0.1 - 1.0).collect();
    off.iter().sum::<f64>() / off.len() as f64
}

#[test]
fn scans_of_references_calibrate_and_replays_use_it() {
    let bench = Bench::new();
    bench.write("m.toml", SENSOR);
    bench.write("grey.json", GREY);
    let scan = |kind: &str| {
        let name = format!("{kind}.mcap");
        let words = [
            "scan",
            "--instrument",
            "tiny",
            "--kind",
            kind,
            "--misalignment",
            "m.toml",
            "--truth",
            "grey.json",
            "-o",
            &name,
        ];
        bench.ok(&words);
    };
    ["flat", "white", "black", "trap", "sample"].iter().for_each(|k| scan(k));
    let told = bench
        .ok(&[
            "--json",
            "calibrate",
            "radiometry",
            "flat.mcap",
            "white.mcap",
            "black.mcap",
            "trap.mcap",
            "-o",
            "I.toml",
        ])
        .json();
    let c = &told["calibration"];
    assert_eq!((told["good"].as_bool(), told["version"].as_u64()), (Some(true), Some(1)), "{told}");
    for picture in told["pictures"].as_array().expect("pictures") {
        assert!(bench.read(picture.as_str().expect("a name")).starts_with(b"\x89PNG"));
    }
    let gain = c["electrons_per_count"][1]["value"].as_f64().expect("a gain");
    assert!((gain / (1.05 * tiny().camera.electrons_per_count()) - 1.0).abs() < 0.05, "{gain}");
    let notes = told["notes"].to_string();
    assert!(notes.contains("black-glass") && notes.contains("not colorimetric"), "{notes}");
    assert_eq!(bench.ok(&["--json", "info", "I.toml"]).json()["radiometry"]["clipped_at"], 4095);
    bench.ok(&["replay", "sample.mcap", "--reference", "white.mcap", "-o", "plain.nc"]);
    let with = [
        "--json",
        "replay",
        "sample.mcap",
        "--reference",
        "white.mcap",
        "--instrument",
        "I.toml",
        "--fit=lambert",
        "-o",
        "with.nc",
    ];
    let replayed = bench.ok(&with).json();
    let (plain, with) = (off_grey(&bench, "plain.nc"), off_grey(&bench, "with.nc"));
    gonio_tests::say(&format!(
        "grey of 0.1: off by {:.3} % as described, {:.3} % calibrated",
        100.0 * plain,
        100.0 * with
    ));
    assert!(plain.abs() > 0.004 && with.abs() < 0.25 * plain.abs(), "{plain} {with}");
    let budget = bench.ok(&["--json", "info", "--budget", "with.nc"]).json().to_string();
    assert!(budget.contains("\"stray\""), "{budget}");
    let closure = replayed["closure"].as_array().expect("closure checks");
    let verdict = |name: &str| closure.iter().find(|c| c["name"] == name).map(|c| c["verdict"].clone());
    assert_eq!(verdict("reciprocity"), Some("agrees".into()), "{closure:?}");
    assert_eq!(verdict("white-cosine"), Some("agrees".into()), "{closure:?}");
    assert_eq!(verdict("remounting"), Some("not-checked".into()), "{closure:?}");
    let report = String::from_utf8_lossy(&bench.read("with.report.html")).into_owned();
    assert!(report.contains("Closure checks") && report.contains("Not colorimetric"));

    // never in place, never from what cannot serve
    let again = bench.run(&["calibrate", "radiometry", "flat.mcap", "-o", "I.toml"]);
    assert!(again.code == 2 && again.stderr.contains("side by side"), "{}", again.stderr);
    let sample = bench.run(&["calibrate", "radiometry", "sample.mcap", "-o", "J.toml"]);
    assert!(sample.code == 2 && sample.stderr.contains("kind sample, expected flat"), "{}", sample.stderr);
    let none = bench.run(&["calibrate", "radiometry", "white.mcap", "-o", "J.toml"]);
    assert!(none.code == 2 && none.stderr.contains("--kind flat"), "{}", none.stderr);
    let other =
        bench.run(&["calibrate", "radiometry", "flat.mcap", "--instrument", "reference", "-o", "J.toml"]);
    assert!(
        other.code == 2 && other.stderr.contains("name the instrument of the sessions"),
        "{}",
        other.stderr
    );
}
