//! Going on with a session: the same scan, or a word that says what differs; and files that are not to come to harm.

use crate::command::{Bench, PAINT, Ran};

const GLOSSY: &str = r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.02,0.02,0.02],"specular":[0.3,0.3,0.3],"exponent":400.0}"#;
const STALL: &str = "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"stall-tilt\"\nat_move = 3\n";
const SCAN: &[&str] = &["scan", "--instrument", "tiny", "--truth", "paint.json"];
const GO_ON: &[&str] = &["scan", "--instrument", "tiny", "-o", "S.mcap", "--resume"];

fn refused(bench: &Bench, words: &[&str], said: &[&str]) -> Ran {
    let ran = bench.run(words);
    assert_eq!(ran.code, 2, "gonio {}\n{}\n{}", words.join(" "), ran.stdout, ran.stderr);
    for s in said {
        assert!(ran.stderr.contains(s), "gonio {} does not say {s:?}:\n{}", words.join(" "), ran.stderr);
    }
    ran
}

fn files(bench: &Bench) -> Vec<String> {
    let entries = std::fs::read_dir(bench.path("")).expect("folder").flatten();
    let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    // where running scans are found
    names.retain(|n| n != "run");
    names.sort();
    names
}

/// A session that a stall broke off, and the table of one that it did not.
fn broken_off() -> Bench {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    bench.write("glossy.json", GLOSSY);
    bench.write("faults.toml", STALL);
    bench.ok(&[SCAN, &["-o", "whole.mcap", "--fit"]].concat());
    let ran =
        bench.run(&[SCAN, &["-o", "S.mcap", "--fit", "--name", "Red", "--faults", "faults.toml"]].concat());
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    assert_eq!(ran.stderr.trim_end().lines().count(), 1, "one error line and nothing else: {}", ran.stderr);
    assert!(!ran.stderr.contains('\u{1b}'), "no colours where no terminal is: {:?}", ran.stderr);
    bench
}

#[test]
fn a_continued_scan_takes_paint_and_names_from_its_session() {
    let bench = broken_off();
    let json = bench.ok(&[GO_ON, &["--fit", "--json"]].concat()).json();
    let n = json["fit"]["parameters"]["exponent"]["value"].as_f64().unwrap_or_default();
    assert!((n / 60.0 - 1.0).abs() < 0.03, "the paint of the session, not the standard one: {n}");
    let brdf = |table: &str| {
        bench.ok(&["convert", table, &format!("{table}.csv")]);
        bench.read(&format!("{table}.csv"))
    };
    assert!(brdf("S.nc") == brdf("whole.nc"), "interrupted and not, the same values");
    let report = String::from_utf8(bench.read("S.report.html")).expect("text");
    assert!(report.contains("Red"), "the name given at the beginning");
    // a third time there is nothing to do, and no segment is begun
    let before = files(&bench);
    let ran = bench.ok(&[GO_ON, &["--json"]].concat());
    assert_eq!(ran.json()["complete"], true);
    assert!(ran.stderr.contains("done already"), "{}", ran.stderr);
    assert_eq!(files(&bench), before);
    let nc = bench.read("S.nc");
    bench.ok(&[GO_ON, &["--fit"]].concat());
    assert!(bench.read("S.nc") == nc);
}

#[test]
fn another_paint_seed_kind_or_name_is_refused_when_going_on() {
    let bench = broken_off();
    let before = files(&bench);
    refused(&bench, &[GO_ON, &["--truth", "glossy.json"]].concat(), &["glossy.json", "leave --truth out"]);
    refused(&bench, &[GO_ON, &["--seed", "7"]].concat(), &["--seed 1"]);
    refused(&bench, &[GO_ON, &["--misalignment", "builtin"]].concat(), &["--misalignment"]);
    refused(&bench, &[GO_ON, &["--kind", "white"]].concat(), &["--kind sample"]);
    refused(&bench, &[GO_ON, &["--name", "Blue"]].concat(), &["--name", "Red"]);
    assert_eq!(files(&bench), before);
}

