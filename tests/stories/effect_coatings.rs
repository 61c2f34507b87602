//! Effect coatings end to end: maps made, saved, drawn, compared and asked for what they do not hold.

use std::fmt::Write as _;

use serde_json::Value;

use crate::command::{Bench, Ran};

/// A metallic base under a coat: the virtual paint of these stories.
const EFFECT: &str = r#"{"model":"ggx","diffuse":[0.02,0.05,0.2],"lobes":[{"specular":[0.35,0.25,0.1],"alpha":0.35,"r0":0.5}],"coat":{"index":1.5}}"#;
/// The same base without its coat.
const BARE: &str = r#"{"model":"ggx","diffuse":[0.02,0.05,0.2],"lobes":[{"specular":[0.35,0.25,0.1],"alpha":0.35,"r0":0.5}]}"#;
const HEAD: &str = "theta_i_deg,theta_o_deg,phi_deg";

fn refused(bench: &Bench, words: &[&str], said: &[&str]) -> Ran {
    let ran = bench.run(words);
    assert_eq!(ran.code, 2, "gonio {}\n{}\n{}", words.join(" "), ran.stdout, ran.stderr);
    for s in said {
        assert!(ran.stderr.contains(s), "gonio {} does not say {s:?}:\n{}", words.join(" "), ran.stderr);
    }
    assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
    ran
}

/// Rows of a CSV as numbers, without its header.
fn rows(bench: &Bench, name: &str) -> Vec<Vec<f64>> {
    let text = String::from_utf8(bench.read(name)).expect("text");
    text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().expect("a number")).collect()).collect()
}

/// A CSV of geometries within 75° and away from the mirror direction.
fn geometries(bench: &Bench, name: &str) -> usize {
    let mut text = format!("{HEAD}\n");
    let mut count = 0;
    for ti in [5.0, 25.0, 50.0, 70.0] {
        for to in [0.0, 35.0, 60.0] {
            for phi in [0.0, 60.0, 110.0] {
                let _ = writeln!(text, "{ti},{to},{phi}");
                count += 1;
            }
        }
    }
    bench.write(name, text);
    count
}

/// Measured rows of the virtual paint at some geometries.
fn measured(bench: &Bench, list: &[(f64, f64, f64)], name: &str) {
    let mut text = format!("{HEAD}\n");
    for (ti, to, phi) in list {
        let _ = writeln!(text, "{ti},{to},{phi}");
    }
    bench.write("list.csv", text);
    bench.ok(&["eval", "paint.json", "--geometries", "list.csv", "-o", name, "--force"]);
}

/// What portable instruments measure: 45° at aspecular −15, 15, 25, 45, 75, 110, and 15° at −15 and 15.
fn multi_angle() -> Vec<(f64, f64, f64)> {
    let at = |light: f64, aspecular: f64| {
        let view = light - aspecular;
        (light, view.abs(), if view < 0.0 { 0.0 } else { 180.0 })
    };
    let from_45 = [-15.0, 15.0, 25.0, 45.0, 75.0, 110.0].map(|a| at(45.0, a));
    from_45.into_iter().chain([-15.0, 15.0].map(|a| at(15.0, a))).collect()
}

#[test]
fn a_flake_map_is_saved_told_and_used_like_any_material() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    let made = bench.ok(&["fit", "paint.json", "--model", "flake-map:1", "-o", "map.json", "--json"]).json();
    assert_eq!(made["flake_map"]["index"], 1.5, "the coat's own index");
    let mean = made["delta_e"]["beyond_15_deg"]["mean"].as_f64().expect("a mean");
    assert!(mean < 1.5, "{mean}");

    let told = bench.ok(&["info", "map.json", "--json"]).json();
    assert_eq!((&told["format"], &told["attributes"]["harmonics"]), (&"flake-map".into(), &"1".into()));

    let count = geometries(&bench, "g.csv");
    bench.ok(&["eval", "map.json", "--geometries", "g.csv", "-o", "loaded.csv"]);
    bench.ok(&["eval", "paint.json", "--as", "flake-map:1", "--geometries", "g.csv", "-o", "made.csv"]);
    assert_eq!(bench.read("loaded.csv"), bench.read("made.csv"), "loading computes nothing again");
    assert_eq!(rows(&bench, "made.csv").len(), count);

    // what the map holds can be made smaller, not larger
    bench.ok(&["fit", "map.json", "--model", "flake-map:0", "-o", "small.json"]);
    refused(
        &bench,
        &["fit", "map.json", "--model", "flake-map:2", "-o", "large.json"],
        &["harmonics", "measurement"],
    );
    bench.ok(&["colormap", "map.json", "--flake=1", "-o", "map.png"]);
    bench.ok(&["convert", "map.json", "sampled.csv"]);
    let trade = bench.ok(&["trade", "map.json", "--only", "clip,flake-map:1", "--json"]).json();
    let exact = trade["candidates"][1]["delta_e"]["beyond_15_deg"]["max"].as_f64().expect("a number");
    assert!(exact < 0.01, "the map is itself: {exact}");
}

