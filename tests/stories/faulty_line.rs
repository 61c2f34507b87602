//! A bad line between host and stage costs time, never data.

use crate::command::{Bench, PAINT};

const SCAN: &[&str] = &["scan", "--instrument", "tiny", "--truth", "paint.json", "--fit", "--json"];

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
    assert!(bench.read("clean.nc") == bench.read("bad.nc"), "the line shows in the table");
    let report = String::from_utf8(bench.read("bad.report.html")).expect("text");
    let told = report.split("sent again").nth(1).unwrap_or_default();
    let told: String =
        told.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    assert_eq!(told.parse().ok(), Some(again), "the report tells what was sent again");
}

#[test]
fn a_line_that_hangs_up_ends_the_scan_with_what_was_measured_kept() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write("faults.toml", "format = \"gonio-faults\"\nversion = 1\n[link]\nhang_up_after = 6000\n");
    let ran = bench.run(&[SCAN, &["-o", "S.mcap", "--faults", "faults.toml"]].concat());
    assert_eq!(ran.code, 4, "{}\n{}", ran.stdout, ran.stderr);
    assert_eq!(ran.stderr.matches("--resume").count(), 1, "how to go on is said once: {}", ran.stderr);
    bench.ok(&["verify", "S.mcap"]);
}
