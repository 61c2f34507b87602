//! Samples per second on a ball, one and two threads, against Mitsuba 3 on the same scene and material.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use gonio_brdf::ModelFile;
use gonio_brdf::export::{Renderer, export};
use gonio_render::Scene;
use gonio_render::scene::SceneFile;
use gonio_render::trace::{Paint, RenderOptions, render};
use serde_json::{Value, json};

use crate::Figure;

const ROUNDS: usize = 5;
const SIZE: [u32; 2] = [320, 240];
const SAMPLES: u32 = 32;

pub fn figures() -> Vec<Figure> {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let file = ModelFile::from_json(
        r#"{"model":"ward-duer","diffuse":[0.1,0.1,0.1],"specular":[0.3,0.2,0.1],"alpha":0.2}"#,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let exported = export(&file, Renderer::Mitsuba, "ball").unwrap_or_else(|e| panic!("{e}"));
    let material = folder.path().join("ball.xml");
    std::fs::write(&material, &exported.text).unwrap_or_else(|e| panic!("{e}"));
    let text = format!(
        "format = \"gonio-scene\"\nversion = 1\nsize = [{}, {}]\nsamples = {SAMPLES}\ncamera = {{ from = [1.2, 1, 6], field_of_view_deg = 24 }}\nobject = {{ shape = \"sphere\" }}\n\
         [[light]]\nkind = \"directional\"\ntowards = [-0.8, 0.33, 0.5]\n[[light]]\nkind = \"environment\"\nsky = \"uniform\"\nradiance = [0.2, 0.2, 0.2]\n",
        SIZE[0], SIZE[1]
    );
    let scene = SceneFile::from_toml(&text, "ball")
        .and_then(|f| Scene::build(&f, folder.path()))
        .unwrap_or_else(|e| panic!("{e}"));
    let count = f64::from(SIZE[0] * SIZE[1] * SAMPLES);
    let mut out = Vec::new();
    for threads in [1usize, 2] {
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap_or_else(|e| panic!("{e}"));
        let one = || {
            let begun = Instant::now();
            let _ = pool.install(|| {
                render(&scene, &scene.views[0], Paint { brdf: &file, gloss: None }, RenderOptions::default())
            });
            begun.elapsed().as_secs_f64()
        };
        one();
        let mut ours: Vec<f64> = Vec::new();
        let mut theirs: Vec<(String, f64)> = Vec::new();
        for variant in ["scalar_rgb", "llvm_ad_rgb"] {
            // in turn, so that whatever else the machine does strikes both
            ours.extend((0..ROUNDS).map(|_| one()));
            let job = json!({
                "bsdf": material, "size": SIZE, "samples": SAMPLES, "from": [1.2, 1.0, 6.0], "field_of_view_deg": 24.0,
                "towards": [-0.8, 0.33, 0.5], "surrounding": 0.2, "variant": variant, "timed": ROUNDS, "cores": threads,
            });
            match mitsuba(folder.path(), &job) {
                Ok(seconds) => theirs.push((variant.to_owned(), least(&seconds))),
                Err(why) => eprintln!("{variant} did not run: {why}"),
            }
        }
        ours.extend((0..ROUNDS).map(|_| one()));
        let mine = least(&ours);
        let rate = format!("{:.2} million a second", count / mine / 1e6);
        if theirs.is_empty() {
            out.push(Figure::said(
                format!("camera samples, {threads} thread(s), Mitsuba did not run"),
                rate.clone(),
                "stated",
                None,
                true,
            ));
        }
        for (variant, seconds) in theirs {
            out.push(Figure::said(
                format!("camera samples, {threads} thread(s), against Mitsuba {variant}"),
                format!("{rate}, ratio {:.2}", seconds / mine),
                "stated",
                None,
                true,
            ));
        }
    }
    out
}

fn least(seconds: &[f64]) -> f64 {
    seconds.iter().copied().fold(f64::INFINITY, f64::min)
}

fn mitsuba(folder: &Path, job: &Value) -> Result<Vec<f64>, String> {
    let path = folder.join("job.json");
    std::fs::write(&path, job.to_string()).map_err(|e| e.to_string())?;
    let interpreter = std::env::var_os("GONIO_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/mitsuba_scene.py");
    let output = Command::new(interpreter).arg(script).arg(path).output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{} {}", output.status, said.lines().next().unwrap_or_default()));
    }
    let found: Value = serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())?;
    serde_json::from_value(found["seconds"].clone()).map_err(|e| e.to_string())
}
