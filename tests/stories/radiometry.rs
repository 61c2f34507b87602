//! A virtual instrument whose sensor and light depart from its description; the calibration, which shares neither with it, finds each number within the
//! uncertainty that it states.

use std::time::Duration;

use gonio_acquisition::PixelMap;
use gonio_acquisition::radiometry::{RadiometryError, Settings, calibrate, stray};
use gonio_brdf::Flag;
use gonio_brdf::formats::{self, Loaded};
use gonio_instrument::radiometry::Known;
use gonio_instrument::{Description, Exposure, Imperfections, PoseRecord, ScanKind};
use gonio_optics::colour;
use gonio_tests::imperfect::{Instrument, input, tiny, wrong};

use crate::command::Bench;

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

/// Largest standard uncertainty of each number that is still of use.
const LARGEST: [(&str, f64); 15] = [
    ("gain red", 0.06),
    ("gain green", 0.05),
    ("gain blue", 0.06),
    ("read noise", 0.1),
    ("black level", 0.05),
    ("dark current", 0.2),
    ("doubling", 0.3),
    ("full well", 250.0),
    ("pixel response", 2e-3),
    ("gloss scale", 0.01),
    ("glare", 3e-5),
    ("tails", 3e-4),
    ("tail radius", 2e-3),
    ("face", 5e-3),
    ("haze", 1.0),
];

#[test]
fn every_number_is_found_within_its_uncertainty() {
    let w = wrong();
    let mut instrument = Instrument::new(w.clone(), 5);
    let c = instrument.calibrated();
    let r = c.radiometry();
    let mut found = Found::default();
    let numbers = instrument.compared(&c);
    assert_eq!(numbers.len(), LARGEST.len() - 1);
    for n in &numbers {
        let largest = LARGEST.iter().find(|l| l.0 == n.name).expect("a bound for each").1;
        found.within(&n.name, n.found, n.truth, largest);
    }
    // haze tile by tile
    for (channel, tiles) in instrument.haze(&c).iter().enumerate() {
        let rms = (tiles.iter().map(|t| t.z().powi(2)).sum::<f64>() / tiles.len() as f64).sqrt();
        gonio_tests::say(&format!(
            "haze, channel {channel}: z r.m.s. {rms:.2}, {:.2} e/s each",
            tiles[0].found.sigma
        ));
        assert!((0.75..1.25).contains(&rms) && tiles[0].found.sigma < LARGEST[14].1, "{channel}: {rms}");
    }
    assert!(r.full_well_reached);
    // linearity: y of what is read is what was there
    for (k, level) in [0.1, 0.3, 0.5, 0.7, 0.9].iter().enumerate() {
        let read = level * (1.0 - w.compression * level);
        let y: f64 = r.linearity.iter().enumerate().map(|(j, c)| c * read.powi(j as i32 + 1)).sum();
        assert!((y - level).abs() < 1e-3, "{k}: {y} of {level}, {:?}", r.linearity);
    }
    let worst = |k: usize| r.linearity_levels.iter().map(|l| l[k].abs()).fold(0.0, f64::max);
    assert!(worst(1) > 2e-3 && worst(2) < 6e-4, "{:?}", r.linearity_levels);
    let sensor = &instrument.sensor;
    assert_eq!(r.hot.iter().map(|p| *p as usize).collect::<Vec<_>>(), sensor.hot_pixels());
    let truly_dead: Vec<u32> =
        (0..sensor.response().len() as u32).filter(|p| sensor.response()[*p as usize] < 0.1).collect();
    assert!(
        r.dead.len() >= 3 && r.dead.iter().all(|p| truly_dead.contains(p)),
        "{:?} {truly_dead:?}",
        r.dead
    );
    // between the tiles' centres
    let haze = r.stray.as_ref().and_then(|s| s.haze.as_ref()).expect("a trap");
    let map = PixelMap::new(&instrument.d);
    let truth = instrument.optics.stray().expect("stray light");
    let (w, h) = (map.width(), map.height());
    let off: Vec<f64> = (0..w * h)
        .step_by(97)
        .map(|p| {
            let t = truth.haze((p % w) as f64 / w as f64, (p / w) as f64 / h as f64);
            stray::haze_at(haze, &map, p) - t
        })
        .collect();
    let rms = (off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64).sqrt();
    assert!(rms < 0.05 * truth.haze(0.5, 0.5), "{rms}");
    found.end();
    assert!(r.good, "{:?}", r.notes);
    let text = c.description.to_toml().expect("writable");
    assert_eq!(Description::from_toml(&text).expect("readable").radiometry, c.description.radiometry);
}

