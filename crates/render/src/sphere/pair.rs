//! Balls side by side: from the data, from the fit, and where an eye would tell them apart.

use gonio_brdf::Brdf;
use gonio_optics::colour;

use super::{Light, LinearImage, Sphere, Tone, sphere};
use crate::draw::canvas::{Area, Canvas, PIXELS_PER_POINT};
use crate::draw::palette::{ColourMap, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;
use crate::plots::{ColourBar, Scale, hatch_at, nice_above, quantile, title};

/// A row of balls: a name and its lights.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    /// Written beside the row.
    pub name: String,
    /// Lights, added up.
    pub lights: Vec<Light>,
    /// Factor on all values of the row.
    pub exposure: f64,
}

/// Options of [`spheres`].
#[derive(Clone, Debug, PartialEq)]
pub struct Spheres {
    /// Above the picture; empty for none.
    pub title: String,
    /// Captions of the two columns.
    pub captions: [String; 2],
    /// The rows.
    pub rows: Vec<Lighting>,
    /// Size of a ball's image in points (two pixels each).
    pub size: u32,
    /// Samples per pixel along each side.
    pub samples: u32,
    /// Full scale of ΔE; `None` for a round number above 98 % of the pixels.
    pub full_scale: Option<f64>,
}

impl Default for Spheres {
    fn default() -> Self {
        let row = |name: &str, light| Lighting { name: name.into(), lights: vec![light], exposure: 1.0 };
        Self {
            title: String::new(),
            captions: ["data".into(), "fit".into()],
            rows: vec![
                row("light behind the detector", Light::behind_detector()),
                row("light aside", Light::aside()),
            ],
            size: 220,
            samples: 2,
            full_scale: None,
        }
    }
}

/// CIEDE2000 between two balls over the pixels that lie wholly on them and are known in both.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereDifference {
    /// Name of the row.
    pub lighting: String,
    /// Mean.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Pixels compared.
    pub pixels: usize,
}

/// What [`spheres`] gives.
#[derive(Clone, Debug)]
pub struct SphereComparison {
    /// Both balls and the ΔE map, a row for each lighting.
    pub picture: Picture,
    /// ΔE of each row; empty rows (nothing known) are left out.
    pub differences: Vec<SphereDifference>,
    /// The balls in linear light, `[data, fit]` for each row.
    pub linear: Vec<[LinearImage; 2]>,
}

const GAP: f64 = 12.0;
const LEFT: f64 = 34.0;

/// Renders both reflectances under every lighting and compares them pixel by pixel: ΔE on Lab of the radiance factor times the
/// row's exposure, before the roll-off for the screen.
#[must_use]
pub fn spheres(data: &dyn Brdf, fit: &dyn Brdf, options: &Spheres) -> SphereComparison {
    let size = f64::from(options.size.clamp(32, 1024));
    let rows: Vec<(&Lighting, [LinearImage; 2], Vec<Option<f64>>)> = options
        .rows
        .iter()
        .map(|row| {
            let one = Sphere {
                size: (size * PIXELS_PER_POINT) as u32,
                samples: options.samples,
                lights: row.lights.clone(),
            };
            let pair = [sphere(data, &one), sphere(fit, &one)];
            let map = delta_e(&pair, row.exposure);
            (row, pair, map)
        })
        .collect();
    let bar = bar(options.full_scale, rows.iter().flat_map(|r| r.2.iter().flatten().copied()));
    let top = if options.title.is_empty() { 26.0 } else { 50.0 };
    let row_height = size + 26.0;
    let width = LEFT + 3.0 * size + 2.0 * GAP + 12.0;
    let mut canvas = Canvas::new(width, top + rows.len() as f64 * row_height + 46.0);
    title(&mut canvas, &options.title);
    let x = |k: f64| LEFT + k * (size + GAP);
    let heading = Text::new(11.0, INK).bold().at(Anchor::Middle, Anchor::End);
    for (k, words) in [options.captions[0].as_str(), options.captions[1].as_str(), "difference (CIEDE2000)"]
        .iter()
        .enumerate()
    {
        canvas.text((x(k as f64) + 0.5 * size, top - 8.0), words, &heading);
    }
    let mut differences = Vec::new();
    for (k, (row, pair, map)) in rows.iter().enumerate() {
        let y = top + k as f64 * row_height;
        let tone = Tone { exposure: row.exposure, ..Tone::default() };
        for (column, image) in pair.iter().enumerate() {
            canvas.place((x(column as f64), y), &image.to_picture(&tone));
        }
        canvas.place((x(2.0), y), &difference_picture(&pair[0], map, &bar));
        let side = Text::new(10.0, INK).upwards().at(Anchor::Middle, Anchor::Middle);
        canvas.text((18.0, y + 0.5 * size), &row.name, &side);
        let note = Text::new(9.5, MUTED).at(Anchor::Middle, Anchor::Start);
        let found = statistics(&row.name, map);
        let words = match &found {
            Some(d) => format!("ΔE₀₀ mean {:.2} · 95th {:.2} · max {:.2}", d.mean, d.p95, d.max),
            None => "nothing to compare".into(),
        };
        canvas.text((x(2.0) + 0.5 * size, y + size + 7.0), &words, &note);
        if row.exposure != 1.0 {
            let words = format!("exposure × {}", crate::plots::short(row.exposure));
            canvas.text((x(0.5) + 0.5 * size, y + size + 7.0), &words, &note);
        }
        differences.extend(found);
    }
    let y = top + rows.len() as f64 * row_height + 4.0;
    bar.draw_lying(&mut canvas, Area::new(x(2.0) + 6.0, y, size - 12.0, 9.0));
    let linear = rows.into_iter().map(|r| r.1).collect();
    SphereComparison { picture: canvas.finish(), differences, linear }
}

