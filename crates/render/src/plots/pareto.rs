//! The trade as a picture: error over cost, size as the area of the mark, and the front that nothing else beats.

use super::axis::{Scale, short};
use super::legend::{self, Key};
use super::unfolded::title;
use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::palette::{CATEGORIES, FAINT, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;

/// One candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct ParetoPoint {
    /// Its name, written beside the mark.
    pub name: String,
    /// Across: cost, above 0.
    pub cost: f64,
    /// Up: error, above 0 (smaller values are drawn at the lower edge).
    pub error: f64,
    /// Size in bytes.
    pub bytes: usize,
    /// Whether it stands on the front.
    pub on_front: bool,
    /// Colour group, such as tables, maps, models: an index into the names of [`Pareto::groups`].
    pub group: usize,
}

/// The plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Pareto {
    /// Above the picture; empty for none.
    pub title: String,
    /// What runs across.
    pub cost_label: String,
    /// What runs up.
    pub error_label: String,
    /// Names of the colour groups.
    pub groups: Vec<String>,
    /// The candidates; those whose numbers are not above 0 and finite are left out.
    pub points: Vec<ParetoPoint>,
}

/// Radius of a mark: its area grows with the logarithm of the size.
fn radius(bytes: usize) -> f64 {
    2.6 + 1.9 * (bytes.max(1) as f64 / 30.0).log10().max(0.0)
}

impl Pareto {
    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let points: Vec<&ParetoPoint> = self
            .points
            .iter()
            .filter(|p| p.cost > 0.0 && p.cost.is_finite() && p.error >= 0.0 && p.error.is_finite())
            .collect();
        let span = |of: fn(&ParetoPoint) -> f64, least: f64| {
            let low = points.iter().map(|p| of(p).max(least)).fold(f64::INFINITY, f64::min);
            let high = points.iter().map(|p| of(p).max(least)).fold(least, f64::max);
            if low.is_finite() { (low, high) } else { (least, 10.0 * least) }
        };
        let (x_span, y_span) = (span(|p| p.cost, 1e-3), span(|p| p.error, 1e-3));
        // room for names beside the outermost marks
        let scale = [Scale::log(x_span.0 * 0.8, x_span.1 * 1.6), Scale::log(y_span.0 * 0.8, y_span.1 * 1.25)];
        let top = if self.title.is_empty() { 14.0 } else { 40.0 };
        let area = Area::new(72.0, top, 600.0, 400.0);
        let mut canvas = Canvas::new(area.right() + 24.0, area.bottom() + 104.0);
        title(&mut canvas, &self.title);
        self.frame(&mut canvas, area, scale);
        let place = |p: &ParetoPoint| -> At {
            let error = p.error.max(1e-3);
            (area.x + scale[0].fraction(p.cost) * area.w, area.bottom() - scale[1].fraction(error) * area.h)
        };
        let front = front_line(area, &points, &place);
        canvas.polyline(&front, 1.3, INK);
        let mut order: Vec<&&ParetoPoint> = points.iter().collect();
        order.sort_by_key(|p| std::cmp::Reverse(p.bytes));
        for p in order {
            let colour = CATEGORIES[p.group % CATEGORIES.len()];
            let (at, r) = (place(p), radius(p.bytes));
            canvas.disc(at, r + 0.9, [255; 3], 1.0);
            canvas.disc(at, r, colour, if p.on_front { 1.0 } else { 0.55 });
        }
        names(&mut canvas, area, &points, &front, &place);
        let mut entries: Vec<(Key, String)> = self
            .groups
            .iter()
            .enumerate()
            .map(|(k, name)| (Key::Patch(CATEGORIES[k % CATEGORIES.len()]), name.clone()))
            .collect();
        entries.push((Key::Line(INK), "front: nothing else is both faster and closer".to_owned()));
        let used = legend::draw(&mut canvas, (area.x, area.bottom() + 54.0), area.w, &entries);
        sizes(&mut canvas, (area.x, area.bottom() + 60.0 + used));
        canvas.finish()
    }

    fn frame(&self, canvas: &mut Canvas, area: Area, scale: [Scale; 2]) {
        let small = Text::new(10.0, INK);
        for tick in scale[0].ticks(8) {
            let f = scale[0].fraction(tick.value);
            if !(-1e-9..=1.0 + 1e-9).contains(&f) {
                continue;
            }
            let x = area.x + f * area.w;
            canvas.line(
                (x, area.bottom()),
                (x, area.bottom() + if tick.label.is_some() { 4.0 } else { 2.0 }),
                0.7,
                INK,
            );
            if let Some(label) = &tick.label {
                canvas.line((x, area.y), (x, area.bottom()), 0.5, FAINT);
                canvas.text((x, area.bottom() + 8.0), label, &small.at(Anchor::Middle, Anchor::Start));
            }
        }
        for tick in scale[1].ticks(8) {
            let f = scale[1].fraction(tick.value);
            if !(-1e-9..=1.0 + 1e-9).contains(&f) {
                continue;
            }
            let y = area.bottom() - f * area.h;
            canvas.line((area.x - if tick.label.is_some() { 4.0 } else { 2.0 }, y), (area.x, y), 0.7, INK);
            if let Some(label) = &tick.label {
                canvas.line((area.x, y), (area.right(), y), 0.5, FAINT);
                canvas.text((area.x - 7.0, y), label, &small.at(Anchor::End, Anchor::Middle));
            }
        }
        canvas.outline(area, 0.8, INK);
        let name = Text::new(10.5, INK).at(Anchor::Middle, Anchor::Start);
        canvas.text((area.centre().0, area.bottom() + 24.0), &self.cost_label, &name);
        let upright = Text::new(10.5, INK).upwards().at(Anchor::Middle, Anchor::Middle);
        canvas.text((20.0, area.centre().1), &self.error_label, &upright);
    }
}

