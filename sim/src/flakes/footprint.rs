//! What a footprint on the surface sends back: the flakes whose centres lie in it, instead of the mean over all.

use gonio_brdf::Rgb;
use gonio_optics::Vec3;

use super::field::{Field, Flake};

/// Side of a cell, mm, or a little less so that cells fill the tile.
const CELL_MM: f64 = 0.2;

/// Flakes of a tile by square cells.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    side: usize,
    cell_mm: f64,
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Cells {
    pub(super) fn new(tile_mm: f64, flakes: &[Flake]) -> Self {
        let side = (tile_mm / CELL_MM).ceil().max(1.0) as usize;
        let cell_mm = tile_mm / side as f64;
        let cell = |f: &Flake| {
            let along = |x: f32| ((f64::from(x) / cell_mm) as usize).min(side - 1);
            along(f.at[1]) * side + along(f.at[0])
        };
        let mut order: Vec<u32> = (0..flakes.len() as u32).collect();
        order.sort_by_key(|&k| cell(&flakes[k as usize]));
        let mut starts = vec![0u32; side * side + 1];
        for f in flakes {
            starts[cell(f) + 1] += 1;
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        Self { side, cell_mm, starts, order }
    }
}

impl Field {
    /// f over an ellipse on the surface, 1/sr: `centre` and half axes in the sample's own plane, mm.
    ///
    /// A footprint larger than the tile sees its flakes again and again.
    #[must_use]
    pub fn over(&self, light: Vec3, view: Vec3, centre: [f64; 2], axes: [[f64; 2]; 2]) -> Rgb {
        let Some(seen) = self.seen(light, view) else { return [0.0; 3] };
        let [[ax, ay], [bx, by]] = axes;
        let area = std::f64::consts::PI * (ax * by - ay * bx).abs();
        let mut sum = [0.0; 3];
        if area < self.paint().texel_mm.powi(2) {
            // smaller than a texel: the texel
            let at = |x: f64| (x / self.paint().texel_mm).floor().rem_euclid(self.side() as f64) as usize;
            return self.texel_seen(at(centre[0]), at(centre[1]), &seen);
        }
        let c = &self.cells;
        let tile = self.paint().tile_mm;
        let reach = [ax.hypot(bx), ay.hypot(by)];
        let span = |k: usize| {
            let (low, high) = ((centre[k] - reach[k]) / c.cell_mm, (centre[k] + reach[k]) / c.cell_mm);
            (low.floor() as i64, high.floor() as i64)
        };
        let ((x0, x1), (y0, y1)) = (span(0), span(1));
        let n = c.side as i64;
        let determinant = ax * by - ay * bx;
        for j in y0..=y1 {
            for i in x0..=x1 {
                let cell = (j.rem_euclid(n) * n + i.rem_euclid(n)) as usize;
                let (ox, oy) = (i.div_euclid(n) as f64 * tile, j.div_euclid(n) as f64 * tile);
                for &k in &c.order[c.starts[cell] as usize..c.starts[cell + 1] as usize] {
                    let f = &self.flakes[k as usize];
                    let (x, y) = (f64::from(f.at[0]) + ox - centre[0], f64::from(f.at[1]) + oy - centre[1]);
                    // in the unit disc that the half axes span
                    let (u, v) = ((x * by - y * bx) / determinant, (y * ax - x * ay) / determinant);
                    if u * u + v * v <= 1.0 {
                        let r = f64::from(f.radius);
                        let share = std::f64::consts::PI * r * r * f64::from(f.visible) / area;
                        self.add(f, share, &seen, &mut sum);
                    }
                }
            }
        }
        let under = self.under();
        [0, 1, 2].map(|c| seen.factor * (sum[c] + under[c]))
    }
}
