//! What goes wrong is told in one error that says what to do, with the right exit code, and leaves everything as it was.

use crate::command::{Bench, PAINT, Ran, flip_bit};

fn refused(bench: &Bench, words: &[&str], code: i32, said: &[&str]) -> Ran {
    let ran = bench.run(words);
    assert_eq!(ran.code, code, "gonio {}\n{}\n{}", words.join(" "), ran.stdout, ran.stderr);
    for s in said {
        assert!(ran.stderr.contains(s), "gonio {} does not say {s:?}:\n{}", words.join(" "), ran.stderr);
    }
    assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
    ran
}

#[test]
fn an_absent_port_is_told() {
    let bench = Bench::new();
    let words = [
        "scan",
        "--instrument",
        "tiny",
        "--device",
        "serial:/dev/no-such-port",
        "--camera",
        "sim:none.sock",
        "-o",
        "S.mcap",
    ];
    refused(&bench, &words, 4, &["/dev/no-such-port", "not there"]);
    assert!(!bench.path("S.mcap").exists(), "nothing half-written stays behind");
}

#[test]
fn an_unknown_device_or_camera_is_told_with_what_is_known() {
    let bench = Bench::new();
    refused(&bench, &["scan", "--device", "teapot", "-o", "S.mcap"], 2, &["teapot", "serial:PATH"]);
    refused(
        &bench,
        &["scan", "--instrument", "tiny", "--camera", "teapot", "-o", "S.mcap"],
        2,
        &["teapot", "sim:SOCKET"],
    );
}

