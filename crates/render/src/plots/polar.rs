//! Small multiples: one hemisphere for each angle of incidence, seen from above.
//!
//! The radius is θo (rings at 30°, 60°, 90°), the light comes from the left (φ = 0°), its mirror direction is to the right.

use gonio_brdf::Grid;

use super::axis::short;
use super::cells::{bin, folded};
use super::legend::hatch;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::{INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Srgb;

const COLUMNS: usize = 5;
const MOST: usize = 20;
const CELL: f64 = 140.0;
const LABEL: f64 = 20.0;
const MARGIN: f64 = 10.0;

/// Width of the panels in points.
pub(crate) const WIDTH: f64 = COLUMNS as f64 * CELL + 2.0 * MARGIN;

/// Which angles of incidence are shown: all, or evenly picked ones when there are too many.
pub(crate) fn picked(grid: &Grid) -> Vec<usize> {
    let n = grid.theta_i_deg.len();
    let step = n.div_ceil(MOST).max(1);
    (0..n).step_by(step).collect()
}

/// Height of the panels in points.
pub(crate) fn height(grid: &Grid) -> f64 {
    picked(grid).len().div_ceil(COLUMNS) as f64 * (CELL + LABEL - 8.0)
}

/// Draws the panels with their upper edge at `top`; `None` from `colour` is hatched.
pub(crate) fn draw(canvas: &mut Canvas, top: f64, grid: &Grid, colour: &dyn Fn(usize) -> Option<Srgb>) {
    let colours: Vec<Option<Srgb>> = (0..grid.len()).map(colour).collect();
    for (k, ti) in picked(grid).into_iter().enumerate() {
        let x = MARGIN + (k % COLUMNS) as f64 * CELL;
        let y = top + (k / COLUMNS) as f64 * (CELL + LABEL - 8.0);
        let theta_i = grid.theta_i_deg.get(ti).copied().unwrap_or(0.0);
        let disc = Area::new(x + 8.0, y + LABEL, CELL - 16.0, CELL - 16.0);
        canvas.text(
            (disc.x, y + LABEL),
            &format!("θᵢ {}°", short(theta_i)),
            &Text::new(10.0, INK).bold().at(Anchor::Start, Anchor::Start),
        );
        hemisphere(canvas, disc, grid, ti, theta_i, &colours);
    }
}

fn hemisphere(
    canvas: &mut Canvas,
    disc: Area,
    grid: &Grid,
    ti: usize,
    theta_i: f64,
    colours: &[Option<Srgb>],
) {
    canvas.paint(disc, 2, |u, v| {
        // light from the left: φ = 0 points towards −x on the page
        let (x, y) = (1.0 - 2.0 * u, 2.0 * v - 1.0);
        let r = x.hypot(y);
        if r > 1.0 {
            return None;
        }
        let to = bin(&grid.theta_o_deg, 90.0 * r);
        let phi = bin(&grid.phi_deg, folded(&grid.phi_deg, y.atan2(x).to_degrees()));
        let found = to.zip(phi).and_then(|(to, phi)| *colours.get(grid.index(ti, to, phi))?);
        Some(found.unwrap_or_else(|| hatch(u * disc.w, v * disc.h)))
    });
    let radius = 0.5 * disc.w;
    let centre = disc.centre();
    for ring in [30.0, 60.0] {
        canvas.ring(centre, radius * ring / 90.0, 0.5, [255; 3]);
    }
    canvas.ring(centre, radius, 0.9, MUTED);
    let at = radius * theta_i / 90.0;
    marker_light(canvas, (centre.0 - at, centre.1));
    marker_mirror(canvas, (centre.0 + at, centre.1));
}

/// The sign for the light's direction.
pub(crate) fn marker_light(canvas: &mut Canvas, at: (f64, f64)) {
    canvas.disc(at, 3.6, INK, 1.0);
    canvas.disc(at, 2.6, [255, 255, 255], 1.0);
}

/// The sign for its mirror direction.
pub(crate) fn marker_mirror(canvas: &mut Canvas, (x, y): (f64, f64)) {
    for (stroke, colour) in [(2.6, [255; 3]), (1.2, INK)] {
        let r = if stroke > 2.0 { 4.6 } else { 4.0 };
        canvas.line((x - r, y), (x + r, y), stroke, colour);
        canvas.line((x, y - r), (x, y + r), stroke, colour);
    }
}

/// One line that explains the panels, its middle at `y`.
pub(crate) fn explain(canvas: &mut Canvas, y: f64, grid: &Grid) {
    let style = Text::new(9.5, INK).at(Anchor::Start, Anchor::Middle);
    let x = MARGIN + 14.0;
    marker_light(canvas, (x, y));
    canvas.text((x + 9.0, y), "light (φ = 0°)", &style);
    marker_mirror(canvas, (x + 106.0, y));
    canvas.text((x + 115.0, y), "its mirror direction (φ = 180°)", &style);
    canvas.text((x + 294.0, y), "radius: θₒ, rings at 30°, 60°, 90°", &style);
    let (shown, all) = (picked(grid).len(), grid.theta_i_deg.len());
    if shown < all {
        canvas.text((x + 500.0, y), &format!("{shown} of {all} angles of incidence"), &style);
    }
}