#[test]
fn a_camera_as_described_is_found_as_described() {
    let mut found = Found::default();
    let c = Instrument::new(Imperfections::default(), 9).calibrated();
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
    let mut instrument = Instrument::new(Imperfections::default(), 2);
    let settings = Settings::default();
    let plan = instrument.plan(ScanKind::Flat);
    let flat = instrument.scan(ScanKind::Flat, &plan, 35.0);
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
    let mut frozen = flat.clone();
    let mut first: Option<Vec<u16>> = None;
    for e in frozen[0].exposures.iter_mut().filter(|e| e.shutter_open) {
        match first.take() {
            // a camera that gives the same frame twice has no noise to tell its gain
            Some(pixels) => e.frame.pixels = pixels,
            None => first = Some(e.frame.pixels.clone()),
        }
    }
    assert!(matches!(told(&frozen, ScanKind::Flat).1, RadiometryError::NoGain { .. }));
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

/// A misalignment file of sensor and light.
pub const SENSOR: &str = "[radiometry]\ngain_error = 0.05\nread_noise_error = 0.3\nblack_level_error = 1.6\ncompression = 0.02\npixel_response = 0.01\n\
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

/// From the camera's channels to linear Rec. 709, as the chart of [`chart`] has it.
pub const MATRIX: [[f64; 3]; 3] = [[1.3, -0.2, -0.1], [-0.15, 1.25, -0.1], [0.05, -0.3, 1.25]];

/// Writes a chart of eight patches seen through [`MATRIX`], each with a table of its own.
pub fn chart(bench: &Bench, name: &str) {
    let mut text = "format = \"gonio-chart\"\nversion = 1\ntheta_i_deg = 45\ntheta_o_deg = 0\n".to_owned();
    let patches = [
        [0.8, 0.8, 0.8],
        [0.2, 0.2, 0.2],
        [0.5, 0.12, 0.1],
        [0.1, 0.4, 0.12],
        [0.08, 0.12, 0.5],
        [0.5, 0.45, 0.1],
        [0.4, 0.15, 0.4],
        [0.1, 0.35, 0.4],
    ];
    for (k, rgb) in patches.iter().enumerate() {
        let lab = colour::lab_from_rgb(MATRIX.map(|r| r[0] * rgb[0] + r[1] * rgb[1] + r[2] * rgb[2]));
        text += &format!(
            "[[patch]]\nname = \"P{k}\"\nlab = [{}, {}, {}]\ntable = \"P{k}.csv\"\n",
            lab.l, lab.a, lab.b
        );
        let f = rgb.map(|v| v / std::f64::consts::PI);
        let mut rows = "theta_i_deg,theta_o_deg,phi_deg,r,g,b\n".to_owned();
        for (i, o, phi) in (0..8).map(|n| (60 * (n / 4), 60 * (n / 2 % 2), 180 * (n % 2))) {
            rows += &format!("{i},{o},{phi},{},{},{}\n", f[0], f[1], f[2]);
        }
        bench.write(&format!("P{k}.csv"), rows);
    }
    bench.write(name, text);
}

#[test]
fn a_chart_from_a_file_gives_colours_whose_residual_stands_on_every_report() {
    let bench = Bench::new();
    bench.write("grey.json", r#"{"model":"lambert","diffuse":[0.3,0.2,0.1]}"#);
    let scan = ["scan", "--instrument", "tiny", "--truth", "grey.json"];
    bench.ok(&[&scan[..], &["--kind", "flat", "-o", "flat.mcap"]].concat());
    let plain = bench.ok(&[&scan[..], &["-o", "S.mcap", "--fit=lambert", "--json"]].concat()).json();
    assert_eq!(plain["colours"]["colorimetric"], false, "{}", plain["colours"]);
    chart(&bench, "chart.toml");
    let words = ["calibrate", "radiometry", "flat.mcap", "--chart", "chart.toml", "-o", "I.toml"];
    let told = bench.ok(&[&words[..], &["--json"]].concat()).json();
    let colour = &told["calibration"]["colour"];
    assert_eq!(
        (colour["patches"].as_u64(), colour["chart"].as_str()),
        (Some(8), Some("chart.toml")),
        "{colour}"
    );
    for (r, row) in MATRIX.iter().enumerate() {
        for (c, m) in row.iter().enumerate() {
            assert!((colour["matrix"][r][c].as_f64().expect("a number") - m).abs() < 1e-3, "{colour}");
        }
    }
    assert!(!told["notes"].to_string().contains("not colorimetric"), "{}", told["notes"]);
    assert!(bench.ok(&["info", "I.toml"]).stdout.contains("chart.toml"));
    let replay = ["replay", "S.mcap", "--instrument", "I.toml", "--fit=lambert", "-o"];
    let json = bench.ok(&[&replay[..], &["T.nc", "--json"]].concat()).json();
    let said = &json["colours"];
    assert!(said["colorimetric"] == true && said["delta_e_max"].as_f64().is_some_and(|d| d < 0.1), "{said}");
    let text = bench.ok(&[&replay[..], &["U.nc"]].concat()).stdout;
    assert!(text.contains("left over its chart"), "{text}");
    assert!(bench.ok(&["replay", "S.mcap", "-o", "V.nc"]).stdout.contains("not colorimetric"));
    let report = |name: &str| String::from_utf8_lossy(&bench.read(name)).into_owned();
    assert!(
        report("T.report.html").contains("left over its chart")
            && !report("T.report.html").contains("Not colorimetric")
    );
    assert!(report("S.report.html").contains("Not colorimetric"));
    for (table, told) in [("T.nc", "left over its chart"), ("V.nc", "Not colorimetric")] {
        bench.ok(&["fit", table, "--model", "lambert", "--report", &format!("{table}.html")]);
        assert!(report(&format!("{table}.html")).contains(told), "{table}");
    }
    // the table went through the matrix
    let read = |name: &str| match formats::open(&bench.path(name)).expect("a table") {
        Loaded::Table(m) => m,
        _ => panic!("no table"),
    };
    let (before, after) = (read("V.nc"), read("T.nc"));
    let at = (0..after.flag.len()).find(|&i| after.flag[i] == Flag::Measured).expect("measured");
    let seen = before.values[at].map(f64::from);
    for (c, row) in MATRIX.iter().enumerate() {
        let wanted = row[0] * seen[0] + row[1] * seen[1] + row[2] * seen[2];
        assert!(
            (f64::from(after.values[at][c]) / wanted - 1.0).abs() < 0.02,
            "{:?} {seen:?}",
            after.values[at]
        );
    }
    // charts that cannot serve
    let whole = String::from_utf8(bench.read("chart.toml")).expect("text");
    let few = whole.split("[[patch]]").take(5).collect::<Vec<_>>().join("[[patch]]");
    let alike = whole.replace("P3.csv", "P2.csv");
    for (text, said) in [
        (few, "at least 6"),
        (whole.replace("P3.csv", "absent.csv"), "absent.csv"),
        (whole.replace("P3.csv", "T.nc"), "went through a colour matrix already"),
        (whole.replace("gonio-chart", "gonio-plan"), "gonio-chart"),
        (whole.replace("lab = [", "lab = [999.0, "), "L* of 0 to 150"),
        ((0..8).fold(alike, |t, k| t.replace(&format!("P{k}.csv"), "P0.csv")), "do not differ enough"),
    ] {
        bench.write("bad.toml", text);
        let ran = bench.run(&["calibrate", "radiometry", "flat.mcap", "--chart", "bad.toml", "-o", "J.toml"]);
        assert!(ran.code == 2 && ran.stderr.contains(said), "{said}: {}", ran.stderr);
        assert!(!bench.path("J.toml").exists());
    }
}