#[test]
fn a_truth_with_a_negative_albedo_is_refused() {
    let bench = Bench::new();
    bench.write("bad.json", r#"{"model":"lambert","diffuse":[0.5,-0.1,0.5]}"#);
    refused(
        &bench,
        &["scan", "--instrument", "tiny", "--truth", "bad.json", "-o", "S.mcap"],
        2,
        &["bad.json", "diffuse", "-0.1"],
    );
    assert!(!bench.path("S.mcap").exists());
}

#[test]
fn a_plan_outside_the_holders_limits_is_refused_before_anything_moves() {
    let bench = Bench::new();
    bench.write("plan.toml", "format = \"gonio-plan\"\ntilt_deg = [10, 89]\n");
    refused(
        &bench,
        &["scan", "--instrument", "tiny", "--plan", "plan.toml", "-o", "S.mcap"],
        2,
        &["tilt_deg[1]", "89", "87"],
    );
    bench.write("plan.toml", "tilt_deg = [10,\n  \"x\"]\n");
    refused(
        &bench,
        &["scan", "--instrument", "tiny", "--plan", "plan.toml", "-o", "S.mcap"],
        2,
        &["plan.toml", "line 2"],
    );
}

#[test]
fn an_output_that_exists_or_cannot_be_written_is_told_before_anything_moves() {
    let bench = Bench::new();
    bench.write("S.mcap", "mine");
    refused(&bench, &["scan", "--instrument", "tiny", "-o", "S.mcap"], 2, &["exists", "--force"]);
    assert_eq!(bench.read("S.mcap"), b"mine");
    refused(&bench, &["scan", "--instrument", "tiny", "-o", "no/such/S.mcap"], 2, &["no/such"]);
}

#[test]
fn a_foreign_or_truncated_session_is_told() {
    let bench = Bench::new();
    bench.write("foreign.mcap", "this is a letter to my aunt");
    refused(&bench, &["replay", "foreign.mcap", "-o", "x.nc"], 2, &["foreign.mcap", "not a gonio session"]);
    refused(&bench, &["verify", "foreign.mcap"], 1, &["not a gonio session"]);
    bench.write("paint.json", PAINT);
    bench.ok(&["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap"]);
    let bytes = bench.read("S.mcap");
    bench.write("cut.mcap", &bytes[..bytes.len() * 2 / 3]);
    let ran = bench.run(&["verify", "cut.mcap", "--json"]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(ran.json()["poses"].as_array().is_some_and(|p| (1..6).contains(&p.len())), "{}", ran.stdout);
}

#[test]
fn a_reference_that_is_expired_or_of_another_instrument_is_refused_unless_accepted() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write(
        "old.json",
        r#"{"serial":"W7","issued":"2019-01-01","expires":"2020-01-01","brdf":"{\"model\":\"lambert\",\"diffuse\":[0.98,0.98,0.98]}","relative_uncertainty":0.002}"#,
    );
    let white =
        ["scan", "--instrument", "tiny", "--kind", "white", "--certificate", "old.json", "-o", "W.mcap"];
    bench.ok(&white);
    let scan = [
        "scan",
        "--instrument",
        "tiny",
        "--truth",
        "paint.json",
        "--reference",
        "W.mcap",
        "-o",
        "S.mcap",
        "--fit",
    ];
    refused(&bench, &scan, 2, &["W7", "2020-01-01"]);
    assert!(!bench.path("S.mcap").exists());
    bench.ok(&[&scan[..], &["--accept-stale"]].concat());
    let info = bench.ok(&["info", "S.nc", "--json"]).json();
    let notes = info["attributes"]["reference_notes"].as_str().unwrap_or_default();
    assert!(notes.contains("expired on 2020-01-01"), "what was accepted is recorded: {info}");

    let other = gonio_instrument::builtin::TINY.replace("half_angle_deg = 0.5", "half_angle_deg = 0.6");
    bench.write("other.toml", other);
    let scan = [
        "scan",
        "--instrument",
        "other.toml",
        "--reference",
        "W.mcap",
        "--truth",
        "paint.json",
        "-o",
        "T.mcap",
        "--fit",
    ];
    refused(&bench, &scan, 2, &["W.mcap"]);
}

#[test]
fn a_firmware_of_another_version_is_told() {
    let bench = Bench::new();
    bench.write("faults.toml", "format = \"gonio-faults\"\nversion = 1\nprotocol_version = 9\n");
    refused(
        &bench,
        &["scan", "--instrument", "tiny", "--faults", "faults.toml", "-o", "S.mcap"],
        4,
        &["protocol 9", "update"],
    );
}

#[test]
fn a_stall_in_mid_scan_ends_it_with_what_was_measured_kept() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write(
        "faults.toml",
        "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"stall-tilt\"\nat_move = 3\n",
    );
    let words =
        ["scan", "--instrument", "tiny", "--truth", "paint.json", "--faults", "faults.toml", "-o", "S.mcap"];
    let ran = bench.run(&words);
    assert_eq!(ran.code, 4, "{}\n{}", ran.stdout, ran.stderr);
    assert!(ran.stderr.contains("--resume") && ran.stderr.contains("kept"), "{}", ran.stderr);
    let info = bench.ok(&["info", "S.mcap", "--json"]).json();
    assert_eq!(info["poses"].as_array().map(Vec::len), Some(2), "{info}");
    bench.ok(&["verify", "S.mcap"]);
}

#[test]
fn wrong_words_are_usage_errors_and_say_what_is_known() {
    let bench = Bench::new();
    refused(&bench, &["teleport"], 2, &["teleport"]);
    bench.write("m.json", r#"{"model":"lambert","diffuse":[0.5,0.5,0.5]}"#);
    refused(&bench, &["fit", "m.json"], 2, &["model already"]);
    refused(&bench, &["fit", "absent.nc"], 2, &["absent.nc"]);
    bench.write("g.csv", "theta_i_deg,theta_o_deg,phi_deg\n10,20,x\n");
    refused(&bench, &["eval", "m.json", "--geometries", "g.csv", "-o", "o.csv"], 2, &["line 2", "phi_deg"]);
    refused(&bench, &["stop"], 1, &["no scan"]);
    refused(&bench, &["info", "g.csv"], 2, &["g.csv"]);
}

#[test]
fn a_session_that_lost_its_dark_frames_is_evaluated_with_loss_and_says_so() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.ok(&["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap", "--fit=lambert"]);
    // the first pose holds them: a tenth of the way in
    let bytes = bench.read("S.mcap").len();
    flip_bit(&bench.path("S.mcap"), bytes / 10);
    let words = ["replay", "S.mcap", "--reference", "S.white.mcap", "--fit=lambert", "-o"];
    let text = refused(&bench, &[&words[..], &["T.nc"]].concat(), 3, &["no dark frames could be read"]);
    assert!(text.stderr.contains("done with loss"), "{}", text.stderr);
    let json = refused(&bench, &[&words[..], &["U.nc", "--json"]].concat(), 3, &[]).json();
    assert!(json["lost"].to_string().contains("no dark frames"), "{}", json["lost"]);
    assert!(String::from_utf8_lossy(&bench.read("T.report.html")).contains("no dark frames"));
}

