//! The canvas: shapes and text in points on a picture of two pixels a point.

use ab_glyph::{Point, point};
use ab_glyph_rasterizer::Rasterizer;

use super::font;
pub(crate) use super::shape::{Area, At};
use super::shape::{circle, thick};
use super::text::{Anchor, Text};
use crate::picture::{Picture, Srgb};

/// Pixels per point of the finished picture: sharp on dense screens and in print.
pub(crate) const PIXELS_PER_POINT: f64 = 2.0;

/// Height of capitals of the embedded font, in ems.
const CAP_HEIGHT: f64 = 0.729;

/// A picture being drawn.
pub(crate) struct Canvas {
    picture: Picture,
}

impl Canvas {
    /// A white canvas of the given size in points.
    pub(crate) fn new(width: f64, height: f64) -> Self {
        let px = |points: f64| (points * PIXELS_PER_POINT).round().clamp(1.0, 20_000.0) as u32;
        Self { picture: Picture::new(px(width), px(height), [255; 3]) }
    }

    pub(crate) fn finish(self) -> Picture {
        self.picture
    }

    /// Fills a box.
    pub(crate) fn fill(&mut self, a: Area, colour: Srgb, alpha: f64) {
        self.polygon(
            &[(a.x, a.y), (a.right(), a.y), (a.right(), a.bottom()), (a.x, a.bottom())],
            colour,
            alpha,
        );
    }

    /// Draws the outline of a box, the stroke centred on its edge.
    pub(crate) fn outline(&mut self, a: Area, stroke: f64, colour: Srgb) {
        let h = 0.5 * stroke;
        for edge in [
            Area::new(a.x - h, a.y - h, a.w + stroke, stroke),
            Area::new(a.x - h, a.bottom() - h, a.w + stroke, stroke),
            Area::new(a.x - h, a.y + h, stroke, a.h - stroke),
            Area::new(a.right() - h, a.y + h, stroke, a.h - stroke),
        ] {
            self.fill(edge, colour, 1.0);
        }
    }

    /// Fills a closed polygon.
    pub(crate) fn polygon(&mut self, corners: &[At], colour: Srgb, alpha: f64) {
        self.cover(&[corners.to_vec()], colour, alpha);
    }

    /// Fills a disc.
    pub(crate) fn disc(&mut self, centre: At, radius: f64, colour: Srgb, alpha: f64) {
        self.polygon(&circle(centre, radius), colour, alpha);
    }

    /// Draws a circle, the stroke centred on it.
    pub(crate) fn ring(&mut self, centre: At, radius: f64, stroke: f64, colour: Srgb) {
        let mut inner = circle(centre, (radius - 0.5 * stroke).max(0.0));
        inner.reverse();
        self.cover(&[circle(centre, radius + 0.5 * stroke), inner], colour, 1.0);
    }

    /// Draws a line.
    pub(crate) fn line(&mut self, a: At, b: At, stroke: f64, colour: Srgb) {
        self.polyline(&[a, b], stroke, colour);
    }

    /// Draws a chain of lines with round joints.
    pub(crate) fn polyline(&mut self, points: &[At], stroke: f64, colour: Srgb) {
        let mut shapes = Vec::new();
        let half = 0.5 * stroke;
        for w in points.windows(2) {
            if let [a, b] = *w
                && let Some(quad) = thick(a, b, half)
            {
                shapes.push(quad);
            }
        }
        if stroke > 1.0 {
            for &p in points.iter().skip(1).take(points.len().saturating_sub(2)) {
                shapes.push(circle(p, half));
            }
        }
        self.cover(&shapes, colour, 1.0);
    }

    /// Draws a dashed chain: `dash` points on, `gap` points off, the pattern running around corners.
    pub(crate) fn dashed(&mut self, points: &[At], stroke: f64, dash: f64, gap: f64, colour: Srgb) {
        let mut shapes = Vec::new();
        let period = (dash + gap).max(0.1);
        let mut along = 0.0;
        for w in points.windows(2) {
            let [a, b] = *w else { continue };
            let length = (b.0 - a.0).hypot(b.1 - a.1);
            if !(length > 0.0 && length < 1e5) {
                continue;
            }
            let at = |s: f64| (a.0 + (b.0 - a.0) * s / length, a.1 + (b.1 - a.1) * s / length);
            let mut start = -(along % period);
            while start < length {
                let (from, to) = (start.max(0.0), (start + dash).min(length));
                if to > from
                    && let Some(quad) = thick(at(from), at(to), 0.5 * stroke)
                {
                    shapes.push(quad);
                }
                start += period;
            }
            along += length;
        }
        self.cover(&shapes, colour, 1.0);
    }

