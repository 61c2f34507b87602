//! Plans for the product shot, scanned on the virtual instrument: the planned and the adaptive scan against the full one, by the pictures they give.

use std::ffi::OsString;
use std::path::Path;

use gonio_acquisition::fill;
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

/// A paint that the planner is not told of, and what it is told: paints of other colours and widths.
struct Case {
    name: &'static str,
    truth: &'static str,
    likely: [&'static str; 2],
    /// Refractive index of the coats, 1 for none.
    index: f64,
}

const COATED: [&str; 2] = [
    r#"{"model":"ggx","diffuse":[0.10,0.10,0.11],"lobes":[{"specular":[0.55,0.56,0.58],"alpha":0.30,"r0":0.6}],"coat":{"index":1.5}}"#,
    r#"{"model":"ggx","diffuse":[0.02,0.05,0.16],"lobes":[{"specular":[0.10,0.20,0.45],"alpha":0.24,"r0":0.5}],"coat":{"index":1.5}}"#,
];
const CASES: [Case; 3] = [
    Case {
        name: "metallic",
        truth: r#"{"model":"ggx","diffuse":[0.05,0.02,0.02],"lobes":[{"specular":[0.45,0.12,0.08],"alpha":0.27,"r0":0.55}],"coat":{"index":1.5}}"#,
        likely: COATED,
        index: 1.5,
    },
    Case { name: "interference", truth: crate::scene_choice::PAINT, likely: COATED, index: 1.5 },
    Case {
        name: "satin without a coat",
        truth: r#"{"model":"ggx","diffuse":[0.12,0.2,0.08],"lobes":[{"specular":[0.5,0.5,0.5],"alpha":0.32,"r0":0.06}]}"#,
        likely: [
            r#"{"model":"ggx","diffuse":[0.3,0.28,0.25],"lobes":[{"specular":[0.6,0.6,0.6],"alpha":0.4,"r0":0.05}]}"#,
            r#"{"model":"ggx","diffuse":[0.03,0.05,0.2],"lobes":[{"specular":[0.4,0.4,0.4],"alpha":0.25,"r0":0.08}]}"#,
        ],
        index: 1.0,
    },
];
/// Seed of the scans.
const SEED: u64 = 1;

fn fill_as_a_scan(m: &mut Measured) {
    let index: Option<f64> = m.attributes.get("coat_index").and_then(|s| s.parse().ok());
    fill::fill(m, index.map(|index| Coat { index }).as_ref(), 75.0);
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
    let mut words: Vec<OsString> =
        ["gonio", "scan", "--device", "sim", "--fit=lambert", "--force", "--seed"].map(Into::into).to_vec();
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

/// What a scan is expected to be allowed over the full plan: ΔE that nobody sees.
fn allowed(full: f64) -> f64 {
    1.05 * full + 0.05
}

pub fn figures() -> Vec<Figure> {
    CASES.iter().flat_map(figures_of).collect()
}

fn figures_of(case: &Case) -> Vec<Figure> {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let instrument = instrument();
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).unwrap_or_else(|e| panic!("{e}"));
    };
    write("truth.json", case.truth);
    write("instrument.toml", &instrument.to_toml().unwrap_or_else(|e| panic!("{e}")));
    let truth = ModelFile::from_json(case.truth).unwrap_or_else(|e| panic!("{e}"));
    let likely: Vec<ModelFile> =
        case.likely.iter().map(|t| ModelFile::from_json(t).unwrap_or_else(|e| panic!("{e}"))).collect();
    let list: Vec<LikelyMaterial<'_>> =
        likely.iter().map(|m| LikelyMaterial { brdf: m, index: case.index }).collect();
    let scene = gather(&scene("product.toml").smaller(72, 4), 60.0, true).unwrap_or_else(|e| panic!("{e}"));
    let options = PlanOptions { fill: &fill_as_a_scan, bound: None };
    let planned = plan(&scene, &instrument, &list, options).unwrap_or_else(|e| panic!("{e}"));
    let coat: Vec<OsString> = if case.index > 1.0 {
        ["--clear-coat".into(), "two-way".into(), "--coat-index".into(), case.index.to_string().into()].into()
    } else {
        ["--clear-coat".into(), "none".into()].into()
    };
    let scan = |name: &str, plan: &Plan, more: &[OsString]| {
        scanned(folder.path(), name, plan, &[&coat[..], more].concat())
    };
    let full = scan("full", &instrument.plan, &[]);
    let few = scan("few", &planned.plan, &[]);
    let (full_error, few_error) = (error(&scene, &truth, &full), error(&scene, &truth, &few));
    let all = instrument.plan.tilt_deg.len() as f64;
    let title = format!("product shot, {}", case.name);
    let mut out = vec![
        Figure::at_most(
            format!("{title}: poses of the plan over the full plan's"),
            planned.plan.tilt_deg.len() as f64 / all,
            0.5,
            Some(SEED),
        ),
        Figure::said(
            format!("{title}: mean ΔE of the pictures, plan against full plan, scanned"),
            format!(
                "{few_error:.3} against {full_error:.3} (expected {:.3}, {:.3}) with tilts {:?}",
                planned.expected.delta_e, planned.full.delta_e, planned.plan.tilt_deg
            ),
            "at most 5 % and 0.05 more",
            Some(SEED),
            few_error <= allowed(full_error),
        ),
    ];
    // the same scan, which asks after each pose what the scene needs next: to what the full plan gives, and to what will do for a product shot
    for bound in [allowed(full_error), 1.0] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenes/product.toml");
        let more =
            ["--scene".into(), path.into_os_string(), "--max-delta-e".into(), format!("{bound:.3}").into()];
        let adaptive = scan("adaptive", &instrument.plan, &more);
        let visited = visited(&adaptive);
        let adaptive_error = error(&scene, &truth, &adaptive);
        out.push(Figure::at_most(
            format!("{title}: poses of the adaptive scan to ΔE {bound:.3} over the full plan's"),
            visited.len() as f64 / all,
            0.4,
            Some(SEED),
        ));
        out.push(Figure::said(
            format!("{title}: mean ΔE of the pictures, adaptive scan"),
            format!("{adaptive_error:.3} with tilts {visited:?}"),
            &format!("≤ {bound:.3}"),
            Some(SEED),
            adaptive_error <= bound,
        ));
    }
    out
}

/// Tilts of the rows that were measured.
fn visited(table: &Measured) -> Vec<f64> {
    let one = table.grid.theta_o_deg.len() * table.grid.phi_deg.len();
    let measured = |ti: usize| {
        let first = table.grid.index(ti, 0, 0);
        table.flag[first..first + one].iter().filter(|f| **f == Flag::Measured).count() * 4 > one
    };
    table.grid.theta_i_deg.iter().enumerate().filter(|(ti, _)| measured(*ti)).map(|r| *r.1).collect()
}
