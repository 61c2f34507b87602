//! Scenes from the command line: pictures, choice and plan, what is said about bad input; and the same scene in Mitsuba, pixel for pixel.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use gonio_brdf::export::{Renderer, export};
use gonio_brdf::{Brdf, ModelFile};
use gonio_render::Scene;
use gonio_render::scene::SceneFile;
use gonio_render::trace::{Paint, RenderOptions, render};
use serde_json::{Value, json};

const PAINT: &str = r#"{"model":"ggx","diffuse":[0.02,0.05,0.16],"lobes":[{"specular":[0.10,0.20,0.45],"alpha":0.24,"r0":0.5}],"coat":{"index":1.5}}"#;

const PRODUCT: &str = r#"
format = "gonio-scene"
version = 1
name = "product"
size = [64, 48]
samples = 4
camera = { from = [0.6, 1.2, 6], field_of_view_deg = 24 }
object = { shape = "capsule" }
[[light]]
kind = "directional"
towards = [-1, 1.2, 1.5]
half_angle_deg = 3
"#;

fn gonio(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gonio_under_test")).current_dir(folder).args(arguments).output().unwrap()
}

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("paint.json"), PAINT).unwrap();
    std::fs::write(dir.path().join("product.toml"), PRODUCT).unwrap();
    dir
}

