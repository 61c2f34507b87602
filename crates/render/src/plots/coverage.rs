//! Coverage: what is known of every cell.

use gonio_brdf::{Flag, Measured};

use super::legend::{self, Key};
use super::polar;
use super::unfolded::title;
use crate::draw::canvas::Canvas;
use crate::picture::{Picture, Srgb};

const MEASURED: Srgb = [0x00, 0x72, 0xb2];
const FILLED: Srgb = [0x56, 0xb4, 0xe9];
const EXTRAPOLATED: Srgb = [0xe6, 0x9f, 0x00];

/// Draws one hemisphere of flags for each angle of incidence, with the share of every flag in the legend. An empty title leaves no room.
#[must_use]
pub fn coverage(m: &Measured, heading: &str) -> Picture {
    let top = if heading.is_empty() { 4.0 } else { 28.0 };
    let tall = polar::height(&m.grid);
    let mut canvas = Canvas::new(polar::WIDTH, top + tall + 58.0);
    title(&mut canvas, heading);
    polar::draw(&mut canvas, top, &m.grid, &|i| match m.flag.get(i)? {
        Flag::Measured => Some(MEASURED),
        Flag::Filled => Some(FILLED),
        Flag::Extrapolated => Some(EXTRAPOLATED),
        Flag::Invalid => None,
    });
    polar::explain(&mut canvas, top + tall + 18.0, &m.grid);
    let entries = [
        (Key::Patch(MEASURED), "measured", Flag::Measured),
        (Key::Patch(FILLED), "filled", Flag::Filled),
        (Key::Patch(EXTRAPOLATED), "extrapolated", Flag::Extrapolated),
        (Key::Hatched, "no value", Flag::Invalid),
    ]
    .map(|(key, words, flag)| (key, format!("{words} {:.1} %", 100.0 * share(m, flag))));
    legend::draw(&mut canvas, (20.0, top + tall + 40.0), polar::WIDTH - 30.0, &entries);
    canvas.finish()
}

/// Share of the cells (0…1, by number) that carry a flag.
#[must_use]
pub fn share(m: &Measured, flag: Flag) -> f64 {
    m.flag.iter().filter(|f| **f == flag).count() as f64 / m.flag.len().max(1) as f64
}
