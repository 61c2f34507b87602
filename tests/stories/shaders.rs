//! The WGSL look-ups on a Vulkan device (Mesa's lavapipe counts), through wgpu, against the look-ups of the library.

use std::path::Path;
use std::process::Command;

use gonio_brdf::ModelFile;
use gonio_brdf::maps::{ColourMap, FlakeFitOptions, FlakeMap, Region, Sample};
use gonio_optics::isoline::Method;
use gonio_optics::{Angle, Geometry, Vec3};
use serde_json::json;

const PAINT: &str = r#"{"model":"ggx","diffuse":[0.004,0.008,0.03],"lobes":[{"specular":[0.5,0.28,0.06],"alpha":0.2,"r0":0.6}],"coat":{"index":1.5}}"#;
const NODES: usize = 24;
const METHODS: [Method; 4] = [Method::Clip, Method::MapVector, Method::MapVectorParallel, Method::UnitIndex];

/// Node values of a colour map in the order the shader reads them.
fn node_values(map: &ColourMap, largest: Angle) -> Vec<f64> {
    let end = 1.0 - largest.cos();
    let angle = |k: usize| Angle::from_radians((1.0 - end * (k as f64 / (NODES - 1) as f64).powi(2)).acos());
    let mut out = Vec::new();
    for phi in [Angle::STRAIGHT, Angle::ZERO] {
        for x in 0..NODES {
            for y in 0..NODES {
                out.extend(map.in_plane(Geometry { theta_i: angle(x), theta_o: angle(y), phi }));
            }
        }
    }
    out
}

/// Directions up to grazing and below the horizon.
fn pairs() -> Vec<(Vec3, Vec3)> {
    let everywhere = Region { largest: Angle::from_degrees(89.5), from_mirror: Angle::from_degrees(-1.0) };
    let mut out: Vec<(Vec3, Vec3)> = everywhere.directions(2000, 3).collect();
    out.push((Vec3::Z, Vec3::Z));
    out.push((Vec3::new(0.6, 0.0, -0.8), Vec3::Z));
    out
}

#[test]
fn the_shader_look_ups_are_those_of_the_library() {
    let paint = ModelFile::from_json(PAINT).unwrap();
    let samples: Vec<Sample> = Region::default().of_brdf(&paint, 4000, 0);
    let folder = tempfile::tempdir().unwrap();
    let largest = Angle::from_degrees(75.0);
    let maps: Vec<ColourMap> =
        METHODS.iter().map(|m| ColourMap::from_brdf(&paint, 1.5, *m, largest, NODES)).collect();
    let shader = folder.path().join("look_up.wgsl");
    std::fs::write(&shader, gonio_render::shaders::LOOK_UP_WGSL).unwrap();
    let pairs = pairs();
    let rows: Vec<[f64; 6]> = pairs.iter().map(|(l, v)| [l.x, l.y, l.z, v.x, v.y, v.z]).collect();
    for harmonics in [0, 1, 3] {
        let options = FlakeFitOptions { harmonics, nodes: [20, 24], ..FlakeFitOptions::default() };
        let flake = FlakeMap::fit("paint", &samples, &options).unwrap();
        let file = folder.path().join("flake.json");
        std::fs::write(&file, flake.to_json().unwrap()).unwrap();
        let job = json!({
            "shader": shader, "flake": file, "directions": rows,
            "colour": {
                "index": 1.5, "per_end": 1.0 / (1.0 - largest.cos()), "nodes": NODES, "methods": [0, 1, 2, 3],
                "values": node_values(&maps[0], largest),
            },
        });
        let Some(found) = run(folder.path(), &job) else { return };
        gonio_tests::say(&format!("WGSL ran on {} with K = {harmonics}", found["device"]));
        let single = |d: Vec3| d.to_array().map(|x| x as f32);
        compare("flake map", &found["flake"], &pairs, 0, |l, v| flake.eval_single(single(l), single(v)));
        for (k, map) in maps.iter().enumerate() {
            // where a walk crosses the middle of the map the side may turn with the last bit
            let turns =
                if matches!(METHODS[k], Method::MapVector | Method::MapVectorParallel) { 4 } else { 2 };
            let name = METHODS[k].name();
            compare(name, &found["colour"][k], &pairs, turns, |l, v| map.eval_single(single(l), single(v)));
        }
    }
}

fn compare(
    name: &str,
    found: &serde_json::Value,
    pairs: &[(Vec3, Vec3)],
    allowed: usize,
    ours: impl Fn(Vec3, Vec3) -> [f32; 3],
) {
    let values: Vec<[f32; 3]> = serde_json::from_value(found.clone()).unwrap();
    assert_eq!(values.len(), pairs.len());
    let mut off = Vec::new();
    for ((l, v), theirs) in pairs.iter().zip(values) {
        let f = ours(*l, *v);
        // square roots of square roots near the lobe leave some ten units in the last place of a steep table
        if (0..3).any(|c| (theirs[c] - f[c]).abs() > 2e-4 * f[c].abs() + 1e-6) {
            off.push((*l, *v, theirs, f));
        }
    }
    assert!(
        off.len() <= allowed,
        "{name}: {} of {} differ, the first: {:?}",
        off.len(),
        pairs.len(),
        off.first()
    );
}

fn run(folder: &Path, job: &serde_json::Value) -> Option<serde_json::Value> {
    let path = folder.join("job.json");
    std::fs::write(&path, job.to_string()).unwrap();
    let interpreter = std::env::var_os("GONIO_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/shaders.py");
    let output = Command::new(interpreter).arg(script).arg(&path).output().ok()?;
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(77) {
        gonio_tests::say(&format!("WGSL did not run: {}", said.trim()));
        return None;
    }
    assert!(output.status.success(), "{said}");
    Some(serde_json::from_slice(&output.stdout).expect("one JSON object"))
}
