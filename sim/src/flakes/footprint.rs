//! What a footprint on the surface sends back: the flakes in it, instead of the mean over all.
//!
//! A pixel of the instrument's camera sees some square millimetres, thousands of flakes. So the tile is cut into cells, and for each cell and kind of
//! flake Σ v · P_b(slope − s) is tabulated over the slope of the half vector; a footprint is the mean of the tables of the cells whose centres it holds. Within
//! a cell all flakes of a kind have the kind's mean colour and depth.

use gonio_brdf::Rgb;
use gonio_optics::Vec3;

use super::field::{Field, Flake, Kind};

/// Least side of a cell, mm.
const CELL_MM: f64 = 0.25;
/// Most cells along a tile.
const MOST_CELLS: usize = 24;
/// Steps of the slope in a width of a flake: linear interpolation is then off by 1/72 at the peak.
const STEPS: f64 = 3.0;
/// Most slopes along an axis.
const MOST_SLOPES: usize = 128;
/// Reach of a flake in widths.
const REACH: f64 = 4.0;

/// Tables over slopes for cells of a tile.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    side: usize,
    cell_mm: f64,
    tables: Vec<Table>,
}

/// One kind's.
#[derive(Clone, Debug)]
struct Table {
    /// Slope of the first node along both axes, and the step.
    low: f64,
    step: f64,
    nodes: usize,
    /// By cell, then slope along y, then along x; the whole tile last.
    values: Vec<f32>,
}

impl Cells {
    pub(super) fn new(tile_mm: f64, kinds: &[Kind], flakes: &[Flake]) -> Self {
        let side = ((tile_mm / CELL_MM).round() as usize).clamp(1, MOST_CELLS);
        let cell_mm = tile_mm / side as f64;
        let tables = kinds
            .iter()
            .enumerate()
            .map(|(k, kind)| {
                let own = || flakes.iter().filter(move |f| usize::from(f.population) == k);
                Table::new(kind, own, side, cell_mm)
            })
            .collect();
        Self { side, cell_mm, tables }
    }
}

impl Table {
    fn new<'a, I: Iterator<Item = &'a Flake>>(
        kind: &Kind,
        own: impl Fn() -> I,
        side: usize,
        cell_mm: f64,
    ) -> Self {
        let width = kind.width;
        let most = own().flat_map(|f| f.slope).fold(0.0f32, |m, s| m.max(s.abs()));
        let high = f64::from(most) + REACH * width;
        let nodes = ((2.0 * high / width * STEPS).ceil() as usize + 1).clamp(2, MOST_SLOPES);
        let (low, step) = (-high, 2.0 * high / (nodes - 1) as f64);
        let plane = nodes * nodes;
        let mut values = vec![0.0f32; (side * side + 1) * plane];
        for f in own() {
            let along = |x: f32| ((f64::from(x) / cell_mm) as usize).min(side - 1);
            let cell = along(f.at[1]) * side + along(f.at[0]);
            let r = f64::from(f.radius);
            let area = std::f64::consts::PI * r * r * f64::from(f.visible);
            let peak = 1.0 / (2.0 * std::f64::consts::PI * width * width);
            let line = |s: f32| -> (usize, Vec<f64>) {
                let s = f64::from(s);
                let first = ((s - REACH * width - low) / step).ceil().max(0.0) as usize;
                let last = (((s + REACH * width - low) / step).floor().max(0.0) as usize).min(nodes - 1);
                let at = |k: usize| (-0.5 * ((low + step * k as f64 - s) / width).powi(2)).exp();
                (first, (first..=last).map(at).collect())
            };
            let ((x0, xs), (y0, ys)) = (line(f.slope[0]), line(f.slope[1]));
            for (j, y) in ys.iter().enumerate() {
                for (i, x) in xs.iter().enumerate() {
                    let at = (y0 + j) * nodes + x0 + i;
                    let v = peak * x * y;
                    values[cell * plane + at] += (area / (cell_mm * cell_mm) * v) as f32;
                    values[side * side * plane + at] +=
                        (area / (cell_mm * cell_mm * (side * side) as f64) * v) as f32;
                }
            }
        }
        Self { low, step, nodes, values }
    }

