//! The parts of an uncertainty as bars, the largest first: what to mend first.

use super::axis::{Scale, short};
use super::legend::{self, Key};
use super::unfolded::title;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::{CATEGORIES, FAINT, INK};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;

/// Height of a bar with what is between.
const PITCH: f64 = 24.0;

/// The bars.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BudgetBars {
    /// Above the picture; empty for none.
    pub title: String,
    /// Name, relative standard uncertainty in per cent, whether it is common to many cells.
    pub parts: Vec<(String, f64, bool)>,
    /// All parts together, per cent.
    pub total: f64,
}

impl BudgetBars {
    /// Draws them on a logarithmic scale over three decades below the total; parts that are smaller still leave a name without a bar.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let top = if self.title.is_empty() { 8.0 } else { 32.0 };
        let rows = self.parts.len() + 1;
        let mut canvas = Canvas::new(640.0, top + PITCH * rows as f64 + 78.0);
        title(&mut canvas, &self.title);
        let most = if self.total > 0.0 && self.total.is_finite() { self.total } else { 1.0 };
        // room beside the longest bar for its value
        let scale = Scale::log(most * 1e-3, most * 4.0);
        let area = Area::new(110.0, top, 450.0, PITCH * rows as f64);
        for tick in scale.ticks(6) {
            let x = area.x + scale.fraction(tick.value) * area.w;
            if let (Some(label), true) = (&tick.label, (area.x - 0.5..=area.right() + 0.5).contains(&x)) {
                canvas.line((x, area.y), (x, area.bottom()), 0.5, FAINT);
                let style = Text::new(10.0, INK).at(Anchor::Middle, Anchor::Start);
                canvas.text((x, area.bottom() + 6.0), label, &style);
            }
        }
        let bars = self
            .parts
            .iter()
            .map(|(name, value, common)| (name.as_str(), *value, CATEGORIES[usize::from(*common)]))
            .chain(std::iter::once(("total", self.total, INK)));
        for (k, (name, value, colour)) in bars.enumerate() {
            let y = area.y + PITCH * (k as f64 + 0.5);
            canvas.text((area.x - 8.0, y), name, &Text::new(10.5, INK).at(Anchor::End, Anchor::Middle));
            let length = if value > 0.0 { scale.fraction(value).clamp(0.0, 1.0) * area.w } else { 0.0 };
            if length > 0.0 {
                canvas.fill(Area::new(area.x, y - 0.32 * PITCH, length, 0.64 * PITCH), colour, 1.0);
            }
            let style = Text::new(9.5, INK).at(Anchor::Start, Anchor::Middle);
            canvas.text((area.x + length + 5.0, y), &format!("{} %", short(value)), &style);
        }
        canvas.outline(area, 0.8, INK);
        let keys = [
            (Key::Patch(CATEGORIES[0]), "each cell, or those of the same pixels, by itself".to_owned()),
            (Key::Patch(CATEGORIES[1]), "common to many cells".to_owned()),
        ];
        legend::draw(&mut canvas, (area.x, area.bottom() + 36.0), area.w, &keys);
        canvas.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_part_has_a_longer_bar_and_nonsense_none() {
        let ink = |value: f64| {
            let bars = BudgetBars {
                parts: vec![("shot".into(), value, false)],
                total: 2.0,
                ..BudgetBars::default()
            };
            bars.draw().pixels().iter().filter(|c| **c == CATEGORIES[0]).count()
        };
        assert!(ink(1.0) > ink(0.1) + 1000 && ink(f64::NAN) < ink(0.1));
        assert!(ink(0.0) < ink(0.1));
    }
}
