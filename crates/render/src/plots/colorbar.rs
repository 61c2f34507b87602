//! A colour bar: what the colours of a map mean.

use super::axis::{Scale, minus};
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::{ColourMap, INK};
use crate::draw::{Anchor, Text};

/// A colour map with its scale, label and whether values beyond the ends exist (drawn as pointed ends).
#[derive(Clone, Debug)]
pub(crate) struct ColourBar {
    pub map: ColourMap,
    pub scale: Scale,
    pub label: String,
    pub beyond: [bool; 2],
}

impl ColourBar {
    pub(crate) fn colour(&self, value: f64) -> [u8; 3] {
        self.map.at(self.scale.fraction(value))
    }

    /// Draws the bar lying in `area`, ticks below it, the label below those; it takes about 30 points more below.
    pub(crate) fn draw_lying(&self, canvas: &mut Canvas, area: Area) {
        canvas.paint(area, 1, |u, _| Some(self.map.at(u)));
        let tip = 0.5 * area.h;
        if self.beyond[0] {
            let (x, y) = (area.x, area.y);
            canvas.polygon(&[(x, y), (x, y + area.h), (x - tip, y + tip)], self.map.at(0.0), 1.0);
        }
        if self.beyond[1] {
            let (x, y) = (area.right(), area.y);
            canvas.polygon(&[(x, y), (x + tip, y + tip), (x, y + area.h)], self.map.at(1.0), 1.0);
        }
        canvas.outline(area, 0.6, INK);
        let style = Text::new(9.0, INK).at(Anchor::Middle, Anchor::Start);
        let room = (area.w / 34.0).max(2.0) as usize;
        for tick in self.scale.ticks(room) {
            let f = self.scale.fraction(tick.value);
            if !(-1e-9..=1.0 + 1e-9).contains(&f) {
                continue;
            }
            let x = area.x + f * area.w;
            let length = if tick.label.is_some() { 3.5 } else { 2.0 };
            canvas.line((x, area.bottom()), (x, area.bottom() + length), 0.6, INK);
            if let Some(label) = &tick.label {
                canvas.text((x, area.bottom() + 6.0), label, &style);
            }
        }
        canvas.text(
            (area.centre().0, area.bottom() + 20.0),
            &minus(&self.label),
            &Text { size: 10.0, ..style },
        );
    }
}
