//! A table unfolded into one strip (Sopp, Fig. 4.6): θi down in blocks, θo down within a block, φ across.
//!
//! Bins take the room they have in degrees. The half that mirror symmetry leaves out is drawn as well, so that the mirror
//! side (φ = 180°) stands in the middle and the light's own side at both edges.

use gonio_brdf::Grid;

use super::axis::short;
use super::cells::{bin, folded};
use super::legend::hatch;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::{FAINT, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Srgb;

/// Room for the labels of θi and θo left of the first strip.
pub(crate) const LEFT: f64 = 74.0;
/// Room for heading and azimuths above a strip.
pub(crate) const ABOVE: f64 = 46.0;
/// Room for azimuths and their label below a strip.
pub(crate) const BELOW: f64 = 32.0;
const GAP: f64 = 3.0;

/// Height of a block and of the whole strip in points.
pub(crate) fn heights(grid: &Grid) -> (f64, f64) {
    let n = grid.theta_i_deg.len().max(1) as f64;
    let block = (700.0 / n).clamp(14.0, 120.0);
    (block, n * (block + GAP) - GAP)
}

/// Draws the strip into `area` (its height from [`heights`]); `None` from `colour` is hatched.
pub(crate) fn draw(canvas: &mut Canvas, area: Area, grid: &Grid, colour: &dyn Fn(usize) -> Option<Srgb>) {
    let (block, _) = heights(grid);
    let colours: Vec<Option<Srgb>> = (0..grid.len()).map(colour).collect();
    for ti in 0..grid.theta_i_deg.len() {
        let a = Area::new(area.x, area.y + ti as f64 * (block + GAP), area.w, block);
        canvas.paint(a, 1, |u, v| {
            let to = bin(&grid.theta_o_deg, 90.0 * v);
            let phi = bin(&grid.phi_deg, folded(&grid.phi_deg, 360.0 * u));
            let found = to.zip(phi).and_then(|(to, phi)| *colours.get(grid.index(ti, to, phi))?);
            Some(found.unwrap_or_else(|| hatch(u * a.w, v * a.h)))
        });
    }
    azimuths(canvas, area);
}

fn azimuths(canvas: &mut Canvas, area: Area) {
    let small = Text::new(8.5, INK);
    for k in 0..=4u8 {
        let x = area.x + area.w * f64::from(k) / 4.0;
        let label = format!("{}°", 90 * u16::from(k));
        // the outer labels stay inside the strip, so that neighbours never touch
        let along =
            [Anchor::Start, Anchor::Middle, Anchor::Middle, Anchor::Middle, Anchor::End][usize::from(k)];
        for (y, outward, across) in [(area.y, -3.5, Anchor::End), (area.bottom(), 3.5, Anchor::Start)] {
            canvas.line((x, y), (x, y + outward), 0.6, INK);
            canvas.text((x, y + 1.8 * outward), &label, &small.at(along, across));
        }
    }
    let label = Text::new(9.5, MUTED).at(Anchor::Middle, Anchor::Start);
    canvas.text((area.centre().0, area.bottom() + 19.0), "azimuth φ (180°: mirror side)", &label);
}

/// The heading above a strip.
pub(crate) fn heading(canvas: &mut Canvas, area: Area, text: &str) {
    let style = Text::new(11.0, INK).bold().at(Anchor::Middle, Anchor::End);
    canvas.text_within((area.centre().0, area.y - 25.0), text, &style, area.w);
}

/// Labels of θi and θo left of the strip.
pub(crate) fn polar_labels(canvas: &mut Canvas, area: Area, grid: &Grid) {
    let (block, _) = heights(grid);
    let (big, small) = (Text::new(10.0, INK).bold(), Text::new(7.5, MUTED));
    let step = if block >= 33.0 {
        30.0
    } else if block >= 22.0 {
        45.0
    } else {
        90.0
    };
    for (ti, theta_i) in grid.theta_i_deg.iter().enumerate() {
        let y = area.y + ti as f64 * (block + GAP);
        let at = (area.x - 36.0, y + 0.5 * block);
        canvas.text(at, &format!("{}°", short(*theta_i)), &big.at(Anchor::End, Anchor::Middle));
        canvas.line((area.x - 31.0, y + 1.0), (area.x - 31.0, y + block - 1.0), 1.0, FAINT);
        let mut theta_o = 0.0;
        while theta_o < 90.0 {
            let ty = y + block * theta_o / 90.0;
            canvas.line((area.x - 3.0, ty), (area.x, ty), 0.6, INK);
            let nudge = if theta_o == 0.0 { 2.5 } else { 0.0 };
            let text = format!("{theta_o:.0}°");
            canvas.text((area.x - 5.0, ty + nudge), &text, &small.at(Anchor::End, Anchor::Middle));
            theta_o += step;
        }
    }
    canvas.text(
        (area.x - 36.0, area.y - 8.0),
        "θᵢ",
        &Text::new(11.0, INK).bold().at(Anchor::End, Anchor::End),
    );
    canvas.text((area.x - 5.0, area.y - 8.0), "θₒ", &Text::new(10.0, MUTED).at(Anchor::End, Anchor::End));
}