fn delta_e(pair: &[LinearImage; 2], exposure: f64) -> Vec<Option<f64>> {
    let [a, b] = pair;
    let lab = |v: &[f32; 3]| colour::lab_from_rgb(v.map(|x| f64::from(x) * exposure));
    a.values
        .iter()
        .zip(&b.values)
        .zip(&a.coverage)
        .map(|((p, q), cover)| {
            let d = (*cover >= 1.0).then(|| colour::ciede2000(lab(p), lab(q)))?;
            d.is_finite().then_some(d)
        })
        .collect()
}

fn statistics(lighting: &str, map: &[Option<f64>]) -> Option<SphereDifference> {
    let known = || map.iter().flatten().copied();
    let pixels = known().count();
    Some(SphereDifference {
        lighting: lighting.into(),
        mean: known().sum::<f64>() / pixels.max(1) as f64,
        p95: quantile(known(), 0.95)?,
        max: quantile(known(), 1.0)?,
        pixels,
    })
}

fn bar(full_scale: Option<f64>, all: impl Iterator<Item = f64>) -> ColourBar {
    let all: Vec<f64> = all.collect();
    let full = full_scale
        .filter(|f| *f > 0.0 && f.is_finite())
        .unwrap_or_else(|| nice_above(quantile(all.iter().copied(), 0.98).unwrap_or(1.0).clamp(0.5, 50.0)));
    ColourBar {
        map: ColourMap::Viridis,
        scale: Scale::linear(0.0, full),
        label: "ΔE₀₀".into(),
        beyond: [false, all.iter().any(|d| *d > full)],
    }
}

fn difference_picture(ball: &LinearImage, map: &[Option<f64>], bar: &ColourBar) -> Picture {
    Picture::from_fn(ball.width, ball.height, |x, y| {
        let i = y as usize * ball.width as usize + x as usize;
        match (map.get(i).copied().flatten(), ball.coverage.get(i)) {
            (Some(d), _) => bar.colour(d),
            (None, Some(cover)) if *cover >= 1.0 => hatch_at(f64::from(x) * 0.5, f64::from(y) * 0.5),
            _ => [255; 3],
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::models::Lambert;

    fn small() -> Spheres {
        Spheres { size: 40, ..Spheres::default() }
    }

    #[test]
    fn equal_balls_do_not_differ_and_black_ones_do_no_harm() {
        for albedo in [0.0, 0.4] {
            let ball = Lambert { diffuse: [albedo; 3] };
            let c = spheres(&ball, &ball, &small());
            assert_eq!(c.differences.len(), 2);
            assert!(c.differences.iter().all(|d| d.max == 0.0 && d.pixels > 1000), "{:?}", c.differences);
        }
    }

    #[test]
    fn the_stated_difference_is_that_of_the_colours() {
        let (a, b) = (Lambert { diffuse: [0.4; 3] }, Lambert { diffuse: [0.5; 3] });
        let c = spheres(&a, &b, &small());
        // facing the light the radiance factors are the albedos; further out both are darker and closer
        let facing = colour::ciede2000(colour::lab_from_rgb([0.4; 3]), colour::lab_from_rgb([0.5; 3]));
        let d = &c.differences[0];
        assert!((d.max - facing).abs() < 0.02, "{d:?} {facing}");
        assert!(d.mean < d.max && d.p95 <= d.max && d.mean > 0.5 * facing);
    }
}