    /// Where a slope lies: node and share of the next, along x and y; `None` beyond.
    fn place(&self, slope: [f64; 2]) -> Option<[(usize, f64); 2]> {
        let along = |s: f64| {
            let x = (s - self.low) / self.step;
            (x >= 0.0 && x < (self.nodes - 1) as f64).then(|| (x as usize, x.fract()))
        };
        Some([along(slope[0])?, along(slope[1])?])
    }

    fn at(&self, cell: usize, [(i, x), (j, y)]: [(usize, f64); 2]) -> f64 {
        let from = cell * self.nodes * self.nodes + j * self.nodes + i;
        let v = |k: usize| f64::from(self.values[from + k]);
        let n = self.nodes;
        (v(0) * (1.0 - x) + v(1) * x) * (1.0 - y) + (v(n) * (1.0 - x) + v(n + 1) * x) * y
    }
}

impl Field {
    /// f over an ellipse on the surface, 1/sr: `centre` and half axes in the sample's own plane, mm.
    ///
    /// A footprint of several tiles is taken for the mean of the tile.
    #[must_use]
    pub fn over(&self, light: Vec3, view: Vec3, centre: [f64; 2], axes: [[f64; 2]; 2]) -> Rgb {
        let Some(seen) = self.seen(light, view) else { return [0.0; 3] };
        let [[ax, ay], [bx, by]] = axes;
        let determinant = ax * by - ay * bx;
        let area = std::f64::consts::PI * determinant.abs();
        if area < self.paint().texel_mm.powi(2) {
            let along = |x: f64| {
                let texels = (x / self.paint().tile_mm * self.side() as f64).floor();
                (texels.rem_euclid(self.side() as f64) as usize).min(self.side() - 1)
            };
            return self.texel_seen(along(centre[0]), along(centre[1]), &seen);
        }
        let c = self.cells();
        let whole = c.side * c.side;
        let cells = if area > 2.0 * self.paint().tile_mm.powi(2) {
            vec![whole]
        } else {
            c.under(centre, axes, determinant)
        };
        let mut sum = self.under();
        for (kind, table) in self.kinds.iter().zip(&c.tables) {
            let Some(place) = table.place(seen.slope) else { continue };
            let level = cells.iter().map(|&k| table.at(k, place)).sum::<f64>() / cells.len() as f64;
            let colour = self.kind_colour(kind, &seen);
            for (s, r) in sum.iter_mut().zip(colour) {
                *s += level * seen.scale * r;
            }
        }
        sum.map(|v| seen.factor * v)
    }
}

impl Cells {
    /// Cells whose centres lie in an ellipse, again and again where it reaches over the tile; the one under its centre where it holds none.
    fn under(&self, centre: [f64; 2], [[ax, ay], [bx, by]]: [[f64; 2]; 2], determinant: f64) -> Vec<usize> {
        let n = self.side as i64;
        let wrapped = |i: i64, j: i64| (j.rem_euclid(n) * n + i.rem_euclid(n)) as usize;
        let reach = [ax.hypot(bx), ay.hypot(by)];
        let span = |k: usize| {
            let (low, high) = ((centre[k] - reach[k]) / self.cell_mm, (centre[k] + reach[k]) / self.cell_mm);
            (low.floor() as i64, high.floor() as i64)
        };
        let ((x0, x1), (y0, y1)) = (span(0), span(1));
        let mut out = Vec::new();
        for j in y0..=y1 {
            for i in x0..=x1 {
                let (x, y) = (
                    (i as f64 + 0.5) * self.cell_mm - centre[0],
                    (j as f64 + 0.5) * self.cell_mm - centre[1],
                );
                // in the unit disc that the half axes span
                let (u, v) = ((x * by - y * bx) / determinant, (y * ax - x * ay) / determinant);
                if u * u + v * v <= 1.0 {
                    out.push(wrapped(i, j));
                }
            }
        }
        if out.is_empty() {
            let at = |k: usize| (centre[k] / self.cell_mm).floor() as i64;
            out.push(wrapped(at(0), at(1)));
        }
        out
    }
}
