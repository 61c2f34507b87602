//! What goes wrong is told in one error that says what to do, with the right exit code, and leaves everything as it was.

use crate::command::{Bench, PAINT, Ran};

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
