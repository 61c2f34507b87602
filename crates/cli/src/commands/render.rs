//! `gonio render`: pictures of a scene, tone-mapped or linear, and what geometries they are made of.

use std::path::{Path, PathBuf};
use std::time::Instant;

use gonio_brdf::{Brdf, Coat, Rgb};
use gonio_optics::{Vec3, isoline::Method, isoline::isoline};
use gonio_render::plots::{SceneRow, scene_geometries};
use gonio_render::scene::Scene;
use gonio_render::sphere::{LinearImage, Tone};
use gonio_render::trace::{Paint, Placed, PlacedBrdf, RenderOptions, gather, render};
use gonio_tailor::{Built, Material, Representation};
use serde_json::json;

use crate::arguments::scene::RenderArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};
use crate::{effect, progress, scenes};

/// Renders every view.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or shows nothing.
pub fn run(a: &RenderArguments, printer: Printer) -> Result<Outcome, Failure> {
    let exr = match a.output.extension().and_then(|e| e.to_str()) {
        Some("png") => false,
        Some("exr") => true,
        _ => {
            return Err(Failure::usage(format!(
                "{}: expected a name that ends in .png (a picture) or .exr (linear radiance)",
                a.output.display()
            )));
        }
    };
    if a.mark_critical && exr {
        return Err(Failure::usage("--mark-critical draws over the picture: use it with a .png"));
    }
    let mut scene = scenes::open(&a.scene)?;
    if let Some(samples) = a.samples {
        if !(1..=65_536).contains(&samples) {
            return Err(Failure::usage(format!("--samples {samples}: expected 1 to 65536")));
        }
        scene.samples = samples;
    }
    if let Some(side) = a.side {
        if !(8..=16_384).contains(&side) {
            return Err(Failure::usage(format!("--side {side}: expected 8 to 16384 pixels")));
        }
        let largest = scene.size[0].max(scene.size[1]);
        scene.size = scene.size.map(|n| (u64::from(n) * u64::from(side) / u64::from(largest)).max(1) as u32);
    }
    let outputs = names(&a.output, scene.views.len());
    for path in outputs.iter().chain(&a.geometries) {
        output::check_free(path, a.force)?;
        output::check_apart(path, &[Path::new(&a.input), &a.scene])?;
    }
    if !(a.mm_per_unit >= 0.0 && a.mm_per_unit.is_finite()) {
        return Err(Failure::usage(format!(
            "--mm-per-unit {}: expected a length, not below 0",
            a.mm_per_unit
        )));
    }
    let car_paint = crate::opening::paint(&a.input)?.map(|p| p.paint);
    let material = effect::material(&a.input)?;
    let built = a.representation.as_deref().map(|name| build(a, &material, name)).transpose()?;
    let brdf: &dyn Brdf = match &built {
        Some(b) => b.brdf(),
        None => material.brdf().ok_or_else(|| {
            Failure::usage(format!(
                "{} holds scattered geometries, nothing in between; say --as flake-map:0, or fit a model to it first",
                material.name
            ))
        })?,
    };
    let gloss = match (&car_paint, a.coat.as_str()) {
        (Some(p), "auto") => p.parts().coat,
        _ => coat(&a.coat, &material)?,
    };
    let flakes = car_paint.as_ref().filter(|p| p.parts().flakes.is_some() && built.is_none()).map(ByPlace);
    let placed = flakes
        .as_ref()
        .filter(|_| a.mm_per_unit > 0.0)
        .map(|f| Placed { brdf: f, mm_per_unit: a.mm_per_unit });
    let bare = material.is_model() && material.stated_index().is_none_or(|n| n <= 1.0);
    let under = Under { base: brdf, coat: gloss.unwrap_or(Coat { index: 1.0 }) };
    let paint = Paint { brdf: if gloss.is_some() && bare { &under } else { brdf }, gloss };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(a.threads.unwrap_or(0))
        .build()
        .map_err(|e| Failure::failed("threads", e))?;
    let pixels = u64::from(scene.size[0]) * u64::from(scene.size[1]);
    let bar = progress::bar("rendering", pixels * scene.views.len() as u64);
    let step = |n: u64| bar.inc(n);
    let options = RenderOptions { bounces: a.bounces, cosine: !a.no_cosine, placed, progress: Some(&step) };
    let begun = Instant::now();
    let images = scene
        .views
        .iter()
        .map(|v| pool.install(|| render(&scene, v, paint, options)).map_err(Failure::usage))
        .collect::<Result<Vec<_>, _>>()?;
    let seconds = begun.elapsed().as_secs_f64();
    bar.finish_and_clear();
    if images.iter().all(|i| i.values.iter().flatten().all(|v| *v <= 0.0)) {
        return Err(Failure::usage(gonio_render::SceneError::Dark));
    }
    let white = scene.white();
    let samples = scene.samples;
    // lists of geometries take room: four samples a pixel tell enough
    scene.samples = samples.min(4);
    let marked = if a.mark_critical { Some(marks(a, &scene, &material)?) } else { None };
    for (k, (path, image)) in outputs.iter().zip(&images).enumerate() {
        if exr {
            let partial = path.with_extension("partial.exr");
            let saved = image.save_exr(&partial).map_err(|e| e.to_string());
            let moved = saved.and_then(|()| std::fs::rename(&partial, path).map_err(|e| e.to_string()));
            moved.map_err(|e| Failure::failed(&format!("{} cannot be written", path.display()), e))?;
        } else {
            let png = match &marked {
                Some(m) => {
                    let pixels = image.values.len();
                    let here = m.1.get(k * pixels..(k + 1) * pixels).unwrap_or_default().to_vec();
                    row(image, white, here).draw().to_png()
                }
                None => image.to_picture(&Tone { exposure: 1.0 / white, ..Tone::default() }).to_png(),
            };
            output::write_whole(
                path,
                &png.map_err(|e| Failure::failed("the picture cannot be encoded", e))?,
            )?;
        }
    }
    if let Some(path) = &a.geometries {
        geometries(path, &scene, brdf)?;
    }
    let unknown: usize = images.iter().map(LinearImage::missing).sum();
    let rate = pixels as f64 * f64::from(samples) * images.len() as f64 / seconds.max(1e-9);
    let mut text = format!(
        "{}: {} view(s) of {} × {} pixels, {} samples each, {seconds:.2} s, {:.2} million samples per second; written to {}",
        scene.name,
        images.len(),
        scene.size[0],
        scene.size[1],
        samples,
        rate / 1e6,
        outputs[0].display()
    );
    if let Some((share, _)) = &marked {
        text +=
            &format!("\n{:.1} % of the light comes from geometries beyond the critical angle", 100.0 * share);
    }
    if unknown > 0 {
        text += &format!("\n{unknown} pixels are hatched: the reflectance is not known there");
    }
    printer.result(
        &text,
        &json!({
            "input": a.input, "scene": scene.name, "representation": a.representation, "views": images.len(),
            "size": scene.size, "samples": samples, "bounces": a.bounces, "cosine": !a.no_cosine,
            "coat_index": gloss.map(|c| c.index), "flakes": placed.is_some(), "white_radiance": white, "seconds": seconds,
            "samples_per_second": rate, "threads": pool.current_num_threads(), "triangles": scene.body.triangles(),
            "beyond_critical_share": marked.as_ref().map(|m| m.0), "unknown_pixels": unknown,
            "outputs": outputs.iter().map(|p| shown(p)).collect::<Vec<_>>(),
            "geometries": a.geometries.as_deref().map(shown),
        }),
    );
    Ok(Outcome::Done)
}