    /// Colours the pixels of a box from a function of the place inside it, (0, 0) upper left to (1, 1) lower right;
    /// `None` leaves the canvas. Each pixel takes `samples`² tries and blends what they say.
    pub(crate) fn paint(&mut self, a: Area, samples: u32, colour: impl Fn(f64, f64) -> Option<Srgb>) {
        let k = PIXELS_PER_POINT;
        let range = |from: f64, to: f64, limit: u32| {
            let low = (from * k).floor().clamp(0.0, f64::from(limit)) as u32;
            low..((to * k).ceil().clamp(0.0, f64::from(limit)) as u32)
        };
        let n = samples.max(1);
        for y in range(a.y, a.bottom(), self.picture.height()) {
            for x in range(a.x, a.right(), self.picture.width()) {
                let (mut sum, mut hits) = ([0u32; 3], 0u32);
                for s in 0..n * n {
                    let fx = (f64::from(s % n) + 0.5) / f64::from(n);
                    let fy = (f64::from(s / n) + 0.5) / f64::from(n);
                    let u = ((f64::from(x) + fx) / k - a.x) / a.w;
                    let v = ((f64::from(y) + fy) / k - a.y) / a.h;
                    if (0.0..1.0).contains(&u)
                        && (0.0..1.0).contains(&v)
                        && let Some(c) = colour(u, v)
                    {
                        hits += 1;
                        for (t, c) in sum.iter_mut().zip(c) {
                            *t += u32::from(c);
                        }
                    }
                }
                if hits > 0 {
                    let mean = sum.map(|t| ((t + hits / 2) / hits) as u8);
                    self.picture.blend(x, y, mean, hits as f32 / (n * n) as f32);
                }
            }
        }
    }

    /// Copies a picture pixel by pixel, its upper left corner at `at`.
    pub(crate) fn place(&mut self, at: At, picture: &Picture) {
        let (ox, oy) = ((at.0 * PIXELS_PER_POINT).round() as i64, (at.1 * PIXELS_PER_POINT).round() as i64);
        for y in 0..picture.height() {
            for x in 0..picture.width() {
                let (tx, ty) = (ox + i64::from(x), oy + i64::from(y));
                if let (Ok(tx), Ok(ty), Some(c)) = (u32::try_from(tx), u32::try_from(ty), picture.get(x, y)) {
                    self.picture.set(tx, ty, c);
                }
            }
        }
    }

    /// Width of a line of text in points.
    pub(crate) fn text_width(text: &str, style: &Text) -> f64 {
        f64::from(font::layout(style.weight, (style.size * PIXELS_PER_POINT) as f32, text).1)
            / PIXELS_PER_POINT
    }

    /// Writes one line of text within a width: smaller where it is too long, down to three quarters, then cut with "…".
    pub(crate) fn text_within(&mut self, at: At, text: &str, style: &Text, width: f64) {
        let long = Self::text_width(text, style);
        if long <= width {
            return self.text(at, text, style);
        }
        let style = Text { size: style.size * (width / long).max(0.75), ..*style };
        let mut kept = text.to_owned();
        while Self::text_width(&kept, &style) > width * 1.001 && kept.chars().count() > 1 {
            kept = kept.chars().take(kept.chars().count() - 2).chain(['…']).collect();
        }
        self.text(at, &kept, &style);
    }

    /// Width of the canvas in points.
    pub(crate) fn width(&self) -> f64 {
        f64::from(self.picture.width()) / PIXELS_PER_POINT
    }

    /// Writes one line of text.
    pub(crate) fn text(&mut self, at: At, text: &str, style: &Text) {
        let px = style.size * PIXELS_PER_POINT;
        let (glyphs, advance) = font::layout(style.weight, px as f32, text);
        let shift = match style.along {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5 * advance,
            Anchor::End => -advance,
        };
        let drop = (CAP_HEIGHT * px) as f32
            * match style.across {
                Anchor::Start => 1.0,
                Anchor::Middle => 0.5,
                Anchor::End => 0.0,
            };
        let origin = point((at.0 * PIXELS_PER_POINT) as f32, (at.1 * PIXELS_PER_POINT) as f32);
        let mut lines = Vec::new();
        for mut g in glyphs {
            g.position.x += shift;
            g.position.y += drop;
            font::outline(style.weight, &g, style.turn, |a, b| {
                lines.push((point(a.x + origin.x, a.y + origin.y), point(b.x + origin.x, b.y + origin.y)));
            });
        }
        self.cover_lines(&lines, style.colour, 1.0);
    }

    /// Covers closed shapes given in points; overlaps count once.
    fn cover(&mut self, shapes: &[Vec<At>], colour: Srgb, alpha: f64) {
        let px = |p: At| point((p.0 * PIXELS_PER_POINT) as f32, (p.1 * PIXELS_PER_POINT) as f32);
        let mut lines = Vec::new();
        for shape in shapes {
            if let (Some(&first), Some(&last)) = (shape.first(), shape.last()) {
                lines.extend(shape.windows(2).filter_map(|w| Some((px(*w.first()?), px(*w.get(1)?)))));
                lines.push((px(last), px(first)));
            }
        }
        self.cover_lines(&lines, colour, alpha);
    }

