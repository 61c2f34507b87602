//! Balls side by side: from the data, from the fit, and where an eye would tell them apart.

use gonio_brdf::Brdf;
use gonio_optics::colour;

use super::{Light, LinearImage, Sphere, Tone, normal_at, sphere};
use crate::draw::canvas::{Area, Canvas, PIXELS_PER_POINT};
use crate::draw::palette::{ColourMap, FAINT, INK, MUTED};
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

/// CIEDE2000 between two balls over the pixels that lie wholly on them, are reached by light and known in both.
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

/// A lighting, both balls and the ΔE of every pixel.
type Row<'a> = (&'a Lighting, [LinearImage; 2], Vec<Option<f64>>);

const GAP: f64 = 12.0;
const LEFT: f64 = 34.0;

/// Renders both reflectances under every lighting and compares them pixel by pixel: ΔE on Lab of the radiance factor times the
/// row's exposure, before the roll-off for the screen.
#[must_use]
pub fn spheres(data: &dyn Brdf, fit: &dyn Brdf, options: &Spheres) -> SphereComparison {
    let size = f64::from(options.size.clamp(32, 1024));
    let rows: Vec<Row<'_>> = options
        .rows
        .iter()
        .map(|row| {
            let one = Sphere {
                size: (size * PIXELS_PER_POINT) as u32,
                samples: options.samples,
                lights: row.lights.clone(),
            };
            let pair = [sphere(data, &one), sphere(fit, &one)];
            let map = delta_e(&pair, row);
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
        canvas.text_within((x(k as f64) + 0.5 * size, top - 8.0), words, &heading, size);
    }
    let mut differences = Vec::new();
    for (k, (row, pair, map)) in rows.iter().enumerate() {
        let y = top + k as f64 * row_height;
        let tone = Tone { exposure: row.exposure, ..Tone::default() };
        for (column, image) in pair.iter().enumerate() {
            canvas.place((x(column as f64), y), &image.to_picture(&tone));
        }
        canvas.place((x(2.0), y), &difference_picture(&pair[0], map, row, &bar));
        let side = Text::new(10.0, INK).upwards().at(Anchor::Middle, Anchor::Middle);
        canvas.text_within((18.0, y + 0.5 * size), &row.name, &side, size);
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

/// ΔE of every pixel that lies wholly on the ball, is reached by light and known in both.
fn delta_e(pair: &[LinearImage; 2], row: &Lighting) -> Vec<Option<f64>> {
    let [a, b] = pair;
    let lab = |v: &[f32; 3]| colour::lab_from_rgb(v.map(|x| f64::from(x) * row.exposure));
    let known = |v: &[f32; 3]| v.iter().all(|x| x.is_finite());
    (0..a.values.len())
        .map(|i| {
            let (p, q) = (a.values.get(i)?, b.values.get(i)?);
            let compared = a.coverage.get(i).is_some_and(|c| *c >= 1.0) && lit(a, i, &row.lights);
            (compared && known(p) && known(q))
                .then(|| colour::ciede2000(lab(p), lab(q)))
                .filter(|d| d.is_finite())
        })
        .collect()
}

/// Whether a light reaches the middle of a pixel.
fn lit(ball: &LinearImage, index: usize, lights: &[Light]) -> bool {
    let wide = ball.width.max(1) as usize;
    let at = |k: usize, n: u32| 2.0 * (k as f64 + 0.5) / f64::from(n) - 1.0;
    let Some(n) = normal_at(at(index % wide, ball.width), -at(index / wide, ball.height)) else {
        return false;
    };
    lights.iter().any(|light| match light {
        Light::Directional { towards, .. } => towards.dot(n) > 0.0,
        Light::Uniform { .. } => true,
    })
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

fn difference_picture(ball: &LinearImage, map: &[Option<f64>], row: &Lighting, bar: &ColourBar) -> Picture {
    Picture::from_fn(ball.width, ball.height, |x, y| {
        let i = y as usize * ball.width as usize + x as usize;
        let on_ball = ball.coverage.get(i).is_some_and(|c| *c >= 1.0);
        match map.get(i).copied().flatten() {
            Some(d) => bar.colour(d),
            None if on_ball && lit(ball, i, &row.lights) => hatch_at(f64::from(x) * 0.5, f64::from(y) * 0.5),
            None if on_ball => FAINT,
            None => [255; 3],
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
            // the dark side of the ball says nothing about the fit
            assert!(c.differences[1].pixels < c.differences[0].pixels, "{:?}", c.differences);
        }
    }

    struct Unknown;
    impl Brdf for Unknown {
        fn eval(&self, _: gonio_optics::Vec3, _: gonio_optics::Vec3) -> gonio_brdf::Rgb {
            [f64::NAN; 3]
        }
    }

    #[test]
    fn what_is_not_known_is_not_compared() {
        let c = spheres(&Unknown, &Lambert { diffuse: [0.5; 3] }, &small());
        assert!(c.differences.is_empty(), "{:?}", c.differences);
    }

    #[test]
    fn the_stated_difference_is_that_of_the_colours() {
        let (a, b) = (Lambert { diffuse: [0.4; 3] }, Lambert { diffuse: [0.5; 3] });
        let c = spheres(&a, &b, &small());
        // the radiance factors are the albedos times the cosine, which takes every value along a radius
        let at = |cos: f64| {
            colour::ciede2000(colour::lab_from_rgb([0.4 * cos; 3]), colour::lab_from_rgb([0.5 * cos; 3]))
        };
        let largest = (1..=1000).map(|k| at(f64::from(k) / 1000.0)).fold(0.0, f64::max);
        let d = &c.differences[0];
        assert!((d.max - largest).abs() < 0.002, "{d:?} {largest}");
        assert!(d.mean < d.p95 && d.p95 < d.max && d.mean > 0.9 * largest, "{d:?}");
    }
}