#[test]
fn every_representation_is_evaluated_and_says_what_it_does_not_hold() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    let count = geometries(&bench, "g.csv");
    bench.ok(&["eval", "paint.json", "--geometries", "g.csv", "-o", "truth.csv"]);
    let truth = rows(&bench, "truth.csv");
    let mut errors = Vec::new();
    for name in
        ["aspecular", "unit-index", "clip", "map-vector", "map-vector-parallel", "flake-map:0", "flake-map:1"]
    {
        let out = format!("{}.csv", name.replace(':', "-"));
        let ran = bench
            .ok(&["eval", "paint.json", "--as", name, "--geometries", "g.csv", "-o", &out, "--json"])
            .json();
        assert_eq!((&ran["representation"], &ran["geometries"]), (&name.into(), &count.into()));
        let said = rows(&bench, &out);
        let flagged = said.iter().filter(|r| r[6] == 2.0).count();
        let counted: u64 = ["beyond_critical_angle", "beyond_largest", "nothing_near", "within_gloss"]
            .iter()
            .filter_map(|k| ran[*k].as_u64())
            .sum();
        assert_eq!(flagged as u64, counted, "{name}");
        let error: f64 =
            said.iter().zip(&truth).map(|(s, t)| (s[4] / t[4]).ln().abs()).sum::<f64>() / count as f64;
        errors.push((name, error));
    }
    let of = |name: &str| errors.iter().find(|e| e.0 == name).expect("it ran").1;
    assert!(of("flake-map:1") < of("flake-map:0") && of("flake-map:0") < of("clip"), "{errors:?}");
    assert!(of("clip") < of("aspecular"), "{errors:?}");

    bench.write("steep.csv", format!("{HEAD}\n85,20,180\n75,75,110\n20,30,0\n"));
    let steep =
        ["eval", "paint.json", "--as", "clip", "--geometries", "steep.csv", "-o", "steep.out.csv", "--json"];
    let ran = bench.ok(&steep).json();
    assert_eq!((&ran["beyond_largest"], &ran["beyond_critical_angle"]), (&1.into(), &1.into()));
    let flags: Vec<f64> = rows(&bench, "steep.out.csv").iter().map(|r| r[6]).collect();
    assert_eq!(flags, [2.0, 2.0, 0.0]);
}

#[test]
fn colour_maps_are_drawn_and_written_for_shaders() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    for (flags, name) in
        [(&["--method", "map-vector"][..], "a"), (&["--aspecular"][..], "b"), (&["--flake"][..], "c")]
    {
        for ending in ["png", "exr"] {
            let out = format!("{name}.{ending}");
            let words: Vec<&str> = ["colormap", "paint.json", "--nodes", "24", "-o", &out, "--json"]
                .into_iter()
                .chain(flags.iter().copied())
                .collect();
            let told = bench.ok(&words).json();
            assert_eq!(told["gloss"]["done"], "none-in-it", "a model's coat mirrors nothing by itself");
            let bytes = bench.read(&out);
            let magic: &[u8] = if ending == "png" { b"\x89PNG" } else { &[0x76, 0x2f, 0x31, 0x01] };
            assert!(bytes.starts_with(magic), "{out}");
            if ending == "exr" {
                assert!(bytes.windows(12).any(|w| w == b"gonio_layout"), "{out} does not say how it is read");
            }
        }
    }
    // the same picture each time
    bench.ok(&["colormap", "paint.json", "--nodes", "24", "--method", "map-vector", "-o", "again.png"]);
    assert_eq!(bench.read("a.png"), bench.read("again.png"));
}