    /// Blends what closed outlines (pixels) cover. Outlines beyond the canvas are bounded first, so a wild coordinate costs nothing.
    fn cover_lines(&mut self, lines: &[(Point, Point)], colour: Srgb, alpha: f64) {
        let (w, h) = (self.picture.width() as f32, self.picture.height() as f32);
        if lines.iter().any(|(a, b)| ![a.x, a.y, b.x, b.y].iter().all(|v| v.is_finite())) {
            return;
        }
        let bound = |p: Point| point(p.x.clamp(-8.0, w + 8.0), p.y.clamp(-8.0, h + 8.0));
        let (mut low, mut high) = (point(f32::MAX, f32::MAX), point(f32::MIN, f32::MIN));
        let bounded: Vec<_> = lines.iter().map(|&(a, b)| (bound(a), bound(b))).collect();
        for p in bounded.iter().flat_map(|&(a, b)| [a, b]) {
            low = point(low.x.min(p.x), low.y.min(p.y));
            high = point(high.x.max(p.x), high.y.max(p.y));
        }
        if low.x >= high.x || low.y >= high.y {
            return;
        }
        let (ox, oy) = (low.x.floor(), low.y.floor());
        let size = ((high.x - ox).ceil() as usize + 2, (high.y - oy).ceil() as usize + 1);
        let mut raster = Rasterizer::new(size.0, size.1);
        for (a, b) in bounded {
            raster.draw_line(point(a.x - ox, a.y - oy), point(b.x - ox, b.y - oy));
        }
        raster.for_each_pixel_2d(|x, y, coverage| {
            let (x, y) = (ox as i64 + i64::from(x), oy as i64 + i64::from(y));
            if coverage > 1e-3
                && let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
            {
                self.picture.blend(x, y, colour, coverage.min(1.0) * alpha as f32);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_covered_pixels_are_half_dark() {
        let mut c = Canvas::new(10.0, 10.0);
        c.fill(Area::new(1.0, 1.0, 2.25, 3.0), [0; 3], 1.0);
        let p = c.finish();
        assert_eq!(p.get(2, 2), Some([0; 3]));
        assert_eq!(p.get(6, 3), Some([128; 3]));
        assert_eq!(p.get(7, 3), Some([255; 3]));
        assert_eq!(p.get(1, 3), Some([255; 3]));
    }

    #[test]
    fn joints_of_a_chain_count_once() {
        let mut c = Canvas::new(20.0, 20.0);
        c.polyline(&[(4.0, 4.0), (10.0, 4.0), (10.0, 12.0), (4.0, 12.0)], 4.0, [10, 20, 30]);
        let p = c.finish();
        for (x, y) in [(12, 8), (20, 8), (20, 16), (20, 24), (12, 24)] {
            assert_eq!(p.get(x, y), Some([10, 20, 30]), "{x} {y}");
        }
    }

    #[test]
    fn wild_coordinates_neither_panic_nor_hang() {
        let mut c = Canvas::new(20.0, 20.0);
        c.line((f64::NAN, 3.0), (5.0, 5.0), 1.0, [0; 3]);
        c.line((-1e30, 3.0), (1e30, 5.0), 1.0, [0; 3]);
        c.disc((1e9, 1e9), 1e6, [0; 3], 1.0);
        c.dashed(&[(0.0, 0.0), (f64::INFINITY, 1.0)], 1.0, 2.0, 2.0, [0; 3]);
        assert_eq!(c.finish().get(0, 0), Some([255; 3]));
    }

    #[test]
    fn a_text_too_long_for_its_place_is_cut_not_run_over() {
        let style = Text::new(12.0, [0; 3]);
        let mut c = Canvas::new(200.0, 20.0);
        c.text_within((5.0, 10.0), &"a title without an end ".repeat(9), &style, 100.0);
        let p = c.finish();
        let dark = |x: u32| (0..40).any(|y| p.get(x, y).is_some_and(|c| c[0] < 128));
        assert!((10..200).any(dark) && !(212..400).any(dark));
    }

    #[test]
    fn text_stands_where_its_anchor_says() {
        let mut c = Canvas::new(60.0, 30.0);
        let style = Text::new(12.0, [0; 3]).at(Anchor::End, Anchor::Middle);
        c.text((50.0, 15.0), "HI", &style);
        let p = c.finish();
        let dark: Vec<(u32, u32)> = (0..60 * 2)
            .flat_map(|x| (0..30 * 2).map(move |y| (x, y)))
            .filter(|&(x, y)| p.get(x, y).is_some_and(|c| c[0] < 128))
            .collect();
        let (left, right) =
            (dark.iter().map(|d| d.0).min().unwrap(), dark.iter().map(|d| d.0).max().unwrap());
        let (top, bottom) =
            (dark.iter().map(|d| d.1).min().unwrap(), dark.iter().map(|d| d.1).max().unwrap());
        assert!((95..=100).contains(&right) && left > 60, "{left} {right}");
        // capitals are 0.729 em high and centred on the line
        assert!((f64::from(bottom - top + 1) - 0.729 * 24.0).abs() < 1.6, "{top} {bottom}");
        assert!((f64::from(top + bottom) * 0.5 - 29.5).abs() < 1.0, "{top} {bottom}");
    }
}
