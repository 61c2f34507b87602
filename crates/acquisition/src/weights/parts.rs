//! Parts of the pixels: each visible pixel is split among the bins that its area covers.

use gonio_optics::Vec3;
use rayon::prelude::*;

use super::bins::{Bins, Place};
use crate::pixel_map::{PixelMap, PoseView};

/// The part of an element that falls into a bin.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) bin: u32,
    pub(super) element: u32,
    pub(super) solid_angle: f32,
    /// Centroid from the element's centre, pixels.
    pub(super) dx: f32,
    pub(super) dy: f32,
    /// Half the variance along columns and rows less that of a whole pixel (1/12), pixels².
    pub(super) vx: f32,
    pub(super) vy: f32,
}

/// Half the variance of a whole pixel along a side.
const WHOLE: f32 = 1.0 / 24.0;

/// Golden section of 1.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Rows that are split together.
const ROWS: usize = 32;

/// Corners of the pixels along a row: directions in the sample frame, and their bins where a pixel beside them is seen.
struct Corners {
    directions: Vec<Vec3>,
    places: Vec<Option<Place>>,
}

/// Splits every visible element among the bins it covers, in the order of the pixels.
pub(super) fn parts(map: &PixelMap, view: &PoseView, bins: &Bins) -> Vec<Part> {
    let (w, h) = (map.width(), map.height());
    let bands: Vec<Vec<Part>> = (0..h.div_ceil(ROWS))
        .into_par_iter()
        .map(|band| {
            let mut out = Vec::with_capacity(ROWS * w);
            let mut above = Corners::new(w);
            let mut below = Corners::new(w);
            above.find(map, view, bins, band * ROWS);
            for row in band * ROWS..h.min((band + 1) * ROWS) {
                below.find(map, view, bins, row + 1);
                for (x, pixel) in (row * w..(row + 1) * w).enumerate().filter(|(_, p)| view.visible[*p]) {
                    let c = [
                        above.directions[x],
                        above.directions[x + 1],
                        below.directions[x],
                        below.directions[x + 1],
                    ];
                    let at = [above.places[x], above.places[x + 1], below.places[x], below.places[x + 1]];
                    split(map, bins, pixel, c, at, &mut out);
                }
                std::mem::swap(&mut above, &mut below);
            }
            out
        })
        .collect();
    bands.concat()
}

impl Corners {
    fn new(width: usize) -> Self {
        Self { directions: vec![Vec3::ZERO; width + 1], places: vec![None; width + 1] }
    }

    /// Those above row `row`; directions are zero where a ray misses and where no pixel beside is seen.
    fn find(&mut self, map: &PixelMap, view: &PoseView, bins: &Bins, row: usize) {
        let (w, h) = (map.width(), map.height());
        let seen = |x: usize| {
            let beside =
                |y: usize| (x < w && view.visible[y * w + x]) || (x > 0 && view.visible[y * w + x - 1]);
            (row < h && beside(row)) || (row > 0 && beside(row - 1))
        };
        let mut guess = None;
        for x in 0..=w {
            let corner = map.corner(x, row);
            if corner == Vec3::ZERO || !seen(x) {
                (self.directions[x], self.places[x]) = (Vec3::ZERO, None);
                continue;
            }
            let d = view.sample_from_lab.apply(corner);
            guess = bins.locate_near(d, guess);
            (self.directions[x], self.places[x]) = (d, guess);
        }
    }
}

/// Splits an element with the corners `c`, which fall into the bins `at`.
fn split(
    map: &PixelMap,
    bins: &Bins,
    pixel: usize,
    c: [Vec3; 4],
    at: [Option<Place>; 4],
    out: &mut Vec<Part>,
) {
    if c.contains(&Vec3::ZERO) {
        return;
    }
    let solid_angle = map.solid_angle(pixel);
    let element = pixel as u32;
    if let [Some(a), Some(b), Some(d), Some(e)] = at
        && a == b
        && a == d
        && a == e
    {
        out.push(Part {
            bin: a.bin,
            element,
            solid_angle: solid_angle as f32,
            dx: 0.0,
            dy: 0.0,
            vx: 0.0,
            vy: 0.0,
        });
        return;
    }
    // finer where the pixel is large against the bin or the azimuths run together
    let middle = c[0] + c[1] + c[2] + c[3];
    let sine = middle.x.hypot(middle.y) / middle.norm();
    let size = solid_angle.sqrt();
    let phi_width = bins.phi_bounds.get(1).map_or(1.0, |b| b - bins.phi_bounds[0]);
    let narrow = bins.narrowest_rad.min((phi_width * sine).max(0.05 * bins.narrowest_rad));
    let side = (4.0 * size / narrow).ceil().clamp(12.0, 32.0);
    let n = (side * side) as usize;
    let nearby = match at {
        [Some(a), Some(b), Some(d), Some(e)] => bins.nearby([a, b, d, e]),
        _ => None,
    };
    let locate = |d: Vec3| match &nearby {
        Some(few) => few.locate(d),
        None => bins.locate(d).map(|place| place.bin),
    };
    let first = out.len();
    for i in 0..n {
        // a golden-ratio lattice: whichever way a bound runs through the pixel, the points on either side tell the areas to about 1/n; rows and
        // columns of points would tell them to 1/√n only
        let (x, y) = ((i as f64 + 0.5) / n as f64, (i as f64 * GOLDEN + 0.5).fract());
        let (left, right) = (c[0] * (1.0 - y) + c[2] * y, c[1] * (1.0 - y) + c[3] * y);
        let Some(bin) = locate(left * (1.0 - x) + right * x) else { continue };
        let k = out[first..].iter().position(|p| p.bin == bin).map_or_else(
            || {
                out.push(Part { bin, element, solid_angle: 0.0, dx: 0.0, dy: 0.0, vx: 0.0, vy: 0.0 });
                out.len() - 1
            },
            |k| first + k,
        );
        // sums over points until the end
        let (x, y) = ((x - 0.5) as f32, (y - 0.5) as f32);
        out[k].solid_angle += 1.0;
        out[k].dx += x;
        out[k].dy += y;
        out[k].vx += x * x;
        out[k].vy += y * y;
    }
    for p in &mut out[first..] {
        let count = p.solid_angle;
        p.dx /= count;
        p.dy /= count;
        p.vx = 0.5 * (p.vx / count - p.dx * p.dx) - WHOLE;
        p.vy = 0.5 * (p.vy / count - p.dy * p.dy) - WHOLE;
        p.solid_angle = (f64::from(count) * solid_angle / n as f64) as f32;
    }
}