#[test]
fn the_trade_is_told_as_table_json_csv_and_pictures() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    let ran = bench.ok(&["trade", "paint.json", "--nodes", "32", "-o", "out", "--json"]);
    let told = ran.json();
    let share = told["beyond_critical_share"].as_f64().expect("a share");
    assert!((0.30..0.40).contains(&share), "{share}");
    let candidates = told["candidates"].as_array().expect("candidates");
    let mean = |name: &str| {
        let c = candidates.iter().find(|c| c["name"] == name).unwrap_or_else(|| panic!("{name} is missing"));
        assert!(c["ns"].as_f64().is_some_and(|x| x > 0.0) && c["bytes"].as_u64().is_some_and(|b| b > 0));
        c["delta_e"]["beyond_15_deg"]["mean"].as_f64().expect("a mean")
    };
    assert!(
        mean("flake-map:1") < mean("flake-map:0")
            && mean("flake-map:0") < mean("clip")
            && mean("clip") < mean("aspecular")
    );
    assert!(mean("lambert") > mean("table"));
    assert!(candidates.iter().any(|c| c["on_front"] == true));
    for file in ["trade.json", "trade.csv", "report.html", "pareto.png", "colour-map.png", "flake-map.png"] {
        assert!(!bench.read(&format!("out/{file}")).is_empty(), "{file}");
    }
    let written: Value = serde_json::from_slice(&bench.read("out/trade.json")).expect("JSON");
    assert_eq!(written, told);
    let csv = String::from_utf8(bench.read("out/trade.csv")).expect("text");
    assert_eq!(csv.lines().count(), candidates.len() + 1);
    refused(&bench, &["trade", "paint.json", "-o", "out"], &["exists", "--force"]);

    // over a scene's own geometries: light from the front, where no critical angle is met
    bench.write("scene.csv", format!("{HEAD},weight\n10,20,0,5\n10,30,90,1\n0,40,0,0\n"));
    let words = ["trade", "paint.json", "--only", "clip,flake-map:0", "--geometries", "scene.csv", "--json"];
    let told = bench.ok(&words).json();
    assert_eq!((&told["geometries"], &told["beyond_critical_share"]), (&2.into(), &0.0.into()));
    let text = bench.ok(&words[..6]).stdout;
    assert!(text.contains("flake-map:0") && text.contains("ΔE beyond 15°"), "{text}");
    refused(&bench, &["trade", "paint.json", "--scene", "s.toml"], &["s.toml", "cannot be read"]);
}

#[test]
fn eight_angles_of_a_portable_instrument_give_a_map_that_says_how_little_it_knows() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    measured(&bench, &multi_angle(), "portable.csv");
    let told = bench.ok(&["colormap", "portable.csv", "-o", "portable.png", "--json"]).json();
    assert!(
        told["findings"].as_array().is_some_and(|f| f.iter().any(|x| x["kind"] == "estimated")),
        "{told}"
    );
    let told =
        bench.ok(&["fit", "portable.csv", "--model", "flake-map:0", "-o", "portable.json", "--json"]).json();
    let kinds: Vec<&str> =
        told["findings"].as_array().expect("findings").iter().filter_map(|f| f["kind"].as_str()).collect();
    assert!(kinds.contains(&"all-in-plane") && kinds.contains(&"estimated"), "{kinds:?}");
    // a measured place is held, one far from all of them is flagged
    bench.write("g.csv", format!("{HEAD}\n45,20,180\n60,60,0\n"));
    let told =
        bench.ok(&["eval", "portable.json", "--geometries", "g.csv", "-o", "out.csv", "--json"]).json();
    assert_eq!(told["nothing_near"], 1, "{told}");
    let out = rows(&bench, "out.csv");
    assert_eq!([0, 1].map(|k| *out[k].last().expect("a flag")), [0.0, 2.0]);
    bench.ok(&["eval", "paint.json", "--geometries", "g.csv", "-o", "truth.csv"]);
    let truth = rows(&bench, "truth.csv");
    // columns: geometry, r,g,b, their uncertainty, flag
    for (o, t) in out.iter().zip(&truth) {
        assert!(o[7] > 0.0 && (o[4] - t[4]).abs() < 3.0 * o[7], "{o:?} {t:?}");
    }
    assert!(out[0][7] / out[0][4] < out[1][7] / out[1][4], "far from every measurement less is known");
}