#[test]
fn a_panel_of_another_thickness_is_told_before_anything_moves() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    let scan = |name: &'static str| {
        [
            "scan",
            "--instrument",
            "tiny",
            "--truth",
            "paint.json",
            "--misalignment",
            "m.toml",
            "-o",
            name,
            "--json",
        ]
    };
    // the holder is set for panels of 1 mm and one of 3 mm lies on it; and the other way round
    for (height, said) in [("2.0", "+2.000 mm"), ("-2.0", "-2.000 mm")] {
        bench.write("m.toml", format!("sample_height_mm = {height}\n"));
        refused(&bench, &scan("S.mcap"), 4, &[said, "from F1", "adjust its height"]);
    }
    // set anew it need not be exact
    bench.write("m.toml", "sample_height_mm = 0.12\n");
    let done = bench.ok(&scan("T.mcap")).json();
    assert_eq!((done["complete"].as_bool(), done["poses_done"].as_u64()), (Some(true), Some(6)), "{done}");
}

#[test]
fn a_calibration_that_is_broken_foreign_or_newer_is_told() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.ok(&["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap", "--fit=lambert"]);
    bench.ok(&["scan", "--instrument", "tiny", "--kind", "flat", "-o", "flat.mcap"]);
    bench.ok(&["calibrate", "radiometry", "flat.mcap", "-o", "I.toml"]);
    let whole = String::from_utf8(bench.read("I.toml")).expect("text");
    let gain = whole.find("electrons_per_count").expect("a gain");
    for (name, text, said) in [
        ("cut", whole[..gain + 40].to_owned(), vec!["I.bad.toml", "cannot be read", "line"]),
        (
            "foreign",
            "format = \"gonio-plan\"\ntilt_deg = [10]\n".to_owned(),
            vec!["gonio-instrument", "gonio-plan"],
        ),
        (
            "newer",
            whole.replacen("version = 1", "version = 9\nsomething_new = 3", 1),
            vec!["version 9", "reads version 1", "update gonio"],
        ),
        (
            "strange",
            whole.replacen("[radiometry]", "[radiometry]\nsomething_new = 3", 1),
            vec!["something_new"],
        ),
        (
            "nonsense",
            whole.replacen("linearity = [", "linearity = [nan, ", 1),
            vec!["radiometry.linearity", "finite"],
        ),
    ] {
        assert!(text != whole, "{name}");
        bench.write("I.bad.toml", text);
        for words in [
            vec![
                "replay",
                "S.mcap",
                "--reference",
                "S.white.mcap",
                "--instrument",
                "I.bad.toml",
                "-o",
                "T.nc",
            ],
            vec!["scan", "--instrument", "I.bad.toml", "-o", "T.mcap"],
            vec!["calibrate", "radiometry", "flat.mcap", "--instrument", "I.bad.toml", "-o", "J.toml"],
        ] {
            refused(&bench, &words, 2, &said);
        }
        assert!(["T.nc", "T.mcap", "J.toml"].iter().all(|f| !bench.path(f).exists()), "{name}");
    }
}

