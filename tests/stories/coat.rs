//! A clear coat as the person at the bench meets it: looked for by itself, refused where it is not, taken by its index where that is known.

use crate::command::{Bench, PAINT};

fn scanned() -> Bench {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.ok(&["scan", "--instrument", "tiny", "--truth", "paint.json", "-o", "S.mcap", "--fit"]);
    bench
}

#[test]
fn a_paint_without_a_coat_is_left_alone_and_says_so() {
    let bench = scanned();
    let json = bench.ok(&["replay", "S.mcap", "-o", "auto.nc", "--json"]).json();
    assert_eq!(json["coat"]["separated"], false, "{json}");
    assert!(json["coat"]["why"].as_str().is_some_and(|w| !w.is_empty()), "{json}");
    // asked for by name it is refused, and nothing is written
    let ran = bench.run(&["replay", "S.mcap", "-o", "forced.nc", "--clear-coat", "two-way"]);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("no clear coat was found") && ran.stderr.contains("--coat-index"),
        "{}",
        ran.stderr
    );
    assert!(!bench.path("forced.nc").exists());
    let ran = bench.run(&["replay", "S.mcap", "-o", "x.nc", "--clear-coat", "none", "--coat-index", "1.5"]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("--coat-index"), "{}", ran.stderr);
    let ran = bench.run(&["replay", "S.mcap", "-o", "x.nc", "--coat-index", "0.7"]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("1.01 to 3"), "{}", ran.stderr);
}

#[test]
fn a_coat_of_a_given_index_is_divided_out_both_ways() {
    let bench = scanned();
    let asked = ["replay", "S.mcap", "-o", "c.nc", "--clear-coat", "two-way", "--coat-index", "1.5"];
    let json = bench.ok(&[&asked[..], &["--json", "--fit"]].concat()).json();
    assert_eq!(json["coat"]["separated"], true, "{json}");
    assert_eq!(json["coat"]["index"], 1.5, "{json}");
    let info = bench.ok(&["info", "c.nc", "--json"]).json();
    assert_eq!(info["attributes"]["clear_coat"], "two-way", "{info}");
    // the model is that of the base under the coat, unless the surface as it is seen is asked for
    let model: serde_json::Value = serde_json::from_slice(&bench.read("c.model.json")).expect("JSON");
    assert_eq!(model["coat"]["index"], 1.5, "{model}");
    let report = String::from_utf8(bench.read("c.report.html")).expect("text");
    assert!(report.contains("under a coat of index 1.5"), "the report does not name the coat");
    let bare = bench.ok(&["fit", "c.nc", "--coat", "none", "--model", "lambert", "--json"]).json();
    assert!(bare["model"]["coat"].is_null(), "{bare}");
}

#[test]
fn what_a_scan_was_told_of_the_coat_a_replay_does_too() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    let scan = [
        "scan",
        "--instrument",
        "tiny",
        "--truth",
        "paint.json",
        "-o",
        "S.mcap",
        "--fit",
        "--coat-index",
        "1.5",
    ];
    bench.ok(&scan);
    bench.ok(&["replay", "S.mcap", "-o", "again.nc"]);
    assert!(bench.read("S.nc") == bench.read("again.nc"), "the replayed table differs");
    bench.ok(&["replay", "S.mcap", "-o", "other.nc", "--clear-coat", "none"]);
    assert!(bench.read("S.nc") != bench.read("other.nc"));
}
