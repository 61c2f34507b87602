//! Exported materials in the hands of the renderers they are for: Mitsuba gives the values that the loss was computed from, MaterialX finds
//! its document valid and makes a shader of it.

use std::path::{Path, PathBuf};
use std::process::Command;

use gonio_brdf::export::{Export, Renderer, export};
use gonio_brdf::{Brdf, Grid, ModelFile};
use gonio_optics::Vec3;
use gonio_optics::colour::{ciede2000, lab_from_brdf};

/// Models that map to Mitsuba, with those it follows exactly.
const MODELS: [(&str, bool); 8] = [
    (r#"{"model":"lambert","diffuse":[0.4,0.3,0.2]}"#, true),
    (r#"{"model":"lambert","diffuse":[0.4,0.3,0.2],"coat":{"index":1.5}}"#, true),
    (
        r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.1,0.2,0.3],"specular":[0.05,0.04,0.02],"exponent":120}"#,
        false,
    ),
    (
        r#"{"model":"lambert-ashikhmin-shirley","diffuse":[0.1,0.2,0.3],"specular":[0.4,0.4,0.3],"exponent":20,"r0":0.2}"#,
        false,
    ),
    (r#"{"model":"ward-duer","diffuse":[0.1,0.1,0.1],"specular":[0.3,0.2,0.1],"alpha":0.2}"#, false),
    (
        r#"{"model":"ggx","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.9,0.8,0.7],"alpha":0.2,"r0":0.05}]}"#,
        false,
    ),
    (r#"{"model":"ggx","diffuse":[0,0,0],"lobes":[{"specular":[0.9,0.8,0.7],"alpha":0.5,"r0":1}]}"#, false),
    (
        r#"{"model":"cook-torrance","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.2,0.2,0.1],"alpha":0.1,"r0":0.1},{"specular":[0.1,0.1,0.2],"alpha":0.3,"r0":0.3},{"specular":[0.1,0,0],"alpha":0.5,"r0":0.7}]}"#,
        false,
    ),
];

/// Nodes of Sopp's grid up to 75°, some of each distance from the mirror direction.
fn directions() -> Vec<(Vec3, Vec3)> {
    let grid = Grid::sopp();
    let mut out = Vec::new();
    for place in (0..grid.len()).step_by(61) {
        let [ti, to, phi] = grid.coordinates(place);
        let g = grid.geometry(ti, to, phi);
        if g.theta_i.degrees() <= 75.0 && g.theta_o.degrees() <= 75.0 {
            out.push(g.directions());
        }
    }
    for theta in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0] {
        out.push(gonio_optics::Geometry::from_degrees(theta, theta, 180.0).directions());
    }
    out
}

/// Writes the exports of all models that map, and the job for the script.
fn job(folder: &Path, pairs: &[(Vec3, Vec3)]) -> (PathBuf, Vec<(ModelFile, Export, bool)>, usize) {
    let (mut mitsuba, mut documents, mut kept) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (text, exact)) in MODELS.iter().enumerate() {
        let file = ModelFile::from_json(text).unwrap();
        let e = export(&file, Renderer::Mitsuba, &format!("material {i}")).unwrap();
        let path = folder.join(format!("{i}.xml"));
        std::fs::write(&path, &e.text).unwrap();
        mitsuba.push(path);
        if let Ok(e) = export(&file, Renderer::MaterialX, &format!("material {i}")) {
            let path = folder.join(format!("{i}.mtlx"));
            std::fs::write(&path, e.text).unwrap();
            documents.push(path);
        }
        kept.push((file, e, *exact));
    }
    let rows: Vec<[f64; 6]> = pairs.iter().map(|(l, v)| [l.x, l.y, l.z, v.x, v.y, v.z]).collect();
    let job = folder.join("job.json");
    let text =
        serde_json::json!({ "directions": rows, "mitsuba": mitsuba, "materialx": documents }).to_string();
    std::fs::write(&job, text).unwrap();
    (job, kept, documents.len())
}

fn run(job: &Path) -> Option<serde_json::Value> {
    let interpreter = std::env::var_os("GONIO_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/renderers.py");
    let output = Command::new(interpreter).arg(script).arg(job).output().ok()?;
    if output.status.code() == Some(77) {
        return None;
    }
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).expect("one JSON object"))
}

#[test]
fn mitsuba_gives_the_values_we_say_and_materialx_makes_a_shader() {
    let folder = tempfile::tempdir().unwrap();
    let pairs = directions();
    let (job, kept, documents) = job(folder.path(), &pairs);
    let Some(found) = run(&job) else {
        gonio_tests::say(
            "Mitsuba did not run: set GONIO_PYTHON to an interpreter that has mitsuba and MaterialX",
        );
        return;
    };
    gonio_tests::say("Mitsuba ran");
    for (i, (file, e, exact)) in kept.iter().enumerate() {
        let values: Vec<[f64; 3]> = serde_json::from_value(found["mitsuba"][i].clone()).unwrap();
        assert_eq!(values.len(), pairs.len());
        let mut worst_delta = 0.0f64;
        for ((l, v), theirs) in pairs.iter().zip(values) {
            let said = e.rendered.eval(*l, *v);
            let ours = file.eval(*l, *v);
            for c in 0..3 {
                // single precision, in the half vector and in the exponential
                assert!(
                    (theirs[c] - said[c]).abs() <= 3e-4 * said[c] + 1e-6,
                    "{}: {theirs:?} in Mitsuba, {said:?} said, at {l:?} {v:?}",
                    file.model.name()
                );
                if *exact {
                    assert!((theirs[c] / ours[c] - 1.0).abs() < 1e-5, "{theirs:?} {ours:?}");
                }
            }
            worst_delta = worst_delta.max(ciede2000(lab_from_brdf(ours), lab_from_brdf(theirs)));
        }
        let told = e.loss.within_15_deg.max.max(e.loss.beyond_15_deg.max);
        assert!(worst_delta <= told + 0.02, "{}: {worst_delta} told {told}", file.model.name());
    }
    let read = found["materialx"].as_array().unwrap();
    assert!(read.len() == documents && documents >= 6);
    for d in read {
        assert!(d["valid"] == true && d["shader_characters"].as_u64().unwrap() > 10_000, "{d}");
        assert_eq!(d["inputs"]["unknown"], serde_json::json!([]), "{d}");
    }
}
