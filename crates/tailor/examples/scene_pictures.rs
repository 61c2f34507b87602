//! Draws the pictures of docs/scenes.md: `cargo run --release -p gonio-tailor --example scene_pictures -- docs/scenes OUT [DATA]`.
//!
//! DATA is a folder of real measurements (`mbsdf/carpaint_blue.mbsdf`, `rgl/cc_ibiza_sunset_rgb.bsdf`); without it virtual paints take their place.

use std::path::{Path, PathBuf};

use gonio_brdf::formats::{self, Loaded};
use gonio_brdf::{Brdf, Coat, ModelFile};
use gonio_fitter::ModelChoice;
use gonio_optics::isoline::{Method, isoline};
use gonio_optics::{Vec3, colour};
use gonio_render::Picture;
use gonio_render::plots::{SceneRow, scene_geometries};
use gonio_render::scene::Scene;
use gonio_render::sphere::LinearImage;
use gonio_render::trace::{Gathered, Paint, RenderOptions, gather, render};
use gonio_tailor::{Material, Options, Representation, body_of, pixel_differences, spread};

const GOLD: &str = r#"{"model":"ggx","diffuse":[0.004,0.008,0.03],"lobes":[{"specular":[0.5,0.28,0.06],"alpha":0.2,"r0":0.6},{"specular":[0.02,0.12,0.3],"alpha":0.5,"r0":0.4}],"coat":{"index":1.5}}"#;
const SILVER: &str = r#"{"model":"ggx","diffuse":[0.10,0.10,0.11],"lobes":[{"specular":[0.55,0.56,0.58],"alpha":0.30,"r0":0.6}],"coat":{"index":1.5}}"#;

type Error = Box<dyn std::error::Error>;

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (Some(scenes), Some(out)) = (arguments.next(), arguments.next()) else {
        return Err("usage: scene_pictures SCENES OUT [DATA]".into());
    };
    let data = arguments.next();
    std::fs::create_dir_all(&out)?;
    let model = |name: &str, text: &str| -> Result<Material, Error> {
        Ok(Material::new(name, Loaded::Model(Box::new(ModelFile::from_json(text)?))))
    };
    let real = |name: &str, file: &str, otherwise: &str| -> Result<Material, Error> {
        match &data {
            Some(folder) => Ok(Material::new(name, formats::open(&folder.join(file))?)),
            None => model(name, otherwise),
        }
    };
    let interference = real("colour-shifting wrap", "rgl/cc_ibiza_sunset_rgb.bsdf", GOLD)?;
    let blue = real("blue car paint, base coat", "mbsdf/carpaint_blue.mbsdf", SILVER)?;
    let index = 1.5;
    spheres(&scenes, &interference, index)?.save_png(&out.join("scene-spheres.png"))?;
    fixes(&scenes, &interference, index)?.save_png(&out.join("scene-fixes.png"))?;
    teapots(&scenes, &model("silver metallic", SILVER)?, &model("interference", GOLD)?)?
        .save_png(&out.join("scene-teapots.png"))?;
    egg(&scenes, &blue)?.save_png(&out.join("scene-egg.png"))?;
    let product = gather(&open(&scenes, "product.toml")?.smaller(160, 4), 60.0, true)?;
    scene_geometries(&product.geometries(), "What the product shot looks at", Some(75.0))
        .save_png(&out.join("scene-geometries.png"))?;
    views(&scenes, &model("interference", GOLD)?)?.save_png(&out.join("scene-three.png"))?;
    Ok(())
}

fn open(folder: &Path, name: &str) -> Result<Scene, Error> {
    Ok(Scene::open(&folder.join(name))?)
}

fn of(brdf: &dyn Brdf, scene: &Gathered) -> LinearImage {
    let double = |d: &[f32; 3]| Vec3::new(d[0].into(), d[1].into(), d[2].into());
    let f = |l: &[[f32; 3]], v: &[[f32; 3]], out: &mut [[f32; 3]]| {
        for ((l, v), o) in l.iter().zip(v).zip(out) {
            *o = brdf.eval(double(l), double(v)).map(|x| x as f32);
        }
    };
    scene.pictures(&f).swap_remove(0)
}

/// White that shows a paint bright: the 97th percentile of its luminance becomes 0.8.
fn white(image: &LinearImage) -> f64 {
    let mut y: Vec<f64> =
        image.values.iter().map(|v| colour::luminance(v.map(f64::from))).filter(|y| *y > 0.0).collect();
    y.sort_by(f64::total_cmp);
    y.get(y.len() * 97 / 100).map_or(1.0, |y| y / 0.8)
}

/// Rows one under the other.
fn stacked(rows: &[Picture]) -> Picture {
    let wide = rows.iter().map(Picture::width).max().unwrap_or(1);
    let high = rows.iter().map(Picture::height).sum();
    let mut out = Picture::new(wide, high, [255; 3]);
    let mut top = 0;
    for row in rows {
        for y in 0..row.height() {
            for x in 0..row.width() {
                if let Some(p) = row.get(x, y) {
                    out.set(x, top + y, p);
                }
            }
        }
        top += row.height();
    }
    out
}

