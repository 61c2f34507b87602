//! Car paints mixed on the command line: from recorded flakes to a strip of pictures, and what does not mix.

use crate::command::Bench;

const SILVER: &str = "format = \"gonio-flake-paint\"\nversion = 1\nname = \"silver\"\nseed = 11\ncoat_index = 1.5\ndiffuse = [0.03, 0.04, 0.06]\n\
    tile_mm = 4.0\ntexel_mm = 0.02\n[[flakes]]\ndensity_per_mm2 = 500.0\nsize_mm = 0.03\nspread_deg = 8.0\ndepth_mm = [0.002, 0.03]\nreflectance = [0.85, 0.86, 0.88]\n";
const COPPER: &str = "format = \"gonio-flake-paint\"\nversion = 1\nname = \"copper\"\nseed = 12\ncoat_index = 1.5\ndiffuse = [0.09, 0.03, 0.02]\n\
    tile_mm = 4.0\ntexel_mm = 0.02\n[[flakes]]\ndensity_per_mm2 = 200.0\nsize_mm = 0.04\nspread_deg = 12.0\ndepth_mm = [0.002, 0.03]\nreflectance = [0.9, 0.5, 0.3]\n";
const SCENE: &str = "format = \"gonio-scene\"\nversion = 1\nname = \"ball\"\nsize = [32, 32]\nsamples = 2\nobject = { shape = \"sphere\" }\n\
    camera = { from = [0, 0, 4], field_of_view_deg = 32 }\n[[light]]\nkind = \"directional\"\ntowards = [0.5, 0.5, 1.0]\nirradiance = [1, 1, 1]\n";
const PUBLISHED: &str = "# made up\nname,kd_r,kd_g,kd_b,ks1_r,ks1_g,ks1_b,ks2_r,ks2_g,ks2_b,ks3_r,ks3_g,ks3_b,R1,R2,R3,M1,M2,M3\n\
    night,0.01,0.02,0.1,0.004,0.005,0.006,0.02,0.02,0.03,0.005,0.006,0.007,0.9,0.2,0.2,0.3,0.15,0.05\n\
    rust,0.12,0.04,0.02,0.004,0.004,0.004,0.03,0.02,0.01,0.006,0.005,0.004,0.9,0.2,0.2,0.35,0.15,0.06\n";

#[test]
fn recorded_flakes_are_mixed_shown_and_told_of() {
    let bench = Bench::new();
    for (name, text) in [("silver", SILVER), ("copper", COPPER)] {
        bench.write(&format!("{name}.toml"), text);
        let (truth, session) = (format!("{name}.toml"), format!("{name}.mcap"));
        bench.ok(&["scan", "--texture", "--instrument", "tiny", "--truth", &truth, "-o", &session]);
    }
    let told = bench.ok(&["paint", "info", "silver.textures", "--json"]).json();
    assert!(told["statistics"]["raw_bytes"].as_u64() > told["statistics"]["bytes"].as_u64(), "{told}");
    let mix = |weights: &str, output: &str| {
        let weights = format!("--weights={weights}");
        bench
            .ok(&["paint", "mix", "silver.textures", "copper.textures", &weights, "-o", output, "--json"])
            .json()
    };
    let half = mix("0.5,0.5", "half.paint");
    assert!(half["mixable"]["paths"].as_u64() > half["mixable"]["slices"].as_u64(), "{half}");
    assert_eq!(half["paint"]["flakes"]["kind"], "statistics");
    // a whole weight gives the paint itself, textures and all
    assert_eq!(mix("1,0", "whole.paint")["paint"]["flakes"]["kind"], "slices");
    let odd = mix("0.5,0.7", "odd.paint");
    assert!(odd["notes"][0].as_str().expect("a note").contains("sum to 1.2"), "{odd}");
    let beyond = mix("1.25,-0.25", "beyond.paint");
    assert!(beyond["notes"][0].as_str().expect("a note").contains("extrapolated"), "{beyond}");
    let again = bench.ok(&["paint", "info", "half.paint", "--json"]).json();
    assert_eq!(again["paint"]["notes"]["mixed"]["weights"], serde_json::json!([0.5, 0.5]));
    let words = [
        "paint",
        "sweep",
        "silver.textures",
        "copper.textures",
        "--step",
        "0.5",
        "--side",
        "40",
        "--samples",
        "2",
    ];
    let strip = bench.ok(&[&words[..], &["-o", "strip.png", "--json"]].concat()).json();
    // the mean radiance of a mixture may lie outside of both: the mean of Lab is kept, and radiance goes with its cube
    let pictures = strip["pictures"].as_array().expect("a list");
    let weights: Vec<f64> = pictures.iter().map(|p| p["weight"].as_f64().expect("a number")).collect();
    assert_eq!(weights, [0.0, 0.5, 1.0]);
    // silver has no hue, copper has: b* grows from picture to picture
    let yellow = |k: usize| pictures[k]["mean_lab"][2].as_f64().expect("a number");
    assert!(yellow(0) < yellow(1) && yellow(1) < yellow(2), "{strip}");
    assert!(bench.read("strip.png").starts_with(b"\x89PNG"));
    // the mixture is rendered with its flakes like any paint
    bench.write("scene.toml", SCENE);
    let render = |mm: &str, output: &str| {
        bench.ok(&["render", "half.paint", "--scene", "scene.toml", "--mm-per-unit", mm, "-o", output]);
        bench.read(output)
    };
    assert_ne!(render("10", "flakes.exr"), render("0", "mean.exr"));
}