#[test]
fn the_two_in_plane_geometries_of_an_isoline_are_each_others_exchange() {
    let bench = Bench::new();
    geometries(&bench, "g.csv");
    bench.ok(&["isoline", "--geometries", "g.csv", "-o", "one.csv"]);
    bench.ok(&["isoline", "--geometries", "g.csv", "-o", "other.csv", "--exchanged"]);
    let (one, other) = (rows(&bench, "one.csv"), rows(&bench, "other.csv"));
    for (a, b) in one.iter().zip(&other) {
        assert_eq!((a[5], a[6], a[7]), (b[6], b[5], b[7]));
    }
    // both give the same colour
    bench.write("paint.json", EFFECT);
    let pick = |rows: &[Vec<f64>]| {
        let mut text = format!("{HEAD}\n");
        for r in rows {
            let _ = writeln!(text, "{},{},{}", r[5], r[6], r[7]);
        }
        text
    };
    for (name, rows) in [("e1.csv", &one), ("e2.csv", &other)] {
        bench.write(name, pick(rows));
        bench.ok(&["eval", "paint.json", "--geometries", name, "-o", &format!("f-{name}")]);
    }
    for (a, b) in rows(&bench, "f-e1.csv").iter().zip(rows(&bench, "f-e2.csv")) {
        assert!((a[4] - b[4]).abs() <= 1e-9 * a[4].abs(), "{a:?} {b:?}");
    }
}

#[test]
fn what_cannot_be_known_is_said_and_never_made_up() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    bench.write("bare.json", BARE);
    geometries(&bench, "g.csv");

    // an index forced upon a sample without a coat
    let forced = [
        "eval",
        "bare.json",
        "--as",
        "clip",
        "--index",
        "1.5",
        "--geometries",
        "g.csv",
        "-o",
        "forced.csv",
        "--json",
    ];
    let told = bench.ok(&forced);
    assert_eq!(told.json()["findings"][0]["kind"], "uncoated");
    assert!(told.stderr.contains("--index 1"), "{}", told.stderr);
    let free = ["eval", "bare.json", "--as", "clip", "--geometries", "g.csv", "-o", "free.csv", "--json"];
    assert_eq!(
        bench.ok(&free).json()["findings"],
        serde_json::json!([]),
        "by default the model's own word counts"
    );
    bench.write("matte.json", r#"{"model":"lambert","diffuse":[0.4,0.3,0.2]}"#);
    bench.ok(&["convert", "matte.json", "matte.nc"]);
    let told = bench.ok(&["colormap", "matte.nc", "-o", "matte.png", "--json"]).json();
    assert_eq!(told["findings"][0]["kind"], "uncoated");
    assert_eq!(told["gloss"]["done"], "not-seen");

    // nothing measured where it is asked for
    let low: Vec<(f64, f64, f64)> = (0..36)
        .map(|k| {
            (
                10.0 * f64::from(k % 3),
                10.0 + 5.0 * f64::from(k / 9),
                60.0 * f64::from(k / 3 % 3) + f64::from(k % 3),
            )
        })
        .collect();
    measured(&bench, &low, "low.csv");
    bench.write("far.csv", format!("{HEAD}\n70,70,90\n"));
    let told = bench
        .ok(&[
            "eval",
            "low.csv",
            "--as",
            "flake-map:0",
            "--geometries",
            "far.csv",
            "-o",
            "far.out.csv",
            "--json",
        ])
        .json();
    assert_eq!(told["nothing_near"], 1);
    refused(
        &bench,
        &["eval", "low.csv", "--geometries", "far.csv", "-o", "x.csv"],
        &["scattered", "flake-map:K"],
    );
    refused(
        &bench,
        &["eval", "low.csv", "--as", "table", "--geometries", "far.csv", "-o", "x.csv"],
        &["scattered"],
    );
    refused(&bench, &["trade", "low.csv", "--geometries", "far.csv"], &["their own geometries"]);

    // all in the plane of incidence, and none of it
    measured(&bench, &multi_angle(), "plane.csv");
    refused(
        &bench,
        &["fit", "plane.csv", "--model", "flake-map:1", "-o", "x.json"],
        &["plane of incidence", "flake-map:0"],
    );
    let aside: Vec<(f64, f64, f64)> = (0..40).map(|k| (20.0 + f64::from(k), 30.0, 90.0)).collect();
    measured(&bench, &aside, "aside.csv");
    refused(&bench, &["colormap", "aside.csv", "-o", "x.png"], &["in-plane"]);
    let near: Vec<(f64, f64, f64)> =
        (0..9).map(|k| (10.0 + 5.0 * f64::from(k), 12.0 + 5.0 * f64::from(k), 180.0)).collect();
    measured(&bench, &near, "near.csv");
    refused(
        &bench,
        &["fit", "near.csv", "--model", "flake-map:0", "-o", "x.json"],
        &["0 measured geometries", "mirror direction"],
    );
    for name in ["x.csv", "x.json", "x.png"] {
        assert!(!bench.path(name).exists(), "{name} was made up");
    }
}