/// `OUT.png`, or `OUT.000.png` and so on.
fn names(output: &Path, views: usize) -> Vec<PathBuf> {
    if views == 1 {
        return vec![output.to_owned()];
    }
    let ending = output.extension().unwrap_or_default().to_string_lossy();
    (0..views).map(|k| output.with_extension(format!("{k:03}.{ending}"))).collect()
}

fn build(a: &RenderArguments, material: &Material, name: &str) -> Result<Built, Failure> {
    let representation: Representation = name.parse().map_err(|e| Failure::usage(format!("--as: {e}")))?;
    let options = effect::options(&a.map, material)?;
    let built = representation
        .build(material, &options)
        .map_err(|e| Failure::usage(format!("{} as {name}: {e}", material.name)))?;
    effect::say(&built.findings);
    Ok(built)
}

fn coat(asked: &str, material: &Material) -> Result<Option<Coat>, Failure> {
    match asked {
        "none" => Ok(None),
        "auto" => Ok(material
            .is_model()
            .then(|| material.stated_index())
            .flatten()
            .filter(|n| *n > 1.0)
            .map(|index| Coat { index })),
        number => match number.parse::<f64>() {
            Ok(index) if index > 1.0 && index <= 4.0 => Ok(Some(Coat { index })),
            _ => Err(Failure::usage(format!(
                "--coat {number}: expected auto, none or a refractive index above 1, at most 4"
            ))),
        },
    }
}

/// A car paint with its flakes.
pub(super) struct ByPlace<'a>(pub(super) &'a gonio_paint::CarPaint);

impl PlacedBrdf for ByPlace<'_> {
    fn eval_at(&self, light: Vec3, view: Vec3, position_mm: [f64; 2]) -> Rgb {
        self.0.eval_at(light, view, position_mm)
    }
}

/// A bare base put under a coat.
struct Under<'a> {
    base: &'a dyn Brdf,
    coat: Coat,
}

impl Brdf for Under<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.coat.base_through(self.base, light, view)
    }

    fn sharpness(&self) -> f64 {
        self.base.sharpness()
    }
}

fn row(image: &LinearImage, white: f64, marks: Vec<f64>) -> SceneRow<'_> {
    SceneRow {
        title: String::new(),
        pictures: vec![("hatched: beyond the critical angle".to_owned(), image, marks)],
        white,
        differences: &[],
        note: String::new(),
    }
}

/// Share of the whole light, and of each pixel's, that comes from beyond the critical angle.
fn marks(a: &RenderArguments, scene: &Scene, material: &Material) -> Result<(f64, Vec<f64>), Failure> {
    let index = effect::index(a.map.index, material)?;
    let found = gather(scene, scenes::sharpness(material.brdf()), !a.no_cosine).map_err(Failure::usage)?;
    let limited = |l: Vec3, v: Vec3| isoline(l, v, index, Method::Clip).limited;
    let share = found
        .geometries()
        .iter()
        .map(|(g, w)| {
            let (l, v) = g.directions();
            if limited(l, v) { *w } else { 0.0 }
        })
        .sum();
    Ok((share, found.share_of(&limited)))
}

/// The scene's geometries as a picture or a list.
fn geometries(path: &Path, scene: &Scene, brdf: &dyn Brdf) -> Result<(), Failure> {
    let found = gather(scene, scenes::sharpness(Some(brdf)), true).map_err(Failure::usage)?.geometries();
    let bytes = match path.extension().and_then(|e| e.to_str()) {
        Some("csv") => scenes::to_csv(&found).into_bytes(),
        Some("png") => {
            scene_geometries(&found, &format!("What the scene looks at: {}", scene.name), Some(75.0))
                .to_png()
                .map_err(|e| Failure::failed("the picture cannot be encoded", e))?
        }
        _ => return Err(Failure::usage(format!("--geometries {}: expected .png or .csv", path.display()))),
    };
    output::write_whole(path, &bytes)
}
