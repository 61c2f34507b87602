//! The whole measurement in one picture (Sopp, Fig. 4.6): true colours as measured, and brightened.
//!
//! A pixel shows `R = π f` times the panel's factor through the sRGB curve, so that a perfect diffuser is white at × 1.
//! What exceeds 1 is clipped. Cells without a value are hatched.

use gonio_brdf::{Measured, Rgb};
use gonio_optics::colour;

use super::axis::{short, step_down};
use super::cells::{quantile, value};
use super::legend::{self, Key};
use super::strip;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::INK;
use crate::draw::{Anchor, Text};
use crate::picture::{Picture, Srgb};

/// Options of [`unfolded`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unfolded {
    /// Above the picture; empty for none.
    pub title: String,
    /// One panel for each factor; empty for × 1 and a factor that makes the body colour bright ([`brightening`]).
    pub factors: Vec<f64>,
}

/// Colour of f (1/sr) on a display: `π f · factor` through the sRGB curve, clipped.
#[must_use]
pub fn true_colour(f: Rgb, factor: f64) -> Srgb {
    f.map(|v| (colour::srgb_encode(v * std::f64::consts::PI * factor) * 255.0).round() as u8)
}

/// A round factor (1, 2, 5 × 10ⁿ, never below 1) that brings nine tenths of the cells farther than 15° from the mirror
/// direction below four fifths of white. 1 for a table that is black or has no such cells.
#[must_use]
pub fn brightening(m: &Measured) -> f64 {
    let body = (0..m.grid.len()).filter_map(|i| {
        let [ti, to, phi] = m.grid.coordinates(i);
        let g = m.grid.geometry(ti, to, phi);
        if g.theta_o.degrees() > 75.0 || g.theta_i.degrees() > 75.0 || g.from_mirror().degrees() < 15.0 {
            return None;
        }
        value(m, i).map(|f| f.into_iter().fold(0.0, f64::max) * std::f64::consts::PI)
    });
    match quantile(body, 0.9) {
        Some(q) if q > 1e-9 => step_down(0.8 / q).max(1.0),
        _ => 1.0,
    }
}

/// Draws the table unfolded, one panel a factor.
#[must_use]
pub fn unfolded(m: &Measured, options: &Unfolded) -> Picture {
    let factors = if options.factors.is_empty() {
        let k = brightening(m);
        vec![1.0, if k > 1.0 { k } else { 4.0 }]
    } else {
        options.factors.clone()
    };
    const WIDE: f64 = 260.0;
    const BETWEEN: f64 = 22.0;
    let top = if options.title.is_empty() { 4.0 } else { 26.0 };
    let (_, tall) = strip::heights(&m.grid);
    let n = factors.len() as f64;
    let width = strip::LEFT + n * WIDE + (n - 1.0) * BETWEEN + 14.0;
    let mut canvas = Canvas::new(width, top + strip::ABOVE + tall + strip::BELOW + 26.0);
    title(&mut canvas, &options.title);
    for (k, &factor) in factors.iter().enumerate() {
        let x = strip::LEFT + k as f64 * (WIDE + BETWEEN);
        let area = Area::new(x, top + strip::ABOVE, WIDE, tall);
        if k == 0 {
            strip::polar_labels(&mut canvas, area, &m.grid);
        }
        let words =
            if factor == 1.0 { "as it is (× 1)".into() } else { format!("brightened × {}", short(factor)) };
        strip::heading(&mut canvas, area, &words);
        strip::draw(&mut canvas, area, &m.grid, &|i| value(m, i).map(|f| true_colour(f, factor)));
    }
    let y = top + strip::ABOVE + tall + strip::BELOW + 14.0;
    let note = "white: R = πf = 1 (perfect diffuser)".to_owned();
    let mut entries = vec![(Key::Patch([255; 3]), note)];
    if (0..m.grid.len()).any(|i| value(m, i).is_none()) {
        entries.push((Key::Hatched, "no value".into()));
    }
    legend::draw(&mut canvas, (strip::LEFT, y), width - strip::LEFT, &entries);
    canvas.finish()
}

/// The title line that all plots share.
pub(crate) fn title(canvas: &mut Canvas, text: &str) {
    let width = canvas.width() - 28.0;
    let style = Text::new(13.0, INK).bold().at(Anchor::Start, Anchor::End);
    canvas.text_within((14.0, 20.0), text, &style, width);
}
