//! Fits as people ask for them: many at once, by other methods, chosen by themselves, and written for renderers.

use crate::command::{Bench, PAINT};

/// A table of a paint on a coarse grid, node values.
fn paint(bench: &Bench, name: &str, model: &str) {
    bench.write("truth.json", model);
    let mut geometries = String::from("theta_i_deg,theta_o_deg,phi_deg\n");
    for ti in 0..8 {
        for to in 0..16 {
            for phi in 0..10 {
                geometries += &format!("{},{},{}\n", ti * 10, to * 5, phi * 20);
            }
        }
    }
    bench.write("g.csv", geometries);
    bench.ok(&["eval", "truth.json", "--geometries", "g.csv", "-o", name, "--force"]);
}

#[test]
fn one_bad_file_does_not_stop_the_rest() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("scans")).unwrap();
    paint(&bench, "scans/a.csv", PAINT);
    paint(&bench, "scans/b.csv", &PAINT.replace("60.0", "200.0"));
    let a = String::from_utf8(bench.read("scans/a.csv")).unwrap();
    bench.write("scans/broken.csv", a.replacen("0,0,0,", "0,0,zero,", 1));
    bench.write("scans/model.json", PAINT);
    let ran = bench.run(&[
        "fit",
        "scans",
        "--model",
        "ashikhmin-shirley-simplified",
        "-o",
        "models",
        "--report",
        "all.html",
        "--json",
    ]);
    assert_eq!(ran.code, 3, "{}\n{}", ran.stdout, ran.stderr);
    assert!(ran.stderr.contains("1 of 3") && ran.stderr.contains("broken.csv"), "{}", ran.stderr);
    let json = ran.json();
    assert_eq!((&json["fitted"], &json["failed"]), (&2.into(), &1.into()), "{json}");
    assert!(json["skipped"][0]["input"].as_str().unwrap().ends_with("model.json"));
    let exponent = |k: usize| json["fits"][k]["model"]["exponent"].as_f64().unwrap();
    assert!((exponent(0) - 60.0).abs() < 1e-3 && (exponent(1) - 200.0).abs() < 1e-2, "{json}");
    for name in ["a", "b"] {
        bench.ok(&["info", &format!("models/{name}.model.json")]);
    }
    assert!(!bench.path("models/broken.model.json").exists());
    let html = String::from_utf8(bench.read("all.html")).unwrap();
    assert!(html.contains("2 of 3") && html.contains("broken.csv"), "the report says what failed");
    // all of them bad: failed; the folder alone without a measurement: wrong usage
    let ran = bench.run(&["fit", "scans/broken.csv", "scans/broken.csv", "--force"]);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    std::fs::create_dir(bench.path("empty")).unwrap();
    assert_eq!(bench.run(&["fit", "empty"]).code, 2);
    // models are not overwritten unasked
    let ran = bench.run(&["fit", "scans", "-o", "models"]);
    assert!(ran.code == 2 && ran.stderr.contains("--force"), "{}", ran.stderr);
}

#[test]
fn other_methods_come_to_the_same_on_clean_data_and_say_how() {
    let bench = Bench::new();
    paint(&bench, "a.csv", PAINT);
    let model = "ashikhmin-shirley-simplified";
    let sopp = bench
        .ok(&["fit", "a.csv", "--model", model, "--method", "sopp", "--weights", "none", "--json"])
        .json();
    let stages = sopp["model"]["fit"]["stages"].as_array().unwrap();
    assert!(stages.len() == 4 && stages.iter().all(|s| s["ended"] == "settled"), "{sopp}");
    assert!((sopp["model"]["exponent"].as_f64().unwrap() - 60.0).abs() < 1e-3);
    let anneal = bench.ok(&["fit", "a.csv", "--model", model, "--method", "anneal", "--json"]).json();
    assert!((anneal["model"]["exponent"].as_f64().unwrap() / 60.0 - 1.0).abs() < 0.02, "{anneal}");
    let ran = bench.run(&["fit", "a.csv", "--model", "ggx", "--method", "sopp"]);
    assert!(ran.code == 2 && ran.stderr.contains("ashikhmin-shirley"), "{}", ran.stderr);
    let ran = bench.run(&["fit", "a.csv", "--start", "25"]);
    assert!(ran.code == 2 && ran.stderr.contains("N,CD,CS"), "{}", ran.stderr);
}

