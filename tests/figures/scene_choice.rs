//! Three scenes: the representation chosen for each keeps the bound on pixels that took no part in the choice, and what it costs beside the full table.

use std::path::{Path, PathBuf};

use gonio_brdf::ModelFile;
use gonio_brdf::formats::{self, Loaded};
use gonio_render::Scene;
use gonio_render::trace::gather;
use gonio_tailor::{
    ChoiceOptions, Material, Options, Representation, Statistic, choose, pixel_differences, spread,
};

use crate::Figure;

/// Gold about the mirror direction, blue away from it, under a coat.
pub const PAINT: &str = r#"{"model":"ggx","diffuse":[0.004,0.008,0.03],"lobes":[{"specular":[0.5,0.28,0.06],"alpha":0.2,"r0":0.6},{"specular":[0.02,0.12,0.3],"alpha":0.5,"r0":0.4}],"coat":{"index":1.5}}"#;

const BOUND: f64 = 1.5;

/// A scene of the documentation.
pub fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenes").join(name);
    Scene::open(&path).unwrap_or_else(|e| panic!("{e}"))
}

fn materials() -> Vec<Material> {
    let model = ModelFile::from_json(PAINT).unwrap_or_else(|e| panic!("{e}"));
    let mut out = vec![Material::new("virtual interference paint", Loaded::Model(Box::new(model)))];
    if let Some(folder) = std::env::var_os("GONIO_DATA") {
        let file = PathBuf::from(folder).join("nbrdf/merl_nbrdf.f32#blue-metallic-paint");
        match formats::open(&file) {
            Ok(loaded) => out.push(Material::new("blue-metallic-paint", loaded)),
            Err(e) => eprintln!("blue-metallic-paint did not run: {e}"),
        }
    } else {
        eprintln!("blue-metallic-paint did not run: GONIO_DATA is not set");
    }
    out
}

pub fn figures() -> Vec<Figure> {
    let mut out = Vec::new();
    for material in materials() {
        for file in ["product.toml", "car.toml", "turntable.toml"] {
            let chosen_on = gather(&scene(file).smaller(96, 4), 60.0, true).unwrap_or_else(|e| panic!("{e}"));
            // other pixels, other samples
            let judged_on =
                gather(&scene(file).smaller(131, 5), 60.0, true).unwrap_or_else(|e| panic!("{e}"));
            let options = ChoiceOptions {
                build: Options::new(material.stated_index().unwrap_or(1.5)),
                candidates: Representation::all().collect(),
                bound: BOUND,
                statistic: Statistic::Mean,
            };
            let choice = choose(&material, &chosen_on, &options).unwrap_or_else(|e| panic!("{e}"));
            let title = format!("{}, {}", file.trim_end_matches(".toml"), material.name);
            let Some(chosen) = choice.chosen.and_then(|k| choice.candidates.get(k)) else {
                let nearest = choice.nearest(Statistic::Mean).map_or(f64::NAN, |c| c.pixels.mean);
                out.push(Figure::said(
                    format!("{title}: a representation within the bound"),
                    format!("none, the nearest has {nearest:.2}"),
                    &format!("mean ΔE ≤ {BOUND}"),
                    None,
                    false,
                ));
                continue;
            };
            let body = gonio_tailor::body_of(&material, &options.build).unwrap_or_else(|e| panic!("{e}")).0;
            let Some(brdf) = body.as_ref().unwrap_or(&material).brdf() else { continue };
            let reference = judged_on.pictures(&|l, v, o| {
                for ((l, v), o) in l.iter().zip(v).zip(o) {
                    let double =
                        |d: &[f32; 3]| gonio_optics::Vec3::new(d[0].into(), d[1].into(), d[2].into());
                    *o = brdf.eval(double(l), double(v)).map(|x| x as f32);
                }
            });
            let made = judged_on.pictures(&|l, v, o| chosen.built.eval_many(l, v, o));
            let mean = spread(&pixel_differences(&judged_on, &reference, &made)).map_or(f64::NAN, |s| s.mean);
            let name = chosen.built.representation.to_string();
            // held out: the choice's own figure is within, this one may differ by the pixels' sampling
            out.push(Figure::at_most(
                format!("{title}: mean ΔE of other pixels with {name}"),
                mean,
                BOUND,
                None,
            ));
            out.push(Figure::at_most(
                format!("{title}: {name}, time over the full table's"),
                chosen.cost.median_ns / choice.table_ns,
                1.0,
                None,
            ));
            out.push(Figure::at_most(
                format!("{title}: {name}, size over the full table's"),
                chosen.built.bytes() as f64 / choice.table_bytes as f64,
                1.0,
                None,
            ));
        }
    }
    out
}
