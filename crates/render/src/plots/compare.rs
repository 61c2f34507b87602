//! Measured | difference | model, unfolded side by side in the same light.

use gonio_brdf::{Brdf, Measured, Rgb};
use gonio_optics::colour;

use super::axis::{Scale, step_up};
use super::cells::{is_mean, model_table, quantile, value};
use super::colorbar::ColourBar;
use super::legend::{self, Key};
use super::strip;
use super::unfolded::{brightening, title, true_colour};
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::ColourMap;
use crate::picture::Picture;

/// What the middle panel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Difference {
    /// `(Y_measured − Y_model) / Y_model` of the luminance, in per cent.
    #[default]
    Relative,
    /// CIEDE2000 on the Lab colours of `π f`.
    DeltaE,
}

/// Options of [`compare`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Compare {
    /// Above the picture; empty for none.
    pub title: String,
    /// The middle panel.
    pub difference: Difference,
    /// Brightening of both colour panels; `None` for [`brightening`].
    pub factor: Option<f64>,
    /// Full scale of the difference; `None` for a round number above 98 % of the cells.
    pub full_scale: Option<f64>,
}

/// Difference of one pair of values (1/sr): per cent or ΔE; `None` where it is not defined (a model that is black, for `Relative`).
#[must_use]
pub fn difference(kind: Difference, measured: Rgb, model: Rgb) -> Option<f64> {
    let d = match kind {
        Difference::Relative => {
            let (a, b) = (colour::luminance(measured), colour::luminance(model));
            if a == b { 0.0 } else { 100.0 * (a - b) / b }
        }
        Difference::DeltaE => {
            colour::ciede2000(colour::lab_from_brdf(measured), colour::lab_from_brdf(model))
        }
    };
    d.is_finite().then_some(d)
}

/// Draws the three panels. The model is averaged over bins and lamp as the table says (4 × 4 nodes, two rings on the lamp).
#[must_use]
pub fn compare(m: &Measured, model: &dyn Brdf, options: &Compare) -> Picture {
    compare_tables(m, &model_table(m, model, 4, 2), options)
}

/// As [`compare`] for a model already tabulated on the same grid; cells that one of them lacks are hatched.
#[must_use]
pub fn compare_tables(m: &Measured, model: &Measured, options: &Compare) -> Picture {
    const WIDE: f64 = 200.0;
    const BETWEEN: f64 = 20.0;
    let top = if options.title.is_empty() { 4.0 } else { 26.0 };
    let (_, tall) = strip::heights(&m.grid);
    let width = strip::LEFT + 3.0 * WIDE + 2.0 * BETWEEN + 14.0;
    let mut canvas = Canvas::new(width, top + strip::ABOVE + tall + strip::BELOW + 56.0);
    title(&mut canvas, &options.title);
    let factor = options.factor.unwrap_or_else(|| brightening(m));
    let difference = |i: usize| difference(options.difference, value(m, i)?, value(model, i)?);
    let bar = bar(options, &|| (0..m.grid.len()).filter_map(difference).map(f64::abs).collect());
    let area = |k: f64| Area::new(strip::LEFT + k * (WIDE + BETWEEN), top + strip::ABOVE, WIDE, tall);
    let brightened =
        if factor == 1.0 { String::new() } else { format!(" (× {})", super::axis::short(factor)) };
    let averaged = if is_mean(m) { ", averaged over cells" } else { "" };
    strip::polar_labels(&mut canvas, area(0.0), &m.grid);
    strip::heading(&mut canvas, area(0.0), &format!("measured{brightened}"));
    strip::heading(&mut canvas, area(1.0), "difference");
    strip::heading(&mut canvas, area(2.0), &format!("model{brightened}"));
    strip::draw(&mut canvas, area(0.0), &m.grid, &|i| value(m, i).map(|f| true_colour(f, factor)));
    strip::draw(&mut canvas, area(1.0), &m.grid, &|i| difference(i).map(|d| bar.colour(d)));
    strip::draw(&mut canvas, area(2.0), &m.grid, &|i| value(model, i).map(|f| true_colour(f, factor)));
    let y = top + strip::ABOVE + tall + strip::BELOW + 12.0;
    let middle = area(1.0);
    bar.draw_lying(&mut canvas, Area::new(middle.x + 4.0, y, WIDE - 8.0, 9.0));
    if (0..m.grid.len()).any(|i| difference(i).is_none()) {
        legend::draw(&mut canvas, (strip::LEFT, y + 4.0), WIDE, &[(Key::Hatched, "no value".into())]);
    }
    let note = [(Key::Patch([255; 3]), format!("white: πf = 1{averaged}"))];
    legend::draw(&mut canvas, (area(2.0).x, y + 4.0), WIDE, &note);
    canvas.finish()
}

fn bar(options: &Compare, sizes: &dyn Fn() -> Vec<f64>) -> ColourBar {
    let full = options.full_scale.filter(|f| *f > 0.0 && f.is_finite());
    let sizes = sizes();
    let full = full.unwrap_or_else(|| {
        let q = quantile(sizes.iter().copied(), 0.98).unwrap_or(1.0);
        let (least, most) = match options.difference {
            Difference::Relative => (1.0, 100.0),
            Difference::DeltaE => (0.5, 50.0),
        };
        step_up(q.max(least)).min(most)
    });
    let above = sizes.iter().any(|s| *s > full);
    match options.difference {
        Difference::Relative => ColourBar {
            map: ColourMap::Vik,
            scale: Scale::linear(-full, full),
            label: "(measured - model) / model, luminance, %".into(),
            beyond: [above, above],
        },
        Difference::DeltaE => ColourBar {
            map: ColourMap::Viridis,
            scale: Scale::linear(0.0, full),
            label: "CIEDE2000".into(),
            beyond: [false, above],
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_signed_per_cent_of_the_model_and_never_nan() {
        let d = difference(Difference::Relative, [0.11; 3], [0.10; 3]).unwrap();
        assert!((d - 10.0).abs() < 1e-9, "{d}");
        assert_eq!(difference(Difference::Relative, [0.0; 3], [0.0; 3]), Some(0.0));
        assert_eq!(difference(Difference::Relative, [0.1; 3], [0.0; 3]), None);
        assert!(difference(Difference::DeltaE, [0.0; 3], [0.0; 3]).unwrap().abs() < 1e-12);
    }
}