/// The staircase over the front: what can be had at most for a cost.
fn front_line(area: Area, points: &[&ParetoPoint], place: &dyn Fn(&ParetoPoint) -> At) -> Vec<At> {
    let mut front: Vec<At> = points.iter().filter(|p| p.on_front).map(|p| place(p)).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut line = Vec::new();
    for (k, &(x, y)) in front.iter().enumerate() {
        let before = if k == 0 { area.y } else { front[k - 1].1 };
        line.push((x, before));
        line.push((x, y));
    }
    if let Some(last) = front.last() {
        line.push((area.right(), last.1));
    }
    line
}

/// Names beside their marks, each at the first of some places that is still free; where none is, marks off the front stay without.
fn names(
    canvas: &mut Canvas,
    area: Area,
    points: &[&ParetoPoint],
    front: &[At],
    place: &dyn Fn(&ParetoPoint) -> At,
) {
    let mut taken: Vec<Area> = points
        .iter()
        .map(|p| {
            let ((x, y), r) = (place(p), radius(p.bytes));
            Area::new(x - r, y - r, 2.0 * r, 2.0 * r)
        })
        .collect();
    taken.extend(front.windows(2).map(|w| {
        let (low, high) =
            ((w[0].0.min(w[1].0), w[0].1.min(w[1].1)), (w[0].0.max(w[1].0), w[0].1.max(w[1].1)));
        Area::new(low.0 - 1.0, low.1 - 1.0, high.0 - low.0 + 2.0, high.1 - low.1 + 2.0)
    }));
    let overlaps =
        |a: Area, b: Area| a.x < b.right() && b.x < a.right() && a.y < b.bottom() && b.y < a.bottom();
    let mut order: Vec<&&ParetoPoint> = points.iter().collect();
    order.sort_by_key(|p| std::cmp::Reverse(p.on_front));
    for p in order {
        let style = Text::new(9.5, if p.on_front { INK } else { MUTED });
        let style = if p.on_front { style.bold() } else { style };
        let (wide, high) = (Canvas::text_width(&p.name, &style), 11.0);
        let ((x, y), r) = (place(p), radius(p.bytes) + 3.0);
        let far = r + 12.0;
        let places = [
            (x + r, y - 0.5 * high),
            (x - r - wide, y - 0.5 * high),
            (x - 0.5 * wide, y - r - high),
            (x - 0.5 * wide, y + r),
            (x + r, y - r - high),
            (x + r, y + r),
            (x - r - wide, y - r - high),
            (x - r - wide, y + r),
            (x + r, y - far - high),
            (x + r, y + far),
            (x - r - wide, y - far - high),
            (x - r - wide, y + far),
        ];
        let boxed = |(x, y): At| Area::new(x, y, wide, high);
        let fits = |a: &Area| {
            a.x > area.x
                && a.right() < area.right()
                && a.y > area.y
                && a.bottom() < area.bottom()
                && !taken.iter().any(|t| overlaps(*t, *a))
        };
        let Some(chosen) = places.into_iter().map(boxed).find(fits).or(p.on_front.then(|| boxed(places[0])))
        else {
            continue;
        };
        taken.push(chosen);
        canvas.text((chosen.x, chosen.centre().1), &p.name, &style.at(Anchor::Start, Anchor::Middle));
    }
}

/// What the sizes of the marks mean.
fn sizes(canvas: &mut Canvas, (x, y): At) {
    let style = Text::new(9.5, INK).at(Anchor::Start, Anchor::Middle);
    let mut x = x + 8.0;
    for (bytes, words) in [(30, "30 bytes"), (3_000, "3 kB"), (300_000, "300 kB")] {
        canvas.disc((x, y), radius(bytes), MUTED, 0.7);
        canvas.text((x + radius(bytes) + 4.0, y), words, &style);
        x += radius(bytes) + Canvas::text_width(words, &style) + 30.0;
    }
}

/// A number of bytes for people.
#[must_use]
pub fn size_in_words(bytes: usize) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{} kB", short(bytes as f64 / 1e3)),
        _ => format!("{} MB", short(bytes as f64 / 1e6)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(name: &str, cost: f64, error: f64, on_front: bool) -> ParetoPoint {
        ParetoPoint { name: name.to_owned(), cost, error, bytes: 1000, on_front, group: 0 }
    }

    #[test]
    fn marks_stand_where_their_numbers_say_and_odd_numbers_are_no_trouble() {
        let plot = Pareto {
            title: String::new(),
            cost_label: "ns".to_owned(),
            error_label: "ΔE".to_owned(),
            groups: vec!["all".to_owned()],
            points: vec![
                point("a", 10.0, 1.0, true),
                point("b", 100.0, 0.0, true),
                point("c", f64::NAN, 1.0, false),
                point("d", 10.0, f64::INFINITY, false),
            ],
        };
        let p = plot.draw();
        let c = CATEGORIES[0];
        let found = p.pixels().iter().filter(|q| **q == c).count();
        // two marks of the same size, less their softened edges, and a patch of the legend, 12 by 10 points
        let mark = std::f64::consts::PI * radius(1000).powi(2) * 4.0;
        assert!((found as f64 - 480.0 - 2.0 * mark).abs() < 0.3 * mark, "{found} {mark}");
        let empty = Pareto { points: Vec::new(), ..plot };
        assert!(empty.draw().width() > 100);
    }

    #[test]
    fn sizes_are_written_short() {
        assert_eq!(
            [40, 19_200, 303_696, 2_500_000].map(size_in_words),
            ["40 B", "19.2 kB", "304 kB", "2.5 MB"]
        );
    }
}
