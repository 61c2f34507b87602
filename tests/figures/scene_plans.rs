//! Plans for the product shot, scanned on the virtual instrument: the planned and the adaptive scan against the full one, by the pictures they give.

use std::ffi::OsString;
use std::path::Path;

use gonio_acquisition::{coat::flake_fill, fill};
use gonio_brdf::formats::{self, Loaded};
use gonio_brdf::{Brdf, Coat, Flag, Measured, ModelFile};
use gonio_instrument::{Description, Plan, builtin};
use gonio_optics::Vec3;
use gonio_render::trace::{Gathered, gather};
use gonio_tailor::{
    LikelyMaterial, Material, Options, PlanOptions, body_of, pixel_differences, plan, spread,
};

use crate::Figure;
use crate::scene_choice::scene;

/// A paint that the planner is not told of.
const TRUTH: &str = r#"{"model":"ggx","diffuse":[0.05,0.02,0.02],"lobes":[{"specular":[0.45,0.12,0.08],"alpha":0.27,"r0":0.55}],"coat":{"index":1.5}}"#;
/// What it is told: paints of other colours and widths.
const LIKELY: [&str; 2] = [
    r#"{"model":"ggx","diffuse":[0.10,0.10,0.11],"lobes":[{"specular":[0.55,0.56,0.58],"alpha":0.30,"r0":0.6}],"coat":{"index":1.5}}"#,
    r#"{"model":"ggx","diffuse":[0.02,0.05,0.16],"lobes":[{"specular":[0.10,0.20,0.45],"alpha":0.24,"r0":0.5}],"coat":{"index":1.5}}"#,
];
const SEED: u64 = 1;

fn fill_as_a_scan(m: &mut Measured) {
    let index: Option<f64> = m.attributes.get("coat_index").and_then(|s| s.parse().ok());
    match index {
        Some(index) if flake_fill::fill(m, &Coat { index }, 75.0).is_ok() => {}
        _ => fill::fill(m, 75.0),
    }
}

/// The reference optics and its plan before the small camera: a scan takes a second.
fn instrument() -> Description {
    let read = |name: &str| builtin::description(name).and_then(Result::ok);
    match (read("tiny"), read("reference")) {
        (Some(tiny), Some(reference)) => {
            Description { plan: reference.plan, name: "small camera".to_owned(), ..tiny }
        }
        _ => panic!("the built-in instruments cannot be read"),
    }
}

/// A whole virtual scan by the command line; the table it leaves.
fn scanned(folder: &Path, name: &str, plan: &Plan, more: &[OsString]) -> Measured {
    let plan_file = folder.join(format!("{name}.toml"));
    let head = format!("format = \"{}\"\n", gonio_instrument::plan::FORMAT);
    let text = plan.to_toml().unwrap_or_else(|e| panic!("{e}"));
    let text = if text.contains("format") { text } else { head + &text };
    std::fs::write(&plan_file, text).unwrap_or_else(|e| panic!("{e}"));
    let file = |n: &str| folder.join(n).into_os_string();
    let mut words: Vec<OsString> = [
        "gonio",
        "scan",
        "--device",
        "sim",
        "--clear-coat",
        "two-way",
        "--coat-index",
        "1.5",
        "--fit=lambert",
        "--force",
        "--seed",
    ]
    .map(Into::into)
    .to_vec();
    words.push(SEED.to_string().into());
    for (flag, path) in [
        ("--instrument", file("instrument.toml")),
        ("--truth", file("truth.json")),
        ("--plan", plan_file.clone().into_os_string()),
        ("-o", file(&format!("{name}.mcap"))),
    ] {
        words.extend([flag.into(), path]);
    }
    words.extend(more.iter().cloned());
    assert!(gonio::run(words) == std::process::ExitCode::SUCCESS, "the scan {name} failed");
    match formats::open(&folder.join(format!("{name}.nc"))) {
        Ok(Loaded::Table(t)) => *t,
        Ok(_) => panic!("not a table"),
        Err(e) => panic!("{e}"),
    }
}

fn of(brdf: &dyn Brdf, l: &[[f32; 3]], v: &[[f32; 3]], out: &mut [[f32; 3]]) {
    let double = |d: &[f32; 3]| Vec3::new(d[0].into(), d[1].into(), d[2].into());
    for ((l, v), o) in l.iter().zip(v).zip(out) {
        *o = brdf.eval(double(l), double(v)).map(|x| x as f32);
    }
}