#[test]
fn a_mixture_is_designed_for_a_target_and_what_does_not_mix_is_refused() {
    let bench = Bench::new();
    bench.write("p.csv", PUBLISHED);
    let paints = ["p.csv#night", "p.csv#rust"];
    bench.ok(&["paint", "mix", paints[0], paints[1], "--weights", "0.3,0.7", "-o", "wanted.paint"]);
    let found = bench
        .ok(&[
            "paint",
            "design",
            paints[0],
            paints[1],
            "--target",
            "wanted.paint",
            "-o",
            "found.paint",
            "--json",
        ])
        .json();
    assert!(found["mean_delta_e"].as_f64().expect("a number") < 0.05, "{found}");
    assert!((found["weights"][1].as_f64().expect("a number") - 0.7).abs() < 0.01, "{found}");
    assert_eq!(found["angles"].as_array().map(Vec::len), Some(6));
    bench.write("lab.csv", "theta_i_deg,theta_o_deg,phi_deg,l,a,b\n45,30,180,40,10,-5\n45,0,0,20,5,-3\n");
    bench.ok(&["paint", "design", paints[0], paints[1], "--lab", "lab.csv", "--sparkle", "held"]);
    let refused = |words: &[&str], word: &str| {
        let ran = bench.run(words);
        assert!(ran.code == 2 && ran.stderr.contains(word), "{words:?}: {} {}", ran.code, ran.stderr);
    };
    bench.write("bad.csv", "theta_i_deg,theta_o_deg,phi_deg,l,a,b\n45,30,180,forty,10,-5\n");
    refused(&["paint", "design", paints[0], paints[1], "--lab", "bad.csv"], "row 1");
    refused(
        &["paint", "mix", paints[0], paints[1], "--weights", "1", "-o", "x.paint"],
        "1 weights given for 2",
    );
    refused(&["paint", "mix", paints[0], paints[1], "--weights", "NaN,1", "-o", "x.paint"], "weight 0");
    refused(
        &["paint", "mix", paints[0], paints[1], "--weights", "0,1", "-o", "wanted.paint"],
        "not overwritten",
    );
    refused(&["paint", "mix", "lab.csv", paints[1], "--weights", "0,1", "-o", "x.paint"], "no car paint");
    refused(
        &["paint", "sweep", paints[0], paints[1], "--step", "0.3", "-o", "s.png"],
        "whole number of steps",
    );
    // other angles: refused with both samplings
    bench.write("s.toml", SILVER);
    bench.ok(&["scan", "--texture", "--instrument", "tiny", "--truth", "s.toml", "-o", "S.mcap"]);
    let index = String::from_utf8(bench.read("S.textures/slices.toml")).expect("text");
    std::fs::create_dir(bench.path("other")).expect("a folder");
    for entry in std::fs::read_dir(bench.path("S.textures")).expect("a folder") {
        let entry = entry.expect("an entry");
        std::fs::copy(entry.path(), bench.path("other").join(entry.file_name())).expect("copied");
    }
    let last = index.lines().rev().find_map(|l| l.strip_prefix("half_deg = ")).expect("an angle").to_owned();
    let moved: f64 = last.parse::<f64>().expect("a number") + 0.4;
    bench.write(
        "other/slices.toml",
        index.replace(&format!("half_deg = {last}\n"), &format!("half_deg = {moved}\n")),
    );
    refused(&["paint", "mix", "S.textures", "other", "--weights", "0.5,0.5", "-o", "x.paint"], "same angles");
    // a coat on one only
    bench.write("m.json", r#"{"model":"cook-torrance","diffuse":[0.1,0.1,0.1],"lobes":[]}"#);
    if bench.run(&["convert", "m.json", "bare.paint"]).code == 0 {
        refused(
            &["paint", "mix", "S.textures", "bare.paint", "--weights", "0.5,0.5", "-o", "x.paint"],
            "clear coat",
        );
    }
}
