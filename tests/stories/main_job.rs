//! The main job: a paint on the virtual instrument is scanned through the serial driver, recorded, reduced, fitted and shown.

use crate::command::{Bench, PAINT, end, flip_bit, until};

const SCAN: &[&str] = &["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap", "--fit"];

fn with_paint() -> Bench {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench
}

fn parameter(json: &serde_json::Value, name: &str) -> f64 {
    json["fit"]["parameters"][name]["value"].as_f64().unwrap_or_else(|| panic!("{name} in {json}"))
}

#[test]
fn a_scan_leaves_session_table_model_report_and_pictures_and_finds_the_paint() {
    let bench = with_paint();
    let ran = bench.ok(&[SCAN, &["--json", "--sample", "A1", "--name", "Red <paint>"]].concat());
    let json = ran.json();
    assert_eq!(json["poses_done"], 6);
    assert_eq!(json["complete"], true);
    let n = parameter(&json, "exponent");
    assert!((n / 60.0 - 1.0).abs() < 0.03, "exponent {n}");
    for (name, truth) in [("diffuse_r", 0.3), ("diffuse_g", 0.12), ("diffuse_b", 0.06)] {
        assert!((parameter(&json, name) / truth - 1.0).abs() < 0.02, "{name} {}", parameter(&json, name));
    }
    for (name, truth) in [("specular_r", 0.1), ("specular_g", 0.08), ("specular_b", 0.12)] {
        assert!((parameter(&json, name) / truth - 1.0).abs() < 0.05, "{name} {}", parameter(&json, name));
    }
    let report = String::from_utf8(bench.read("S.report.html")).expect("text");
    assert!(report.contains("Red &lt;paint&gt;") && report.contains("data:image/png;base64"));
    for picture in ["lobe", "spheres", "compare", "unfolded", "coverage", "sigma"] {
        let png = bench.read(&format!("S.pictures/{picture}.png"));
        assert!(png.starts_with(b"\x89PNG") && png.len() > 2000, "{picture}: {} bytes", png.len());
    }
    // nothing half-written stays behind
    let left: Vec<_> =
        std::fs::read_dir(bench.path("")).expect("folder").flatten().map(|e| e.file_name()).collect();
    assert!(left.iter().all(|n| !n.to_string_lossy().contains("partial")), "{left:?}");
}

#[test]
fn a_replay_gives_the_same_table_byte_for_byte() {
    let bench = with_paint();
    bench.ok(SCAN);
    bench.ok(&["replay", "S.mcap", "-o", "again.nc"]);
    assert!(bench.read("S.nc") == bench.read("again.nc"), "the replayed table differs");
    // moved to another folder and name, with the reference named
    std::fs::create_dir(bench.path("elsewhere")).expect("folder");
    std::fs::copy(bench.path("S.mcap"), bench.path("elsewhere/T.mcap")).expect("copied");
    bench.ok(&["replay", "elsewhere/T.mcap", "--reference", "S.white.mcap", "-o", "moved.nc"]);
    assert!(bench.read("S.nc") == bench.read("moved.nc"), "the table depends on names");
}

#[test]
fn an_interrupted_scan_keeps_what_it_has_and_goes_on_to_the_same_table() {
    let bench = with_paint();
    bench.ok(SCAN);
    let slow: Vec<&str> = [SCAN, &["--time-scale", "20", "--force"]].concat();
    let slow: Vec<&str> = slow.into_iter().map(|w| if w == "S.mcap" { "I.mcap" } else { w }).collect();
    let child = bench.start(&slow);
    until("the first pose", || bench.path("I.nc").exists());
    let status = bench.ok(&["status", "--json"]).json();
    assert_eq!(status["scans"][0]["session"], "I.mcap", "{status}");
    assert_eq!(status["scans"][0]["poses_total"], 6, "{status}");
    bench.ok(&["stop"]);
    let ran = end(child);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("stopped on request") && ran.stderr.contains("--resume"), "{}", ran.stderr);
    let done = bench.ok(&["info", "I.mcap", "--json"]).json()["poses"].as_array().expect("poses").len();
    assert!((1..6).contains(&done), "{done} poses before the stop");
    let resumed: Vec<&str> = slow.iter().map(|w| if *w == "--force" { "--resume" } else { *w }).collect();
    bench.ok(&resumed);
    let info = bench.ok(&["info", "I.mcap", "--json"]).json();
    assert_eq!(info["complete"], true);
    assert_eq!(info["files"].as_array().map(Vec::len), Some(2), "the next segment");
    bench.ok(&["replay", "I.mcap", "-o", "again.nc"]);
    assert!(
        bench.read("I.nc") == bench.read("again.nc"),
        "the continued scan's table differs from its replay"
    );
}

#[test]
fn any_damage_to_a_session_is_told_and_the_rest_recovered() {
    let bench = with_paint();
    bench.ok(&["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap"]);
    assert_eq!(bench.ok(&["verify", "S.mcap", "--json"]).json()["status"], "intact");
    let length = bench.read("S.mcap").len();
    flip_bit(&bench.path("S.mcap"), length / 2);
    let ran = bench.run(&["verify", "S.mcap", "--json"]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let lost = ran.json()["lost"].as_array().map_or(0, Vec::len);
    let ran = bench.run(&["recover", "S.mcap", "-o", "R.mcap"]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let info = bench.run(&["info", "R.mcap", "--json"]).json();
    assert_eq!(info["poses"].as_array().map(Vec::len), Some(6 - lost));
}

#[test]
fn the_virtual_instrument_serves_another_program_through_a_serial_port_and_a_socket() {
    let bench = with_paint();
    bench.ok(SCAN);
    let mut served = bench.start(&[
        "sim",
        "--instrument",
        "tiny",
        "--pty",
        "stage",
        "--camera-socket",
        "cam.sock",
        "--truth",
        "paint.json",
    ]);
    until("the camera's socket", || bench.path("cam.sock").exists() && bench.path("stage").exists());
    bench.ok(&[
        "scan",
        "--instrument",
        "tiny",
        "--device",
        "serial:stage",
        "--camera",
        "sim:cam.sock",
        "--reference",
        "S.white.mcap",
        "-o",
        "T.mcap",
        "--fit",
    ]);
    assert!(
        bench.read("T.nc") == bench.read("S.nc"),
        "the same instrument from another process measures otherwise"
    );
    // a second client is told that the port is taken
    interrupt(&mut served);
}

/// Ends the server the way Ctrl-C does.
fn interrupt(child: &mut std::process::Child) {
    let done = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(done.is_ok_and(|s| s.success()), "kill");
    let status = child.wait().expect("the server ends");
    assert_eq!(status.code(), Some(0));
}

#[test]
fn the_demo_says_what_the_paint_was_and_what_was_found() {
    let bench = Bench::new();
    let ran = bench.ok(&["demo", "--tiny", "-o", "demo"]);
    assert!(ran.stdout.contains("exponent") && ran.stdout.contains("120"), "{}", ran.stdout);
    assert!(bench.path("demo/demo.report.html").exists());
    let again = bench.run(&["demo", "--tiny", "-o", "demo"]);
    assert_eq!(again.code, 2, "an earlier demo is not overwritten");
}