#[test]
fn words_and_numbers_that_do_not_fit_are_answered() {
    let bench = Bench::new();
    bench.write("paint.json", EFFECT);
    geometries(&bench, "g.csv");
    let eval = |flags: &[&str]| -> Vec<String> {
        ["eval", "paint.json", "--geometries", "g.csv", "-o", "x.csv"]
            .iter()
            .chain(flags)
            .map(|s| (*s).to_owned())
            .collect()
    };
    for (flags, said) in [
        (&["--as", "photo"][..], &["photo", "flake-map:K"][..]),
        (&["--as", "flake-map:9"][..], &["flake-map:9", "0 to 3"][..]),
        (&["--as", "clip", "--index", "0.5"][..], &["--index 0.5", "1 (none) to 4"][..]),
        (&["--as", "clip", "--largest-deg", "0"][..], &["--largest-deg 0", "at most 90"][..]),
        (&["--as", "clip", "--nodes", "1"][..], &["--nodes 1", "4 to 1024"][..]),
    ] {
        let words = eval(flags);
        refused(&bench, &words.iter().map(String::as_str).collect::<Vec<_>>(), said);
    }
    refused(&bench, &["colormap", "paint.json", "-o", "map.tiff"], &[".png", ".exr", "--model flake-map:K"]);
    refused(
        &bench,
        &["colormap", "paint.json", "--method", "walk", "-o", "map.png"],
        &["walk", "unit-index"],
    );
    refused(&bench, &["colormap", "paint.json", "--flake=7", "-o", "map.png"], &["flake-map:7"]);
    refused(&bench, &["trade", "paint.json", "--only", "clip,teapot"], &["teapot", "map-vector"]);
    refused(&bench, &["fit", "paint.json", "--model", "flake-map", "-o", "x.json"], &["flake-map:K"]);
    refused(&bench, &["fit", "paint.json", "--model", "flake-map:1", "--weights", "sopp"], &["--weights"]);
    bench.ok(&["convert", "paint.json", "t.nc"]);
    refused(&bench, &["colormap", "t.nc", "--gloss", "fresnel", "-o", "x.png"], &["lamp", "angular radius"]);
    bench.write("broken.json", r#"{"format":"gonio-flake-map","version":9}"#);
    refused(&bench, &["info", "broken.json"], &["broken.json", "flake map"]);
    bench.write("weights.csv", format!("{HEAD},weight\n10,10,0,-1\n"));
    refused(
        &bench,
        &["trade", "paint.json", "--geometries", "weights.csv"],
        &["weights.csv", "line 2", "weight"],
    );
}
