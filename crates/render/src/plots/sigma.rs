//! Relative standard uncertainty of every cell, in per cent.

use gonio_brdf::Measured;

use super::axis::Scale;
use super::cells::{quantile, relative_sigma};
use super::colorbar::ColourBar;
use super::legend::{self, Key};
use super::polar;
use super::unfolded::title;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::ColourMap;
use crate::picture::Picture;

/// Draws one hemisphere of σ_Y/Y for each angle of incidence, on a logarithmic scale from the 2nd to the 98th percentile.
///
/// The parts of the three channels are added as if fully correlated (an upper bound). Cells without a value, or whose luminance is
/// not above zero, are hatched. An empty title leaves no room.
#[must_use]
pub fn sigma(m: &Measured, heading: &str) -> Picture {
    let percent: Vec<Option<f64>> =
        (0..m.grid.len()).map(|i| relative_sigma(m, i).map(|r| 100.0 * r).filter(|r| *r > 0.0)).collect();
    let at = |q: f64| quantile(percent.iter().flatten().copied(), q);
    let (low, high) = (at(0.02).unwrap_or(0.1), at(0.98).unwrap_or(10.0));
    let scale = Scale::log(low, high);
    let outside = |side: fn(f64) -> bool| percent.iter().flatten().any(|p| side(scale.fraction(*p)));
    let bar = ColourBar {
        map: ColourMap::Viridis,
        scale,
        label: "relative standard uncertainty σ / f of the luminance (k = 1), %".into(),
        beyond: [outside(|f| f < -1e-9), outside(|f| f > 1.0 + 1e-9)],
    };
    let top = if heading.is_empty() { 4.0 } else { 28.0 };
    let tall = polar::height(&m.grid);
    let mut canvas = Canvas::new(polar::WIDTH, top + tall + 84.0);
    title(&mut canvas, heading);
    polar::draw(&mut canvas, top, &m.grid, &|i| percent.get(i).copied().flatten().map(|p| bar.colour(p)));
    polar::explain(&mut canvas, top + tall + 18.0, &m.grid);
    bar.draw_lying(&mut canvas, Area::new(30.0, top + tall + 38.0, 480.0, 10.0));
    if percent.iter().any(Option::is_none) {
        let key = [(Key::Hatched, "no value, or f = 0".to_owned())];
        legend::draw(&mut canvas, (550.0, top + tall + 43.0), 160.0, &key);
    }
    canvas.finish()
}
