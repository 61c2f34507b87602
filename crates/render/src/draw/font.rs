//! The embedded font: DejaVu Sans in two weights (licence beside the files in `fonts/`).

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, Glyph, Point, ScaleFont, point};

/// Weight of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    Regular,
    Bold,
}

static REGULAR: LazyLock<FontRef<'static>> =
    LazyLock::new(|| embedded(include_bytes!("../../fonts/DejaVuSans.ttf")));
static BOLD: LazyLock<FontRef<'static>> =
    LazyLock::new(|| embedded(include_bytes!("../../fonts/DejaVuSans-Bold.ttf")));

fn embedded(bytes: &'static [u8]) -> FontRef<'static> {
    FontRef::try_from_slice(bytes).expect("the font compiled into this library is a TrueType font")
}

pub(crate) fn face(weight: Weight) -> &'static FontRef<'static> {
    match weight {
        Weight::Regular => &REGULAR,
        Weight::Bold => &BOLD,
    }
}

/// Glyphs of one line at size `px` (pixels per em), the baseline's start at the origin, and the line's advance in pixels.
///
/// The subscripts of θᵢ, θₒ and ΔE₀₀ are set as smaller letters below the line: the font's own are too small to read.
pub(crate) fn layout(weight: Weight, px: f32, text: &str) -> (Vec<Glyph>, f32) {
    let font = face(weight);
    // ab_glyph scales by ascent − descent; a point size means the em
    let scale = px * font.height_unscaled() / font.units_per_em().unwrap_or(1000.0);
    let mut x = 0.0;
    let mut glyphs = Vec::new();
    let mut before = None;
    for c in text.chars() {
        let (c, scale, drop) = match subscript(c) {
            Some(letter) => (letter, 0.76 * scale, 0.14 * px),
            None => (c, scale, 0.0),
        };
        let scaled = font.as_scaled(scale);
        let id = font.glyph_id(c);
        if let Some(b) = before {
            x += scaled.kern(b, id);
        }
        glyphs.push(id.with_scale_and_position(scale, point(x, drop)));
        x += scaled.h_advance(id);
        before = Some(id);
    }
    (glyphs, x)
}

const fn subscript(c: char) -> Option<char> {
    match c {
        'ᵢ' => Some('i'),
        'ₒ' => Some('o'),
        '₀' => Some('0'),
        _ => None,
    }
}

/// Outlines of a glyph as line segments in pixels, y down, after turning about the origin by `turn` quarters clockwise.
pub(crate) fn outline(weight: Weight, glyph: &Glyph, turn: u8, mut line: impl FnMut(Point, Point)) {
    let font = face(weight);
    let Some(outline) = font.outline(glyph.id) else { return };
    let k = glyph.scale.y / font.height_unscaled();
    let at = |p: Point| {
        let (x, y) = (glyph.position.x + p.x * k, glyph.position.y - p.y * k);
        match turn % 4 {
            0 => point(x, y),
            1 => point(-y, x),
            2 => point(-x, -y),
            _ => point(y, -x),
        }
    };
    for curve in &outline.curves {
        match curve {
            ab_glyph::OutlineCurve::Line(a, b) => line(at(*a), at(*b)),
            ab_glyph::OutlineCurve::Quad(a, b, c) => {
                let (a, b, c) = (at(*a), at(*b), at(*c));
                bezier(|t| mix(mix(a, b, t), mix(b, c, t), t), &mut line);
            }
            ab_glyph::OutlineCurve::Cubic(a, b, c, d) => {
                let (a, b, c, d) = (at(*a), at(*b), at(*c), at(*d));
                let quad = |p, q, r, t| mix(mix(p, q, t), mix(q, r, t), t);
                bezier(|t| mix(quad(a, b, c, t), quad(b, c, d, t), t), &mut line);
            }
        }
    }
}

fn mix(a: Point, b: Point, t: f32) -> Point {
    point(a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t)
}

/// Letters are a few dozen pixels high: eight chords a curve are finer than a tenth of a pixel.
fn bezier(at: impl Fn(f32) -> Point, line: &mut impl FnMut(Point, Point)) {
    const CHORDS: u8 = 8;
    let mut from = at(0.0);
    for k in 1..=CHORDS {
        let to = at(f32::from(k) / f32::from(CHORDS));
        line(from, to);
        from = to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_the_plots_use_is_in_both_weights() {
        for weight in [Weight::Regular, Weight::Bold] {
            for c in "θφσπαΔ°±−×·–…≤≥⁰¹²³⁴⁵⁶⁷⁸⁹⁻½äöüß√≈".chars()
            {
                assert_ne!(face(weight).glyph_id(c).0, 0, "{c} is missing in {weight:?}");
            }
        }
    }

    #[test]
    fn an_em_is_the_size_asked_for() {
        // the em dash of DejaVu is one em wide
        let (_, advance) = layout(Weight::Regular, 100.0, "—");
        assert!((advance - 100.0).abs() < 0.5, "{advance}");
    }
}
