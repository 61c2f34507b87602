//! `gonio paint sweep`: pictures of mixtures side by side.

use std::path::Path;

use gonio_optics::colour::lab_from_rgb;
use gonio_paint::CarPaint;
use gonio_paint::mixing::Part;
use gonio_render::picture::Picture;
use gonio_render::scene::{Scene, SceneFile};
use gonio_render::sphere::{LinearImage, Tone};
use gonio_render::trace::{Paint, Placed, RenderOptions, render};
use serde_json::json;

use crate::arguments::paint::SweepArguments;
use crate::commands::paint::{cost, mixable};
use crate::commands::render::ByPlace;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};
use crate::{progress, scenes};

/// A capsule in a product shot.
const CAPSULE: &str = include_str!("../../../../docs/scenes/product.toml");

/// Renders the strip.
///
/// # Errors
/// [`Failure::Usage`] for paints that do not mix, a range that is none, a scene that cannot be read.
pub fn run(a: &SweepArguments, printer: Printer) -> Result<Outcome, Failure> {
    output::check_free(&a.output, a.force)?;
    if a.output.extension().is_none_or(|e| e != "png") {
        return Err(Failure::usage(format!("{}: expected a name that ends in .png", a.output.display())));
    }
    let weights = weights(a)?;
    if !(a.mm_per_unit > 0.0 && a.mm_per_unit.is_finite()) {
        return Err(Failure::usage(format!("--mm-per-unit {}: expected a length above 0", a.mm_per_unit)));
    }
    if !(8..=4096).contains(&a.side) || a.samples.is_some_and(|s| !(1..=65_536).contains(&s)) {
        return Err(Failure::usage("expected --side of 8 to 4096 pixels and --samples of 1 to 65536"));
    }
    let mut scene = match &a.scene {
        Some(path) => scenes::open(path)?,
        None => {
            let file = SceneFile::from_toml(CAPSULE, "the built-in capsule").map_err(Failure::usage)?;
            Scene::build(&file, Path::new(".")).map_err(Failure::usage)?
        }
    };
    scene.samples = a.samples.unwrap_or(scene.samples);
    let samples = scene.samples;
    let scene = scene.smaller(a.side, samples);
    let (m, seconds) = mixable(&a.paints, 2)?;
    if a.paints.inputs.len() > 2 {
        return Err(Failure::usage(format!(
            "{} paints given, a sweep goes from one to another: give 2 (mix the others first)",
            a.paints.inputs.len()
        )));
    }
    let part: Part = a.part.into();
    let bar = progress::bar("rendering", weights.len() as u64);
    let (mut images, mut told) = (Vec::new(), Vec::new());
    for &w in &weights {
        let pair = [1.0 - w, w];
        let mixed =
            if a.textures { m.mix(&pair, part) } else { m.drawn(&pair, part) }.map_err(Failure::usage)?;
        let image = picture(&scene, &mixed.paint, a.mm_per_unit)?;
        let mean = mean(&image);
        let lab = lab_from_rgb(mean.map(|v| v / scene.white()));
        told.push(json!({ "weight": w, "mean_lab": [lab.l, lab.a, lab.b], "notes": mixed.notes }));
        images.push(image);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let strip = strip(&images, scene.white());
    let png = strip.to_png().map_err(|e| Failure::failed("the strip cannot be encoded", e))?;
    output::write_whole(&a.output, &png)?;
    let list: Vec<String> = weights.iter().map(|w| format!("{w:.3}")).collect();
    printer.result(
        &format!(
            "{} pictures, weight of {}: {}; read {:.2} s, prepared {:.2} s; written to {}",
            images.len(),
            a.paints.inputs[1],
            list.join(", "),
            seconds[0],
            seconds[1],
            a.output.display()
        ),
        &json!({
            "inputs": a.paints.inputs, "part": part.name(), "textures": a.textures, "scene": scene.name, "pictures": told,
            "mixable": cost(&m, seconds), "output": shown(&a.output),
        }),
    );
    Ok(Outcome::Done)
}

fn weights(a: &SweepArguments) -> Result<Vec<f64>, Failure> {
    let count = ((a.to - a.from) / a.step).round();
    let fits = (1.0..=63.0).contains(&count) && (a.from + count * a.step - a.to).abs() < 1e-9;
    if !fits {
        return Err(Failure::usage(format!(
            "from {} to {} in steps of {}: expected a whole number of steps, 1 to 63",
            a.from, a.to, a.step
        )));
    }
    Ok((0..=count as u32).map(|k| a.from + f64::from(k) * a.step).collect())
}

/// The first view of a scene with the gloss of the paint's coat and its flakes by place.
fn picture(scene: &Scene, paint: &CarPaint, mm_per_unit: f64) -> Result<LinearImage, Failure> {
    let flakes = ByPlace(paint);
    let placed = paint.parts().flakes.is_some().then_some(Placed { brdf: &flakes, mm_per_unit });
    let Some(view) = scene.views.first() else { return Err(Failure::usage("the scene has no view")) };
    let options = RenderOptions { placed, ..RenderOptions::default() };
    render(scene, view, Paint { brdf: paint, gloss: paint.parts().coat }, options).map_err(Failure::usage)
}

/// Mean radiance over what the object covers.
fn mean(image: &LinearImage) -> [f64; 3] {
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for (v, c) in image.values.iter().zip(&image.coverage) {
        if v.iter().all(|x| x.is_finite()) {
            for k in 0..3 {
                sum[k] += f64::from(v[k] * c);
            }
            weight += f64::from(*c);
        }
    }
    sum.map(|s| if weight > 0.0 { s / weight } else { 0.0 })
}

fn strip(images: &[LinearImage], white: f64) -> Picture {
    let tone = Tone { exposure: 1.0 / white, ..Tone::default() };
    let pictures: Vec<Picture> = images.iter().map(|i| i.to_picture(&tone)).collect();
    let (w, h) = (images[0].width, images[0].height);
    Picture::from_fn(w * images.len() as u32, h, |x, y| {
        pictures[(x / w) as usize].get(x % w, y).unwrap_or(tone.background)
    })
}