fn json_of(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn a_scene_is_rendered_for_the_screen_and_in_linear_light() {
    let dir = folder();
    let told = json_of(&gonio(
        dir.path(),
        &[
            "--json",
            "render",
            "paint.json",
            "--scene",
            "product.toml",
            "-o",
            "p.png",
            "--geometries",
            "g.csv",
        ],
    ));
    assert_eq!(told["coat_index"], 1.5);
    assert_eq!(told["size"], json!([64, 48]));
    let png = std::fs::read(dir.path().join("p.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
    let csv = std::fs::read_to_string(dir.path().join("g.csv")).unwrap();
    assert!(csv.starts_with("theta_i_deg,theta_o_deg,phi_deg,weight\n") && csv.lines().count() > 50);
    json_of(&gonio(
        dir.path(),
        &["--json", "render", "paint.json", "--scene", "product.toml", "-o", "p.exr", "--side", "32"],
    ));
    assert!(std::fs::read(dir.path().join("p.exr")).unwrap().starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    let again = gonio(dir.path(), &["render", "paint.json", "--scene", "product.toml", "-o", "p.png"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("--force"));
    let marked = json_of(&gonio(
        dir.path(),
        &[
            "--json",
            "render",
            "paint.json",
            "--scene",
            "product.toml",
            "-o",
            "m.png",
            "--as",
            "clip",
            "--mark-critical",
            "--no-cosine",
        ],
    ));
    let share = marked["beyond_critical_share"].as_f64().unwrap();
    assert!(share > 0.0 && share < 0.9, "{share}");
}

#[test]
fn the_cheapest_representation_that_keeps_the_bound_is_written_and_used() {
    let dir = folder();
    let told = json_of(&gonio(
        dir.path(),
        &[
            "--json",
            "tailor",
            "paint.json",
            "--scene",
            "product.toml",
            "--max-delta-e",
            "3",
            "--side",
            "48",
            "-o",
            "out",
            "--only",
            "table,aspecular,clip,flake-map:0,flake-map:1",
        ],
    ));
    let candidates = told["candidates"].as_array().unwrap();
    let chosen = told["chosen"].as_str().unwrap();
    let of = |name: &str| candidates.iter().find(|c| c["name"] == name).unwrap();
    assert!(of(chosen)["delta_e"]["mean"].as_f64().unwrap() <= 3.0);
    // nothing cheaper keeps the bound
    for c in candidates {
        if c["ns"].as_f64().unwrap() < of(chosen)["ns"].as_f64().unwrap() {
            assert_eq!(c["keeps"], false, "{c}");
        }
    }
    let files: Vec<PathBuf> =
        told["files"].as_array().unwrap().iter().map(|f| dir.path().join(f.as_str().unwrap())).collect();
    assert!(files.iter().all(|f| f.is_file()), "{files:?}");
    for name in ["pareto.png", "difference.png", "geometries.png", "report.html", "tailor.json"] {
        assert!(dir.path().join("out").join(name).is_file(), "{name}");
    }
    // what no representation keeps: said, with the nearest, and exit 1
    let none = gonio(
        dir.path(),
        &[
            "tailor",
            "paint.json",
            "--scene",
            "product.toml",
            "--max-delta-e",
            "0.0001",
            "--side",
            "32",
            "--only",
            "aspecular,clip",
        ],
    );
    assert_eq!(none.status.code(), Some(1));
    let said = String::from_utf8_lossy(&none.stderr).into_owned();
    assert!(
        said.contains("no representation keeps")
            && said.contains("nearest")
            && said.contains("--max-delta-e"),
        "{said}"
    );
}

#[test]
fn the_trade_is_judged_over_the_geometries_of_a_scene() {
    let dir = folder();
    let told = json_of(&gonio(
        dir.path(),
        &["--json", "trade", "paint.json", "--scene", "product.toml", "--only", "table,clip,flake-map:0"],
    ));
    assert!(told["judged"].as_str().unwrap().contains("product"), "{}", told["judged"]);
    assert_eq!(told["candidates"].as_array().unwrap().len(), 3);
    let both =
        gonio(dir.path(), &["trade", "paint.json", "--scene", "product.toml", "--geometries", "g.csv"]);
    assert_eq!(both.status.code(), Some(2));
}

#[test]
fn a_plan_for_a_scene_is_smaller_and_runs() {
    let dir = folder();
    let told = json_of(&gonio(
        dir.path(),
        &[
            "--json",
            "plan",
            "--scene",
            "product.toml",
            "--instrument",
            "tiny",
            "--like",
            "paint.json",
            "--side",
            "32",
            "-o",
            "plan.toml",
        ],
    ));
    let (few, all) = (told["poses"].as_u64().unwrap(), told["full_poses"].as_u64().unwrap());
    assert!(few >= 1 && few <= all, "{told}");
    assert!(told["expected_delta_e"].as_f64().unwrap() <= told["bound"].as_f64().unwrap());
    let scan = gonio(
        dir.path(),
        &[
            "--json",
            "scan",
            "--device",
            "sim",
            "--instrument",
            "tiny",
            "--truth",
            "paint.json",
            "--plan",
            "plan.toml",
            "-o",
            "S.mcap",
        ],
    );
    assert_eq!(json_of(&scan)["poses_done"], few);
}

#[test]
fn an_adaptive_scan_ends_when_the_scene_has_enough() {
    let dir = folder();
    let scan = |bound: &str, name: &str, more: &[&str]| {
        let words = [
            "--json",
            "scan",
            "--device",
            "sim",
            "--instrument",
            "tiny",
            "--truth",
            "paint.json",
            "--fit=lambert",
            "--scene",
            "product.toml",
            "--max-delta-e",
            bound,
            "-o",
            name,
        ];
        json_of(&gonio(dir.path(), &[&words[..], more].concat()))
    };
    let loose = scan("60", "loose.mcap", &[]);
    let (done, total) = (loose["poses_done"].as_u64().unwrap(), loose["poses_total"].as_u64().unwrap());
    assert!((2..total).contains(&done), "{done} of {total}");
    // a bound that nothing keeps asks for every pose
    let strict = scan("0.000001", "strict.mcap", &[]);
    assert_eq!(strict["poses_done"].as_u64().unwrap(), total);
    // what was measured is whole, and gives the same table again
    let verified = gonio(dir.path(), &["verify", "loose.mcap"]);
    assert!(verified.status.success());
    assert!(gonio(dir.path(), &["replay", "loose.mcap", "-o", "again.nc"]).status.success());
    let read = |name: &str| std::fs::read(dir.path().join(name)).expect("written");
    assert!(read("again.nc") == read("loose.nc"), "a replay gives another table");
    // continued with the same bound there is nothing to do
    let same = scan("60", "loose.mcap", &["--resume", "--force"]);
    assert_eq!(same["poses_done"].as_u64().unwrap(), done);
    // the table tells the next pose as well
    let next = json_of(&gonio(
        dir.path(),
        &[
            "--json",
            "plan",
            "--scene",
            "product.toml",
            "--instrument",
            "tiny",
            "--after",
            "loose.nc",
            "--max-delta-e",
            "0.000001",
            "-o",
            "next.toml",
        ],
    ));
    assert!(next["tilt_deg"].is_number() && dir.path().join("next.toml").is_file(), "{next}");
    // with a stricter bound it goes on where it was
    let further = scan("0.000001", "loose.mcap", &["--resume", "--force"]);
    assert_eq!(further["poses_done"].as_u64().unwrap(), total);
}

#[test]
fn scenes_that_cannot_be_used_say_what_would_help() {
    let dir = folder();
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).unwrap();
    write("away.toml", PRODUCT.replace("from = [0.6, 1.2, 6]", "from = [0.6, 1.2, 6], to = [0, 0, 20]"));
    write("dark.toml", PRODUCT.replace("[-1, 1.2, 1.5]", "[-0.6, -1.2, -6]"));
    write("broken.toml", PRODUCT.replace("shape = \"capsule\"", "mesh = \"broken.obj\""));
    write("broken.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 8\n".to_owned());
    write("bare.toml", PRODUCT.replace("shape = \"capsule\"", "mesh = \"bare.obj\""));
    write("bare.obj", "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n".to_owned());
    // lit and seen from the rim alone
    write(
        "rim.toml",
        PRODUCT
            .replace(
                "from = [0.6, 1.2, 6], field_of_view_deg = 24",
                "from = [0, 0.35, 6], field_of_view_deg = 24",
            )
            .replace("shape = \"capsule\"", "mesh = \"floor.obj\"")
            .replace("[-1, 1.2, 1.5]", "[0, 0.05, -1]"),
    );
    write(
        "floor.obj",
        "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nvn 0 1 0\nf 4//1 3//1 2//1 1//1\n".to_owned(),
    );
    let said = |arguments: &[&str]| {
        let out = gonio(dir.path(), arguments);
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let rendered = |scene: &str| said(&["render", "paint.json", "--scene", scene, "-o", "x.png", "--force"]);
    let (code, text) = rendered("away.toml");
    assert!(code == Some(2) && text.contains("nothing is visible") && text.contains("camera.to"), "{text}");
    let (code, text) = said(&["tailor", "paint.json", "--scene", "dark.toml"]);
    assert!(code == Some(2) && text.contains("no light reaches"), "{text}");
    let (code, text) = rendered("broken.toml");
    assert!(code == Some(2) && text.contains("broken"), "{text}");
    let (code, text) = rendered("bare.toml");
    assert!(code == Some(0) && text.contains("no normal"), "{text}");
    let (code, text) = rendered("absent.toml");
    assert!(code == Some(2) && text.contains("absent.toml"), "{text}");
    let (code, text) = said(&["plan", "--scene", "rim.toml", "--instrument", "tiny", "-o", "x.toml"]);
    assert!(code == Some(2) && text.contains("beyond") && text.contains("tilts"), "{text}");
}

/// A sphere of a material that both have, light from one direction, with and without a surrounding.
#[test]
fn a_ball_is_the_same_in_mitsuba_pixel_for_pixel() {
    let dir = tempfile::tempdir().unwrap();
    let models = [
        r#"{"model":"lambert","diffuse":[0.4,0.3,0.2]}"#,
        r#"{"model":"ward-duer","diffuse":[0.1,0.1,0.1],"specular":[0.3,0.2,0.1],"alpha":0.2}"#,
    ];
    for (model, surrounding) in [(models[0], 0.0), (models[0], 0.5), (models[1], 0.0)] {
        let file = ModelFile::from_json(model).unwrap();
        let exported = export(&file, Renderer::Mitsuba, "ball").unwrap();
        let path = dir.path().join("ball.xml");
        std::fs::write(&path, &exported.text).unwrap();
        let (size, samples) = ([40u32, 30], 256u32);
        let around = if surrounding > 0.0 {
            format!(
                "[[light]]\nkind = \"environment\"\nsky = \"uniform\"\nradiance = [{surrounding}, {surrounding}, {surrounding}]\n"
            )
        } else {
            String::new()
        };
        let text = format!(
            "format = \"gonio-scene\"\nversion = 1\nsize = [{}, {}]\nsamples = {samples}\ncamera = {{ from = [1.2, 1, 6], field_of_view_deg = 24 }}\nobject = {{ shape = \"sphere\" }}\n\
             [[light]]\nkind = \"directional\"\ntowards = [-0.8, 0.33, 0.5]\n{around}",
            size[0], size[1]
        );
        let scene = Scene::build(&SceneFile::from_toml(&text, "ball").unwrap(), dir.path()).unwrap();
        let said = &exported.rendered;
        let image =
            render(&scene, &scene.views[0], Paint { brdf: said, gloss: None }, RenderOptions::default())
                .unwrap();
        let job = json!({
            "bsdf": path, "size": size, "samples": samples, "from": [1.2, 1.0, 6.0], "field_of_view_deg": 24.0,
            "towards": [-0.8, 0.33, 0.5], "surrounding": surrounding, "variant": "scalar_rgb", "timed": 0,
        });
        let Some(found) = mitsuba(dir.path(), &job) else {
            gonio_tests::say("Mitsuba did not render: set GONIO_PYTHON to an interpreter that has mitsuba");
            return;
        };
        gonio_tests::say("Mitsuba rendered");
        let theirs: Vec<[f64; 4]> = serde_json::from_value(found["pixels"].clone()).unwrap();
        let (mut sum, mut count) = (0.0, 0);
        for (i, their) in theirs.iter().enumerate() {
            let cover = f64::from(image.coverage[i]);
            assert!((cover - their[3]).abs() < 0.12, "{i}: covered {cover}, {}", their[3]);
            if cover < 1.0 {
                continue;
            }
            for (c, (ours, b)) in image.values[i].into_iter().zip(*their).enumerate() {
                let a = f64::from(ours);
                // both draw 256 places in the pixel: what is left is their spread over a pixel, largest at the shadow's edge
                assert!(
                    (a - b).abs() < 0.05 * b + 0.006,
                    "{} pixel {i} channel {c}: {a}, Mitsuba {b}",
                    file.model.name()
                );
                sum += a - b;
                count += 1;
            }
        }
        let mean = sum / f64::from(count);
        assert!(count > 500 && mean.abs() < 4e-4, "{}: mean {mean} over {count}", file.model.name());
        let bright = image.values.iter().map(|v| v[0]).fold(0.0, f32::max);
        assert!(bright > 0.05 && said.eval(gonio_optics::Vec3::Z, gonio_optics::Vec3::Z)[0] > 0.0);
    }
}

fn mitsuba(folder: &Path, job: &Value) -> Option<Value> {
    let path = folder.join("job.json");
    std::fs::write(&path, job.to_string()).unwrap();
    let interpreter = std::env::var_os("GONIO_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/mitsuba_scene.py");
    let output = Command::new(interpreter).arg(script).arg(path).output().ok()?;
    if output.status.code() == Some(77) {
        return None;
    }
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).expect("one JSON object"))
}