#[test]
fn the_simplest_model_within_the_bound_is_chosen_and_the_others_are_shown() {
    let bench = Bench::new();
    paint(&bench, "paint.csv", PAINT);
    let json = bench.ok(&["fit", "paint.csv", "--max-delta-e", "0.5", "--report", "r.html", "--json"]).json();
    assert_eq!(json["model"]["model"], "ashikhmin-shirley-simplified", "{json}");
    let choice = &json["model"]["fit"]["choice"];
    assert_eq!(choice["within_bound"], true);
    let candidates = choice["candidates"].as_array().unwrap();
    let of = |name: &str| candidates.iter().find(|c| c["model"] == name).unwrap();
    assert!(of("lambert")["delta_e"]["all"]["mean"].as_f64().unwrap() > 0.5);
    assert!(of("ward")["parameters"] == 7 && of("ward")["nanoseconds"].as_f64().unwrap() > 0.0);
    assert!(of("ggx:3")["delta_e"].is_null(), "a simpler one will do");
    assert!(String::from_utf8(bench.read("r.html")).unwrap().contains("Choice of the model"));
    // a matt card needs no lobe
    paint(&bench, "card.csv", r#"{"model":"lambert","diffuse":[0.5,0.4,0.3]}"#);
    let json = bench.ok(&["fit", "card.csv", "--json"]).json();
    assert_eq!(json["model"]["model"], "lambert", "{json}");
    assert_eq!(bench.run(&["fit", "card.csv", "--max-delta-e", "0"]).code, 2);
}

#[test]
fn a_fit_is_written_for_renderers_with_what_it_costs() {
    let bench = Bench::new();
    paint(&bench, "a.csv", PAINT);
    let json = bench
        .ok(&[
            "fit",
            "a.csv",
            "--model",
            "ashikhmin-shirley-simplified",
            "-o",
            "m.json",
            "--export",
            "p.xml",
            "--export",
            "p.mtlx",
            "--export",
            "p.gltf",
            "--export",
            "p.csv",
            "--json",
        ])
        .json();
    let exports = json["exports"].as_array().unwrap();
    assert_eq!(exports.len(), 4);
    for e in exports {
        assert!(e["delta_e"]["beyond_15_deg"]["mean"].as_f64().unwrap() < 5.0, "{e}");
        let text = String::from_utf8(bench.read(e["output"].as_str().unwrap())).unwrap();
        assert!(text.contains("CIEDE2000 against the model"), "{text}");
    }
    assert!(
        exports[3]["delta_e"]["within_15_deg"]["max"].as_f64().unwrap() < 1e-3,
        "Sopp's own shader loses nothing"
    );
    let said = bench.ok(&["convert", "m.json", "q.xml"]).stdout;
    assert!(said.contains("Mitsuba 3") && said.contains("beyond 15 degrees"), "{said}");
    // what the ending says, unless a renderer is named
    bench.ok(&["convert", "m.json", "table.csv"]);
    assert!(bench.read("table.csv").starts_with(b"theta_i_deg"));
    bench.ok(&["convert", "m.json", "shader.csv", "--as", "sopp"]);
    assert!(String::from_utf8(bench.read("shader.csv")).unwrap().contains("CsR"));
    // what does not map says what would
    bench.write(
        "phong.json",
        r#"{"model":"phong","diffuse":[0.1,0.1,0.1],"specular":[0.1,0.1,0.1],"exponent":20}"#,
    );
    let ran = bench.run(&["convert", "phong.json", "x.mtlx"]);
    assert!(ran.code == 2 && ran.stderr.contains("fit cook-torrance"), "{}", ran.stderr);
    assert!(!bench.path("x.mtlx").exists());
    let ran = bench.run(&["convert", "a.csv", "x.xml"]);
    assert!(ran.code == 2 && ran.stderr.contains("fit one first"), "{}", ran.stderr);
    assert_eq!(bench.run(&["convert", "m.json", "x.xml", "--as", "teapot"]).code, 2);
}
