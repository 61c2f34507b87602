//! Spots on the sensor with what a fit left over: an arrow from where each was predicted to where it was seen, many times too long.

use super::axis::{Scale, short};
use super::legend::{self, Key};
use super::unfolded::title;
use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::palette::{CATEGORIES, FAINT, INK};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;

/// One observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotMark {
    /// Where it was seen: column, row, pixels.
    pub at_px: [f64; 2],
    /// Seen less predicted, pixels.
    pub off_px: [f64; 2],
    /// Which group of [`SpotPlot::groups`].
    pub group: usize,
    /// Thrown out of the fit.
    pub rejected: bool,
}

/// The plot.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotPlot {
    /// Above the picture; empty for none.
    pub title: String,
    /// Columns and rows of the sensor.
    pub size_px: [u32; 2],
    /// Names of the groups.
    pub groups: Vec<String>,
    /// The observations; those whose numbers are not finite are left out.
    pub marks: Vec<SpotMark>,
}

impl SpotPlot {
    /// Draws it; rows run downwards as in the camera's pictures.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let top = if self.title.is_empty() { 8.0 } else { 32.0 };
        let [columns, rows] = self.size_px.map(|n| f64::from(n.max(1)));
        let wide = 640.0;
        let high = (wide * rows / columns).clamp(80.0, 1200.0);
        let mut canvas = Canvas::new(wide + 78.0, top + high + 92.0);
        title(&mut canvas, &self.title);
        let area = Area::new(58.0, top + 6.0, wide, high);
        for (scale, vertical) in [(Scale::linear(0.0, columns), false), (Scale::linear(0.0, rows), true)] {
            for tick in scale.ticks(7) {
                let f = scale.fraction(tick.value);
                let Some(label) = &tick.label else { continue };
                let style = Text::new(10.0, INK);
                if vertical {
                    let y = area.y + f * area.h;
                    canvas.line((area.x, y), (area.right(), y), 0.5, FAINT);
                    canvas.text((area.x - 6.0, y), label, &style.at(Anchor::End, Anchor::Middle));
                } else {
                    let x = area.x + f * area.w;
                    canvas.line((x, area.y), (x, area.bottom()), 0.5, FAINT);
                    canvas.text((x, area.bottom() + 7.0), label, &style.at(Anchor::Middle, Anchor::Start));
                }
            }
        }
        canvas.outline(area, 0.8, INK);
        let finite = |m: &&SpotMark| m.at_px.iter().chain(&m.off_px).all(|v| v.is_finite());
        let marks: Vec<&SpotMark> = self.marks.iter().filter(finite).collect();
        // the 90th percentile of those used becomes 24 points long
        let mut sizes: Vec<f64> =
            marks.iter().filter(|m| !m.rejected).map(|m| m.off_px[0].hypot(m.off_px[1])).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let typical = sizes.get(sizes.len() * 9 / 10).copied().unwrap_or(1.0).max(1e-6);
        let points_per_px = 24.0 / typical;
        let place = |p: [f64; 2]| -> At { (area.x + p[0] / columns * area.w, area.y + p[1] / rows * area.h) };
        for m in &marks {
            let colour = CATEGORIES[m.group % CATEGORIES.len()];
            let at = place(m.at_px);
            if m.rejected {
                legend::cross(&mut canvas, at, 4.0, INK);
                continue;
            }
            canvas.disc(at, 1.8, colour, 1.0);
            let tip = (at.0 + m.off_px[0] * points_per_px, at.1 + m.off_px[1] * points_per_px);
            arrow(&mut canvas, at, tip, colour);
        }
        let mut keys: Vec<(Key, String)> = self
            .groups
            .iter()
            .enumerate()
            .map(|(k, name)| (Key::Dot(CATEGORIES[k % CATEGORIES.len()]), name.clone()))
            .collect();
        if marks.iter().any(|m| m.rejected) {
            keys.push((Key::Cross(INK), "thrown out".to_owned()));
        }
        let scale = 10f64.powf(typical.log10().floor());
        let y = area.bottom() + 36.0;
        let key = (area.x, y);
        arrow(&mut canvas, key, (area.x + scale * points_per_px, y), INK);
        let words = format!("seen less predicted, {} px; axes: column and row, px", short(scale));
        let style = Text::new(10.0, INK).at(Anchor::Start, Anchor::Middle);
        canvas.text((area.x + scale * points_per_px + 8.0, y), &words, &style);
        legend::draw(&mut canvas, (area.x, y + 22.0), area.w, &keys);
        canvas.finish()
    }
}

fn arrow(canvas: &mut Canvas, from: At, to: At, colour: crate::picture::Srgb) {
    canvas.line(from, to, 1.0, colour);
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = dx.hypot(dy);
    if length < 3.0 {
        return;
    }
    let (ux, uy) = (dx / length, dy / length);
    for side in [-1.0, 1.0] {
        let tail = (to.0 - 4.0 * ux - 2.0 * side * uy, to.1 - 4.0 * uy + 2.0 * side * ux);
        canvas.line(to, tail, 1.0, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spots_leave_ink_and_what_is_not_a_number_does_not() {
        let mark = |x: f64| SpotMark { at_px: [x, 300.0], off_px: [0.02, -0.01], group: 0, rejected: false };
        let plot = |marks| SpotPlot {
            title: String::new(),
            size_px: [1280, 1024],
            groups: vec!["wedge".to_owned()],
            marks,
        };
        let ink = |p: &SpotPlot| p.draw().pixels().iter().filter(|c| **c == CATEGORIES[0]).count();
        let none = ink(&plot(vec![mark(f64::NAN)]));
        assert!(ink(&plot(vec![mark(200.0), mark(900.0)])) > none + 10);
    }
}