#[test]
fn calibrations_are_counted_kept_side_by_side_and_written_whole_or_not_at_all() {
    let bench = Bench::new();
    bench.ok(&["scan", "--instrument", "tiny", "--kind", "flat", "-o", "flat.mcap"]);
    let words = ["calibrate", "radiometry", "flat.mcap", "-o"];
    // what a run that was killed while it wrote left behind is no calibration, and in nobody's way
    bench.write("I.toml.partial", "format = \"gonio-instr");
    bench.ok(&[&words[..], &["I.toml"]].concat());
    assert!(!bench.path("I.toml.partial").exists());
    let first = bench.read("I.toml");
    refused(&bench, &[&words[..], &["I.toml"]].concat(), 2, &["I.toml", "side by side"]);
    assert_eq!(bench.read("I.toml"), first);
    // not even where a picture of it stands
    bench.write("K.dark.png", "mine");
    refused(&bench, &[&words[..], &["K.toml"]].concat(), 2, &["K.dark.png", "side by side"]);
    assert!(!bench.path("K.toml").exists() && bench.read("K.dark.png") == b"mine");
    // a calibration of a calibrated instrument counts on
    let again = [&words[..], &["I.2.toml", "--instrument", "I.toml", "--json"]].concat();
    assert_eq!(bench.ok(&again).json()["version"], 2);
    assert_eq!(bench.read("I.toml"), first);
    refused(&bench, &[&words[..], &["no/such/I.toml"]].concat(), 2, &["no/such"]);
}

/// The reference optics before a camera of half the pixels a side.
fn half(bench: &Bench) {
    let mut d = gonio_instrument::builtin::description("reference").expect("built in").expect("readable");
    d.name = "half".to_owned();
    d.camera.size = d.camera.size.map(|n| n / 2);
    d.camera.pitch_um *= 2.0;
    bench.write("half.toml", d.to_toml().expect("writable"));
}

#[test]
fn poses_that_do_not_determine_an_instrument_make_a_calibration_that_is_marked_as_not_good() {
    let bench = Bench::new();
    half(&bench);
    bench
        .write("plan.toml", "format = \"gonio-plan\"\ntilt_deg = [14, 20, 26, 32, 38, 44, 50, 56, 62, 68]\n");
    let scan = [
        "scan",
        "--instrument",
        "half.toml",
        "--kind",
        "black-glass",
        "--plan",
        "plan.toml",
        "-o",
        "flat.mcap",
    ];
    bench.ok(&scan);
    // flat glass alone: its spots lie on one curve
    let words = ["calibrate", "geometry", "flat.mcap", "-o"];
    let text = refused(&bench, &[&words[..], &["I.toml"]].concat(), 3, &["marked as not good"]);
    assert!(
        text.stdout.contains("undetermined:") && text.stdout.contains("what would help:"),
        "{}",
        text.stdout
    );
    let json = refused(&bench, &[&words[..], &["J.toml", "--json"]].concat(), 3, &[]).json();
    assert_eq!((json["good"].as_bool(), json["converged"].as_bool()), (Some(false), Some(true)), "{json}");
    assert!(json["undetermined"].as_array().is_some_and(|u| !u.is_empty()), "{json}");
    let info = bench.ok(&["info", "I.toml", "--json"]).json();
    assert!(info.to_string().contains("\"good\":false"), "{info}");
    // a camera that looks elsewhere: the spots should lie where nothing is, or outside the picture
    let text = String::from_utf8(bench.read("half.toml")).expect("text");
    let look = text.find("look = [").expect("a direction");
    let end = look + text[look..].find(']').expect("its end") + 1;
    bench.write("elsewhere.toml", format!("{}look = [0.0, 0.8, 0.6]{}", &text[..look], &text[end..]));
    let elsewhere = [&words[..], &["K.toml", "--instrument", "elsewhere.toml"]].concat();
    let ran = refused(&bench, &elsewhere, 1, &["0 spots", "at least 8", "poses"]);
    assert!(!bench.path("K.toml").exists(), "{}", ran.stderr);
    // one pose is too few, whatever it shows
    bench.write("one.toml", "format = \"gonio-plan\"\ntilt_deg = [30]\n");
    let one = [
        "scan",
        "--instrument",
        "half.toml",
        "--kind",
        "black-glass",
        "--plan",
        "one.toml",
        "-o",
        "one.mcap",
    ];
    bench.ok(&one);
    refused(&bench, &["calibrate", "geometry", "one.mcap", "-o", "L.toml"], 1, &["1 spots", "at least 8"]);
}
