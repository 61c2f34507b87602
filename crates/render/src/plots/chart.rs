//! A chart of lines and named points: the course of a fit, candidates by cost and error.

use super::axis::{Scale, Tick};
use super::legend::{self, Key};
use super::unfolded::title;
use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::clip::clipped;
use crate::draw::palette::{CATEGORIES, FAINT, INK};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;

/// A chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above the picture; empty for none.
    pub title: String,
    /// Under the horizontal axis.
    pub x_label: String,
    /// Beside the vertical axis.
    pub y_label: String,
    /// Logarithmic axes; values that are not above 0 are left out then.
    pub logarithmic: [bool; 2],
    /// Lines with their words in the legend.
    pub lines: Vec<(String, Vec<(f64, f64)>)>,
    /// Points with their names beside them.
    pub points: Vec<ChartPoint>,
    /// A horizontal line with its word.
    pub bound: Option<(String, f64)>,
}

/// A named point.
#[derive(Clone, Debug, PartialEq)]
pub struct ChartPoint {
    /// Beside the point.
    pub name: String,
    /// Place.
    pub at: (f64, f64),
    /// Filled and coloured.
    pub chosen: bool,
}

impl Chart {
    /// Draws it. Values that are not finite are left out; without any value the frame is empty.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let top = if self.title.is_empty() { 8.0 } else { 32.0 };
        let mut canvas = Canvas::new(700.0, top + 430.0);
        title(&mut canvas, &self.title);
        let area = Area::new(78.0, top + 6.0, 600.0, 340.0);
        let scales = [self.scale(0), self.scale(1)];
        self.frame(&mut canvas, area, scales);
        let place = |p: (f64, f64)| -> At {
            (area.x + scales[0].fraction(p.0) * area.w, area.bottom() - scales[1].fraction(p.1) * area.h)
        };
        if let Some((word, y)) = &self.bound
            && self.drawable((scales_middle(scales[0]), *y))
        {
            let py = place((1.0, *y)).1;
            if py >= area.y && py <= area.bottom() {
                canvas.dashed(&[(area.x, py), (area.right(), py)], 1.0, 4.0, 3.0, INK);
                let style = Text::new(9.0, INK).at(Anchor::End, Anchor::End);
                canvas.text((area.right() - 4.0, py - 3.0), word, &style);
            }
        }
        let mut keys = Vec::new();
        for (k, (name, line)) in self.lines.iter().enumerate() {
            let colour = CATEGORIES[k % CATEGORIES.len()];
            let path: Vec<At> = line.iter().filter(|p| self.drawable(**p)).map(|p| place(*p)).collect();
            for run in clipped(&path, area) {
                canvas.polyline(&run, 1.5, colour);
            }
            keys.push((Key::Line(colour), name.clone()));
        }
        for p in self.points.iter().filter(|p| self.drawable(p.at)) {
            let at = place(p.at);
            if p.chosen {
                canvas.disc(at, 4.0, CATEGORIES[0], 1.0);
            } else {
                canvas.ring(at, 3.0, 1.2, INK);
            }
            let right = at.0 < area.x + 0.7 * area.w;
            let style =
                Text::new(9.0, INK).at(if right { Anchor::Start } else { Anchor::End }, Anchor::Middle);
            canvas.text((at.0 + if right { 7.0 } else { -7.0 }, at.1 - 1.0), &p.name, &style);
        }
        legend::draw(&mut canvas, (area.x, area.bottom() + 52.0), area.w, &keys);
        canvas.finish()
    }

    fn drawable(&self, (x, y): (f64, f64)) -> bool {
        x.is_finite()
            && y.is_finite()
            && (!self.logarithmic[0] || x > 0.0)
            && (!self.logarithmic[1] || y > 0.0)
    }

    fn scale(&self, axis: usize) -> Scale {
        let bound = self.bound.iter().filter(|_| axis == 1).map(|b| b.1);
        let values: Vec<f64> = self
            .lines
            .iter()
            .flat_map(|l| l.1.iter().copied())
            .chain(self.points.iter().map(|p| p.at))
            .filter(|p| self.drawable(*p))
            .map(|p| if axis == 0 { p.0 } else { p.1 })
            .chain(bound)
            .collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.logarithmic[axis] { Scale::log(low, high) } else { Scale::linear(low.min(0.0), high) }
    }

    fn frame(&self, canvas: &mut Canvas, area: Area, scales: [Scale; 2]) {
        let small = Text::new(10.0, INK);
        let inside = |s: Scale, t: &Tick| (-1e-9..=1.0 + 1e-9).contains(&s.fraction(t.value));
        for tick in scales[0].ticks(8).iter().filter(|t| inside(scales[0], t)) {
            let px = area.x + scales[0].fraction(tick.value) * area.w;
            canvas.line((px, area.bottom()), (px, area.bottom() + 3.0), 0.7, INK);
            if let Some(label) = &tick.label {
                canvas.line((px, area.y), (px, area.bottom()), 0.5, FAINT);
                canvas.text((px, area.bottom() + 7.0), label, &small.at(Anchor::Middle, Anchor::Start));
            }
        }
        for tick in scales[1].ticks(7).iter().filter(|t| inside(scales[1], t)) {
            let py = area.bottom() - scales[1].fraction(tick.value) * area.h;
            canvas.line((area.x - 3.0, py), (area.x, py), 0.7, INK);
            if let Some(label) = &tick.label {
                canvas.line((area.x, py), (area.right(), py), 0.5, FAINT);
                canvas.text((area.x - 6.0, py), label, &small.at(Anchor::End, Anchor::Middle));
            }
        }
        canvas.outline(area, 0.8, INK);
        let name = Text::new(10.5, INK);
        canvas.text(
            (area.centre().0, area.bottom() + 24.0),
            &self.x_label,
            &name.at(Anchor::Middle, Anchor::Start),
        );
        canvas.text(
            (16.0, area.centre().1),
            &self.y_label,
            &name.upwards().at(Anchor::Middle, Anchor::Middle),
        );
    }
}

/// A value that every scale can take.
fn scales_middle(s: Scale) -> f64 {
    match s {
        Scale::Linear { low, high } | Scale::Log { low, high } => 0.5 * (low + high),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink(p: &Picture) -> usize {
        p.pixels().iter().filter(|c| **c != [255; 3]).count()
    }

    #[test]
    fn lines_and_points_leave_ink_and_values_without_sense_do_not() {
        let empty = Chart { logarithmic: [true, true], ..Chart::default() };
        let bare = ink(&empty.draw());
        let bad = Chart {
            lines: vec![(String::new(), vec![(f64::NAN, 1.0), (-1.0, 1.0)])],
            points: vec![ChartPoint { name: "x".into(), at: (0.0, 1.0), chosen: true }],
            ..empty.clone()
        };
        // a key without a word is all there is of a line without values
        assert!(ink(&bad.draw()) < bare + 400);
        let good = Chart {
            lines: vec![("a".into(), vec![(1.0, 1.0), (10.0, 100.0)])],
            points: vec![ChartPoint { name: "x".into(), at: (3.0, 10.0), chosen: true }],
            bound: Some(("bound".into(), 30.0)),
            ..empty
        };
        assert!(ink(&good.draw()) > bare + 1000);
    }
}