/// Light behind the detector and aside, without the projected solid angle as in the paper: the full table, A with what lies beyond the critical angle marked,
/// C, and A with the projected solid angle.
fn spheres(scenes: &Path, material: &Material, index: f64) -> Result<Picture, Error> {
    let options = Options::new(index);
    let body = body_of(material, &options)?.0;
    let material = body.as_ref().unwrap_or(material);
    let full = material.brdf().ok_or("scattered")?;
    let a = Representation::ColourMap(Method::Clip).build(material, &options)?;
    let c = Representation::ColourMap(Method::UnitIndex).build(material, &options)?;
    let mut rows = Vec::new();
    for (file, words) in
        [("sphere-behind.toml", "light behind the detector"), ("sphere-aside.toml", "light aside")]
    {
        let scene = open(scenes, file)?;
        let (flat, cosine) = (gather(&scene, 60.0, false)?, gather(&scene, 60.0, true)?);
        let marks = flat.share_of(&|l, v| isoline(l, v, index, Method::Clip).limited);
        let images = [
            of(full, &flat),
            of(a.brdf(), &flat),
            of(a.brdf(), &flat),
            of(c.brdf(), &flat),
            of(a.brdf(), &cosine),
        ];
        let names = ["full", "A", "A, beyond critical angle", "C", "A, with cosine"];
        let level = white(&images[0]);
        rows.push(
            SceneRow {
                title: format!("{}: {words}", material.name),
                pictures: images
                    .iter()
                    .zip(names)
                    .enumerate()
                    .map(|(k, (i, n))| (n.to_owned(), i, if k == 2 { marks.clone() } else { vec![] }))
                    .collect(),
                white: level,
                differences: &[],
                note: String::new(),
            }
            .draw(),
        );
    }
    Ok(stacked(&rows))
}

/// The full table, A, both B, C and the flake map side by side, each with its colour difference.
fn fixes(scenes: &Path, material: &Material, index: f64) -> Result<Picture, Error> {
    let options = Options::new(index);
    let body = body_of(material, &options)?.0;
    let material = body.as_ref().unwrap_or(material);
    let full = material.brdf().ok_or("scattered")?;
    let seen = gather(&open(scenes, "sphere-aside.toml")?, 60.0, true)?;
    let reference = of(full, &seen);
    let mut images = vec![("full table".to_owned(), reference.clone())];
    for (name, r) in [
        ("A", Representation::ColourMap(Method::Clip)),
        ("B", Representation::ColourMap(Method::MapVector)),
        ("B∥", Representation::ColourMap(Method::MapVectorParallel)),
        ("C", Representation::ColourMap(Method::UnitIndex)),
        ("D, K = 0", Representation::FlakeMap(0)),
        ("D, K = 1", Representation::FlakeMap(1)),
    ] {
        let image = of(r.build(material, &options)?.brdf(), &seen);
        let differences =
            pixel_differences(&seen, std::slice::from_ref(&reference), std::slice::from_ref(&image));
        let mean = spread(&differences).map_or(f64::NAN, |s| s.mean);
        images.push((format!("{name}: ΔE {mean:.2}"), image));
    }
    let level = white(&reference);
    Ok(SceneRow {
        title: format!("{}: the fixes beyond the critical angle, light aside", material.name),
        pictures: images.iter().map(|(n, i)| (n.clone(), i, vec![])).collect(),
        white: level,
        differences: &[],
        note: String::new(),
    }
    .draw())
}

fn painted(scene: &Scene, material: &Material) -> Result<LinearImage, Error> {
    let gloss = material.stated_index().filter(|n| *n > 1.0).map(|index| Coat { index });
    let brdf = material.brdf().ok_or("scattered")?;
    Ok(render(
        scene,
        &scene.views[0],
        Paint { brdf, gloss },
        RenderOptions { bounces: 2, ..RenderOptions::default() },
    )?)
}

fn teapots(scenes: &Path, metallic: &Material, interference: &Material) -> Result<Picture, Error> {
    let scene = open(scenes, "teapot.toml")?;
    let (a, b) = (painted(&scene, metallic)?, painted(&scene, interference)?);
    Ok(SceneRow {
        title: "Teapot, coat added".to_owned(),
        pictures: vec![(metallic.name.clone(), &a, vec![]), (interference.name.clone(), &b, vec![])],
        white: 0.6 * scene.white(),
        differences: &[],
        note: String::new(),
    }
    .draw())
}

/// Data against fits on the egg, as in Sopp's chapter 5.
fn egg(scenes: &Path, material: &Material) -> Result<Picture, Error> {
    let seen = gather(&open(scenes, "egg.toml")?, 60.0, true)?;
    let data = of(material.brdf().ok_or("scattered")?, &seen);
    let mut images = vec![("data".to_owned(), data.clone())];
    for name in ["ashikhmin-shirley-simplified", "lambert-ashikhmin-shirley", "ggx:2"] {
        let Some((_, choice)) = ModelChoice::ALL.into_iter().find(|a| a.0 == name) else { continue };
        let built = Representation::Model(choice).build(material, &Options::new(1.0))?;
        let image = of(built.brdf(), &seen);
        let differences = pixel_differences(&seen, std::slice::from_ref(&data), std::slice::from_ref(&image));
        let mean = spread(&differences).map_or(f64::NAN, |s| s.mean);
        let short = name.replace("ashikhmin-shirley", "A.–S.");
        images.push((format!("{short}: ΔE {mean:.2}"), image));
    }
    let level = white(&data);
    Ok(SceneRow {
        title: format!("{}: data and fits", material.name),
        pictures: images.iter().map(|(n, i)| (n.clone(), i, vec![])).collect(),
        white: level,
        differences: &[],
        note: String::new(),
    }
    .draw())
}

/// The three scenes of the figures.
fn views(scenes: &Path, material: &Material) -> Result<Picture, Error> {
    let mut rows = Vec::new();
    for file in ["product.toml", "car.toml", "turntable.toml"] {
        let scene = open(scenes, file)?.smaller(420, 32);
        let image = painted(&scene, material)?;
        rows.push(
            SceneRow {
                title: String::new(),
                pictures: vec![(scene.name.clone(), &image, vec![])],
                white: 0.7 * scene.white(),
                differences: &[],
                note: String::new(),
            }
            .draw(),
        );
    }
    Ok(stacked(&rows))
}