/// Mean ΔE of the scene with the table's base seen through the coat, against the truth.
fn error(scene: &Gathered, truth: &ModelFile, table: &Measured) -> f64 {
    let material = Material::new("scan", Loaded::Table(Box::new(table.clone())));
    let body = body_of(&material, &Options::new(1.5)).unwrap_or_else(|e| panic!("{e}")).0;
    let Some(brdf) = body.as_ref().unwrap_or(&material).brdf() else { return f64::NAN };
    let a = scene.pictures(&|l, v, o| of(truth, l, v, o));
    let b = scene.pictures(&|l, v, o| of(brdf, l, v, o));
    spread(&pixel_differences(scene, &a, &b)).map_or(f64::NAN, |s| s.mean)
}

pub fn figures() -> Vec<Figure> {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let instrument = instrument();
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).unwrap_or_else(|e| panic!("{e}"));
    };
    write("truth.json", TRUTH);
    write("instrument.toml", &instrument.to_toml().unwrap_or_else(|e| panic!("{e}")));
    let truth = ModelFile::from_json(TRUTH).unwrap_or_else(|e| panic!("{e}"));
    let likely: Vec<ModelFile> =
        LIKELY.iter().map(|t| ModelFile::from_json(t).unwrap_or_else(|e| panic!("{e}"))).collect();
    let list: Vec<LikelyMaterial<'_>> =
        likely.iter().map(|m| LikelyMaterial { brdf: m, index: 1.5 }).collect();
    let scene = gather(&scene("product.toml").smaller(72, 4), 60.0, true).unwrap_or_else(|e| panic!("{e}"));
    let options = PlanOptions { fill: &fill_as_a_scan, bound: None };
    let planned = plan(&scene, &instrument, &list, options).unwrap_or_else(|e| panic!("{e}"));
    let full = scanned(folder.path(), "full", &instrument.plan, &[]);
    let few = scanned(folder.path(), "few", &planned.plan, &[]);
    let (full_error, few_error) = (error(&scene, &truth, &full), error(&scene, &truth, &few));
    let all = instrument.plan.tilt_deg.len() as f64;
    let mut out = vec![
        Figure::at_most(
            "product shot: poses of the plan over the full plan's",
            planned.plan.tilt_deg.len() as f64 / all,
            0.5,
            Some(SEED),
        ),
        Figure::said(
            "product shot: mean ΔE of the pictures, plan against full plan, scanned",
            format!(
                "{few_error:.3} against {full_error:.3} (expected {:.3}, {:.3})",
                planned.expected.delta_e, planned.full.delta_e
            ),
            "at most 5 % and 0.05 more",
            Some(SEED),
            few_error <= 1.05 * full_error + 0.05,
        ),
    ];
    // the same scan, which asks after each pose what the scene needs next
    let bound = 1.5;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenes/product.toml");
    let more = ["--scene".into(), path.into_os_string(), "--max-delta-e".into(), bound.to_string().into()];
    let adaptive = scanned(folder.path(), "adaptive", &instrument.plan, &more);
    let visited: Vec<f64> = adaptive
        .grid
        .theta_i_deg
        .iter()
        .enumerate()
        .filter(|(ti, _)| {
            let first = adaptive.grid.index(*ti, 0, 0);
            let one = adaptive.grid.theta_o_deg.len() * adaptive.grid.phi_deg.len();
            adaptive.flag[first..first + one].iter().filter(|f| **f == Flag::Measured).count() * 4 > one
        })
        .map(|r| *r.1)
        .collect();
    let adaptive_error = error(&scene, &truth, &adaptive);
    out.push(Figure::at_most(
        "product shot: poses of the adaptive scan over the full plan's",
        visited.len() as f64 / all,
        0.4,
        Some(SEED),
    ));
    out.push(Figure::said(
        "product shot: mean ΔE of the pictures, adaptive scan",
        format!("{adaptive_error:.3} with tilts {visited:?}"),
        &format!("≤ {bound}"),
        Some(SEED),
        adaptive_error <= bound,
    ));
    out
}
