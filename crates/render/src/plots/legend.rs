//! Legends: a row of keys with their words, wrapped to a width.

use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::palette::{HATCH, INK};
use crate::draw::{Anchor, Text};
use crate::picture::Srgb;

/// What a key looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Key {
    Patch(Srgb),
    Hatched,
    Line(Srgb),
    Dashed(Srgb),
    Dot(Srgb),
    Circle(Srgb),
    Cross(Srgb),
    Triangle(Srgb),
}

/// Height of one row.
pub(crate) const ROW: f64 = 16.0;
const KEY: f64 = 16.0;
const GAP: f64 = 16.0;

/// Draws the keys from `at` (middle of the first row, left) within `width`; returns the height taken.
pub(crate) fn draw(canvas: &mut Canvas, at: At, width: f64, entries: &[(Key, String)]) -> f64 {
    let style = Text::new(9.5, INK).at(Anchor::Start, Anchor::Middle);
    let (mut x, mut y) = at;
    for (key, words) in entries {
        let wide = KEY + 5.0 + Canvas::text_width(words, &style);
        if x > at.0 && x + wide > at.0 + width {
            (x, y) = (at.0, y + ROW);
        }
        draw_key(canvas, *key, (x, y));
        canvas.text_within((x + KEY + 5.0, y), words, &style, width - KEY - 5.0);
        x += wide + GAP;
    }
    y + ROW - at.1
}

fn draw_key(canvas: &mut Canvas, key: Key, (x, y): At) {
    let middle = (x + 0.5 * KEY, y);
    match key {
        Key::Patch(c) => {
            let patch = Area::new(x + 2.0, y - 5.0, 12.0, 10.0);
            canvas.fill(patch, c, 1.0);
            if c.iter().all(|v| *v > 0xe0) {
                canvas.outline(patch, 0.6, INK);
            }
        }
        Key::Hatched => {
            canvas.paint(Area::new(x + 2.0, y - 5.0, 12.0, 10.0), 3, |u, v| Some(hatch(u * 12.0, v * 10.0)));
        }
        Key::Line(c) => canvas.line((x, y), (x + KEY, y), 1.6, c),
        Key::Dashed(c) => canvas.dashed(&[(x, y), (x + KEY, y)], 1.4, 4.0, 2.5, c),
        Key::Dot(c) => canvas.disc(middle, 2.4, c, 1.0),
        Key::Circle(c) => canvas.ring(middle, 2.4, 1.0, c),
        Key::Cross(c) => cross(canvas, middle, 2.4, c),
        Key::Triangle(c) => {
            let (x, y) = middle;
            canvas.polygon(&[(x - 4.0, y - 3.5), (x + 4.0, y - 3.5), (x, y + 3.5)], c, 1.0);
        }
    }
}

/// A diagonal cross.
pub(crate) fn cross(canvas: &mut Canvas, (x, y): At, r: f64, c: Srgb) {
    canvas.line((x - r, y - r), (x + r, y + r), 1.0, c);
    canvas.line((x - r, y + r), (x + r, y - r), 1.0, c);
}

/// The hatching for "no value" at a place given in points.
pub(crate) fn hatch(x: f64, y: f64) -> Srgb {
    HATCH[usize::from((x + y).rem_euclid(3.6) < 1.1)]
}
