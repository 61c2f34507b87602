//! A bad line between host and stage costs time, never data.

use crate::command::{Bench, PAINT, Ran, end, until};

const SCAN: &[&str] = &["scan", "--instrument", "tiny", "--truth", "paint.json", "--fit", "--json"];

/// The table of a mistreated scan is that of the clean one, byte for byte; where a frame was spoilt and taken again its noise is another, and the paint
/// must be found all the same.
fn the_same_table(bench: &Bench, mistreated: &str, ran: &Ran) {
    if bench.read("clean.nc") == bench.read(mistreated) {
        return;
    }
    let again = ["taken again", "begins anew"].iter().any(|told| ran.stderr.contains(told));
    assert!(again, "the trouble shows in the table, and no frame was taken again: {}", ran.stderr);
    let json = ran.json();
    let found = |name: &str| json["fit"]["parameters"][name]["value"].as_f64().unwrap_or_default();
    for (name, truth, within) in
        [("exponent", 60.0, 0.03), ("diffuse_r", 0.3, 0.02), ("specular_r", 0.1, 0.05)]
    {
        assert!((found(name) / truth - 1.0).abs() < within, "{name} {}", found(name));
    }
}

#[test]
fn a_scan_over_a_bad_line_ends_with_the_same_table_and_the_report_tells_of_it() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write(
        "faults.toml",
        "format = \"gonio-faults\"\nversion = 1\n[link]\nloss = 0.05\ncorruption = 0.05\nduplication = 0.05\n",
    );
    bench.ok(&[SCAN, &["-o", "clean.mcap"]].concat());
    let ran = bench.ok(&[SCAN, &["-o", "bad.mcap", "--faults", "faults.toml"]].concat());
    let link = &ran.json()["link"];
    let again = link["retransmitted"].as_u64().unwrap_or_default();
    assert!(
        again > 0 && link["corrupted"].as_u64() > Some(0) && link["duplicates"].as_u64() > Some(0),
        "{link}"
    );
    the_same_table(&bench, "bad.nc", &ran);
    let report = String::from_utf8(bench.read("bad.report.html")).expect("text");
    let told = report.split("sent again").nth(1).unwrap_or_default();
    let told: String =
        told.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    assert_eq!(told.parse().ok(), Some(again), "the report tells what was sent again");
}

#[test]
fn a_line_that_hangs_up_and_comes_back_costs_nothing() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.ok(&[SCAN, &["-o", "clean.mcap"]].concat());
    // by the transport, again and again; and by the plug, once
    bench.write(
        "faults.toml",
        "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"hang-up\"\nat_move = 4\nfor_s = 300.0\n\
         [link]\nhang_up_after = 20000\nhang_up_ms = 150\nhalf_open_after = 9000\nhalf_open_ms = 100\n",
    );
    let ran = bench.ok(&[SCAN, &["-o", "S.mcap", "--faults", "faults.toml"]].concat());
    assert!(ran.json()["link"]["sessions"].as_u64() > Some(1), "{}", ran.json()["link"]);
    the_same_table(&bench, "S.nc", &ran);
    bench.ok(&["verify", "S.mcap"]);
}