#[test]
fn a_session_is_never_written_over_by_what_is_computed_from_it() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    // S.nc is the name of the table
    refused(&bench, &[SCAN, &["-o", "S.nc", "--fit"]].concat(), &["S.mcap"]);
    bench.ok(&[SCAN, &["-o", "S.mcap", "--fit"]].concat());
    // S.2.mcap is where a continued scan of S.mcap goes
    refused(&bench, &[SCAN, &["-o", "S.2.mcap"]].concat(), &["continuation"]);
    let (session, white, table) = (bench.read("S.mcap"), bench.read("S.white.mcap"), bench.read("S.nc"));
    refused(&bench, &["replay", "S.mcap", "-o", "S.mcap", "--force"], &["read here"]);
    let words = ["replay", "S.mcap", "--reference", "S.white.mcap", "-o", "./S.white.mcap", "--force"];
    refused(&bench, &words, &["read here"]);
    refused(&bench, &["recover", "S.mcap", "-o", "S.mcap", "--force"], &["read here"]);
    refused(&bench, &["convert", "S.nc", "S.nc", "--force"], &["read here"]);
    refused(&bench, &["fit", "S.nc", "-o", "S.nc", "--force"], &["read here"]);
    refused(&bench, &["fit", "S.nc", "-o", "x.json", "--report", "x.json"], &["same file"]);
    assert!(
        bench.read("S.mcap") == session && bench.read("S.white.mcap") == white && bench.read("S.nc") == table
    );
}

#[test]
fn a_reference_is_looked_at_before_a_scan_and_found_again_from_another_folder() {
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    refused(&bench, &[SCAN, &["--reference", "absent.mcap", "-o", "S.mcap"]].concat(), &["absent.mcap"]);
    assert!(!bench.path("S.mcap").exists());
    std::fs::create_dir(bench.path("refs")).expect("folder");
    std::fs::create_dir(bench.path("out")).expect("folder");
    bench.ok(&["scan", "--instrument", "tiny", "--kind", "white", "-o", "refs/W.mcap"]);
    bench.ok(&[SCAN, &["--reference", "refs/W.mcap", "-o", "out/S.mcap"]].concat());
    bench.ok(&["replay", "out/S.mcap", "-o", "S.nc"]);
}

#[test]
fn a_refused_command_leaves_nothing_behind() {
    let bench = Bench::new();
    bench.write(
        "faults.toml",
        "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"interlock-open\"\nat_s = 0.0\n",
    );
    let ran = bench.run(&["scan", "--instrument", "tiny", "--faults", "faults.toml", "-o", "S.mcap"]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    assert!(!bench.path("S.mcap").exists(), "refused before anything was measured");
    refused(&bench, &["show", "absent.nc", "-o", "pictures"], &["absent.nc"]);
    refused(&bench, &["demo", "--tiny", "--exponent=-3", "-o", "demo"], &["exponent"]);
    refused(&bench, &["scan", "--instrument", "absent.toml", "-o", "S.mcap"], &["absent.toml", "tiny"]);
    assert_eq!(files(&bench), ["faults.toml"]);
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_utf_8_are_as_good_as_others() {
    use std::os::unix::ffi::OsStrExt;
    let bench = Bench::new();
    bench.write("paint.json", PAINT);
    let name = std::ffi::OsStr::from_bytes(b"n\xffame.mcap");
    let run = |words: &[&str], last: &[&str]| {
        let out = bench.command(words).arg(name).args(last).output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{words:?}: {stderr}");
        assert!(serde_json::from_slice::<serde_json::Value>(&out.stdout).is_ok(), "{words:?}");
    };
    run(&[SCAN, &["--fit", "--json", "-o"]].concat(), &[]);
    run(&["verify", "--json"], &[]);
    run(&["replay", "--json"], &["-o", "again.nc"]);
    let table =
        std::fs::read(bench.path("").join(std::ffi::OsStr::from_bytes(b"n\xffame.nc"))).expect("beside");
    assert!(table == bench.read("again.nc"));
}
