//! What a scene looks at: the weight of local geometries over θi and θo, over the azimuth, and over the angle from the mirror direction.

use gonio_optics::Geometry;

use super::axis::{Scale, short};
use super::unfolded::title;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::{ColourMap, FAINT, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;

const SIDE: f64 = 250.0;
const BIN_DEG: f64 = 2.5;

/// Draws the distribution; weights need not sum to 1. `limit_deg` is drawn where an instrument or a map ends.
#[must_use]
pub fn scene_geometries(geometries: &[(Geometry, f64)], heading: &str, limit_deg: Option<f64>) -> Picture {
    let total: f64 = geometries.iter().map(|g| g.1).sum::<f64>().max(f64::MIN_POSITIVE);
    let of = |pick: fn(&Geometry) -> f64, most: f64| {
        let n = (most / BIN_DEG).round() as usize;
        let mut bins = vec![0.0; n];
        for (g, w) in geometries {
            bins[((pick(g) / BIN_DEG).max(0.0) as usize).min(n - 1)] += w / total;
        }
        bins
    };
    let top = if heading.is_empty() { 16.0 } else { 44.0 };
    let mut canvas = Canvas::new(60.0 + 3.0 * (SIDE + 56.0), top + SIDE + 64.0);
    title(&mut canvas, heading);
    let area = |k: f64| Area::new(56.0 + k * (SIDE + 56.0), top, SIDE, SIDE);
    plane(&mut canvas, area(0.0), geometries, total, limit_deg);
    bars(
        &mut canvas,
        area(1.0),
        &of(|g| g.phi.folded().degrees(), 180.0),
        180.0,
        "azimuth φ, degrees (180: mirror side)",
    );
    bars(
        &mut canvas,
        area(2.0),
        &of(|g| g.from_mirror().degrees(), 180.0),
        180.0,
        "from the mirror direction, degrees",
    );
    canvas.finish()
}

fn plane(canvas: &mut Canvas, area: Area, geometries: &[(Geometry, f64)], total: f64, limit: Option<f64>) {
    let n = (90.0 / BIN_DEG) as usize;
    let mut bins = vec![0.0; n * n];
    for (g, w) in geometries {
        let at = |d: f64| ((d / BIN_DEG).max(0.0) as usize).min(n - 1);
        bins[at(g.theta_o.degrees()) * n + at(g.theta_i.degrees())] += w / total;
    }
    let most = bins.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    canvas.paint(area, 1, |u, v| {
        let (i, o) = ((u * n as f64) as usize, ((1.0 - v) * n as f64) as usize);
        let w = bins.get(o.min(n - 1) * n + i.min(n - 1)).copied().unwrap_or(0.0);
        // the root, so that thin weights are seen beside thick ones
        (w > 0.0).then(|| ColourMap::Viridis.at((w / most).sqrt()))
    });
    if let Some(limit) = limit {
        let (x, y) = (area.x + area.w * limit / 90.0, area.bottom() - area.h * limit / 90.0);
        canvas.dashed(&[(x, area.bottom()), (x, y), (area.x, y)], 1.0, 4.0, 3.0, INK);
    }
    frame(canvas, area, 90.0, "angle of incidence θi, degrees");
    let scale = Scale::linear(0.0, 90.0);
    for tick in scale.ticks(6) {
        let y = area.bottom() - scale.fraction(tick.value) * area.h;
        canvas.line((area.x - 4.0, y), (area.x, y), 0.7, INK);
        if let Some(label) = &tick.label {
            canvas.text((area.x - 7.0, y), label, &Text::new(10.0, INK).at(Anchor::End, Anchor::Middle));
        }
    }
    let upright = Text::new(10.5, INK).upwards().at(Anchor::Middle, Anchor::Middle);
    canvas.text((area.x - 38.0, area.centre().1), "viewing angle θo, degrees", &upright);
}

fn bars(canvas: &mut Canvas, area: Area, bins: &[f64], most_deg: f64, label: &str) {
    let most = bins.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let wide = area.w / bins.len() as f64;
    for (k, b) in bins.iter().enumerate() {
        let h = area.h * 0.94 * b / most;
        canvas.fill(
            Area::new(area.x + k as f64 * wide, area.bottom() - h, wide, h),
            ColourMap::Viridis.at(0.35),
            1.0,
        );
    }
    canvas.line(
        (area.x, area.bottom() - 0.94 * area.h),
        (area.right(), area.bottom() - 0.94 * area.h),
        0.5,
        FAINT,
    );
    let words = format!(
        "{} % of the light in {} degrees",
        short((1000.0 * most).round() / 10.0),
        short(most_deg / bins.len() as f64)
    );
    canvas.text(
        (area.right() - 4.0, area.bottom() - 0.94 * area.h - 3.0),
        &words,
        &Text::new(9.0, MUTED).at(Anchor::End, Anchor::End),
    );
    frame(canvas, area, most_deg, label);
}

fn frame(canvas: &mut Canvas, area: Area, most_deg: f64, label: &str) {
    let scale = Scale::linear(0.0, most_deg);
    for tick in scale.ticks(6) {
        let x = area.x + scale.fraction(tick.value) * area.w;
        canvas.line((x, area.bottom()), (x, area.bottom() + 4.0), 0.7, INK);
        if let Some(words) = &tick.label {
            canvas.text(
                (x, area.bottom() + 8.0),
                words,
                &Text::new(10.0, INK).at(Anchor::Middle, Anchor::Start),
            );
        }
    }
    canvas.outline(area, 0.8, INK);
    canvas.text(
        (area.centre().0, area.bottom() + 26.0),
        label,
        &Text::new(10.5, INK).at(Anchor::Middle, Anchor::Start),
    );
}