#[test]
fn a_suspended_host_goes_on_and_a_second_one_is_turned_away() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    let words = ["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "clean.mcap", "--fit"];
    bench.ok(&words);
    let virtual_instrument =
        ["--pty", "stage", "--camera-socket", "cam", "--truth", "paint.json", "--time-scale", "20"];
    let mut served = bench.start(&[&["sim", "--instrument", "tiny"], &virtual_instrument[..]].concat());
    until("the virtual instrument", || bench.path("cam").exists() && bench.path("stage").exists());
    let devices = ["scan", "--instrument", "tiny", "--device", "serial:stage", "--camera", "sim:cam"];
    let reference = ["--reference", "clean.white.mcap", "--fit", "--json"];
    let host = bench.start(&[&devices[..], &reference, &["-o", "S.mcap"]].concat());
    let signal = |name: &str| {
        let sent = std::process::Command::new("kill").args([name, &host.id().to_string()]).status();
        assert!(sent.is_ok_and(|s| s.success()), "kill {name}");
    };
    until("the first pose", || bench.path("S.nc").exists());
    let second = bench.run(&[&devices[..], &["-o", "T.mcap"]].concat());
    assert_eq!(second.code, 4, "{}", second.stderr);
    assert!(second.stderr.contains("in use") && second.stderr.contains("gonio stop"), "{}", second.stderr);
    signal("-STOP");
    // longer than the lease, and than the host's own patience with a silent device
    std::thread::sleep(std::time::Duration::from_secs(3));
    signal("-CONT");
    let ran = end(host);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    the_same_table(&bench, "S.nc", &ran);
    let _ = served.kill();
    let _ = served.wait();
}

#[test]
fn an_opened_lid_and_a_restart_are_waited_for_and_every_pose_is_taken() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.ok(&[SCAN, &["-o", "clean.mcap"]].concat());
    bench.write(
        "faults.toml",
        "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"interlock-open\"\nat_move = 2\nfor_s = 400.0\n\
         [[event]]\nwhat = \"restart\"\nat_move = 4\n",
    );
    let ran = bench.ok(&[SCAN, &["-o", "S.mcap", "--faults", "faults.toml"]].concat());
    assert!(ran.stderr.contains("interlock"), "the wait is told: {}", ran.stderr);
    assert_eq!(ran.json()["complete"], true);
    the_same_table(&bench, "S.nc", &ran);
}

#[test]
fn a_bad_camera_costs_frames_and_no_pose() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write(
        "faults.toml",
        "format = \"gonio-faults\"\nversion = 1\n[camera]\ndropped = 0.1\ntorn = 0.1\nfrozen = 0.05\nduplicated = 0.05\n\
         late = 0.05\nlate_by_ms = 5.0\n",
    );
    let ran = bench.ok(&[SCAN, &["-o", "S.mcap", "--faults", "faults.toml"]].concat());
    let camera = &ran.json()["camera"];
    assert!(camera["missing"].as_u64() > Some(0) && camera["torn"].as_u64() > Some(0), "{camera}");
    bench.ok(&["verify", "S.mcap"]);
}

#[test]
fn a_full_disk_ends_the_scan_with_the_poses_before_it_and_it_goes_on() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write("faults.toml", "format = \"gonio-faults\"\nversion = 1\n[file]\nfull_after = 200000\n");
    let words: &[&str] = &["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap"];
    let ran = bench.run(&[words, &["--faults", "faults.toml"]].concat());
    assert_eq!(ran.code, 1, "{}\n{}", ran.stdout, ran.stderr);
    assert!(ran.stderr.contains("--resume"), "{}", ran.stderr);
    bench.ok(&["verify", "S.mcap"]);
    let done = bench.ok(&["info", "S.mcap", "--json"]).json()["poses"].as_array().map_or(0, Vec::len);
    assert!((1..6).contains(&done), "{done} poses before the disk was full");
    bench.ok(&[words, &["--resume"]].concat());
    assert_eq!(bench.ok(&["info", "S.mcap", "--json"]).json()["complete"], true);
}

#[test]
fn a_line_that_hangs_up_ends_the_scan_with_what_was_measured_kept() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write("faults.toml", "format = \"gonio-faults\"\nversion = 1\n[link]\nhang_up_after = 6000\n");
    let ran = bench.run(&[SCAN, &["-o", "S.mcap", "--faults", "faults.toml", "--patience", "0.2"]].concat());
    assert_eq!(ran.code, 4, "{}\n{}", ran.stdout, ran.stderr);
    assert_eq!(ran.stderr.matches("--resume").count(), 1, "how to go on is said once: {}", ran.stderr);
    bench.ok(&["verify", "S.mcap"]);
}
