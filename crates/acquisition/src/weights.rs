//! Which pixel counts how much in which cell at a pose: computed once, reused for white, sample and every exposure.
//!
//! Each pixel of the sensor, whatever its colour, is an element of solid angle; it is split among the bins that its area
//! covers. In every part the radiance of a colour is taken from that colour's own pixels around it by cubic interpolation
//! (Keys) at the part's centroid, which is linear in the pixels: summing over the elements of a bin leaves one weight per
//! pixel and cell. The colours' coarse lattices therefore do not broaden a lobe as nearest-tile splatting does
//! (by h²/12, h up to 0.76°). Beside the edge of what is visible a surface fitted to the neighbours left takes its place.
//!
//! Green is two lattices of the pitch of red and blue; each counts half.
//!
//! Layout: one list per (side of the plane of incidence, cell, channel), `((side * cells) + cell) * 3 + channel`,
//! entries ascending by pixel. Sums over a list therefore run in one order, whatever the number of threads.

mod bins;
mod parts;

use gonio_brdf::Grid;
use gonio_optics::Vec3;
use rayon::prelude::*;

use bins::Bins;
use parts::{Part, parts};

use crate::local_fit::{self, Neighbour};
use crate::pixel_map::{PixelMap, PoseView};

/// Weights of one pose.
#[derive(Clone, Debug)]
pub struct Weights {
    starts: Vec<u32>,
    pixels: Vec<u32>,
    weights: Vec<f32>,
    /// Per (side, cell): share of the bin's solid angle that is visible.
    coverage: Vec<f32>,
    /// Per (side, cell): how far the visible part's centroid lies from the bin's, radians.
    off_centre: Vec<f32>,
}

/// Keys' cubic kernel (a = −1/2) at the four neighbours of a point a fraction `t` past the second.
fn cubic(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

/// Keys' kernel plus `v` times the second derivative by pixels: differences over the lattice's step of two pixels, linear in between.
fn kernel(t: f64, v: f64) -> [f64; 4] {
    let mut k = cubic(t);
    if v != 0.0 {
        let (a, b) = (0.25 * v * (1.0 - t), 0.25 * v * t);
        for (k, d) in k.iter_mut().zip([a, b - 2.0 * a, a - 2.0 * b, b]) {
            *k += d;
        }
    }
    k
}

impl Weights {
    /// Weights of a pose for the bins of `grid` (one θi row).
    #[must_use]
    pub fn new(map: &PixelMap, view: &PoseView, grid: &Grid) -> Self {
        let bins = Bins::new(grid);
        let count = 2 * bins.cells;
        let parts = parts(map, view, &bins);
        let (starts, parts) = by_bin(&parts, count);
        let deep = eroded(&view.visible, map.width(), map.height());
        let lists: Vec<[Vec<(u32, f32)>; 3]> = (0..count)
            .into_par_iter()
            .map_init(
                || (vec![0.0f32; map.width() * map.height()], Vec::new()),
                |(scratch, touched), bin| {
                    let mine = &parts[starts[bin]..starts[bin + 1]];
                    gather(map, view, &deep, mine, scratch, touched)
                },
            )
            .collect();
        let coverage = coverage(grid, &bins, &starts, &parts);
        let off_centre = off_centre(map, view, grid, &bins, &starts, &parts);
        let mut out = Self { starts: vec![0], pixels: Vec::new(), weights: Vec::new(), coverage, off_centre };
        for list in lists.iter().flatten() {
            out.pixels.extend(list.iter().map(|e| e.0));
            out.weights.extend(list.iter().map(|e| e.1));
            out.starts.push(out.pixels.len() as u32);
        }
        out
    }

    /// Pixels and weights (sr) of a list; `bin` = side × cells + cell.
    #[must_use]
    pub fn list(&self, bin: usize, channel: usize) -> (&[u32], &[f32]) {
        let i = bin * 3 + channel;
        let range = self.starts[i] as usize..self.starts[i + 1] as usize;
        (&self.pixels[range.clone()], &self.weights[range])
    }

    /// Number of bins: twice the cells of a row.
    #[must_use]
    pub const fn bins(&self) -> usize {
        self.coverage.len()
    }

    /// Visible share of a bin's solid angle, 0…1.
    #[must_use]
    pub fn coverage(&self, bin: usize) -> f64 {
        f64::from(self.coverage[bin])
    }

    /// Distance of the visible part's centroid from the bin's, radians.
    #[must_use]
    pub fn off_centre_rad(&self, bin: usize) -> f64 {
        f64::from(self.off_centre[bin])
    }

    /// Number of (pixel, cell) pairs.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether nothing at all is visible.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }
}

/// Counting sort by bin; stable, so the order within a bin is that of the pixels.
fn by_bin(parts: &[Part], bins: usize) -> (Vec<usize>, Vec<Part>) {
    let mut starts = vec![0usize; bins + 1];
    for p in parts {
        starts[p.bin as usize + 1] += 1;
    }
    for k in 0..bins {
        starts[k + 1] += starts[k];
    }
    let mut next = starts.clone();
    let mut sorted = parts.to_vec();
    for p in parts {
        let k = &mut next[p.bin as usize];
        sorted[*k] = *p;
        *k += 1;
    }
    (starts, sorted)
}

/// Elements whose neighbours within 4 pixels are all visible: there the cubic kernel finds every pixel it asks for.
fn eroded(visible: &[bool], w: usize, h: usize) -> Vec<bool> {
    const REACH: usize = 4;
    let line = |get: &dyn Fn(usize) -> bool, n: usize| -> Vec<bool> {
        let mut run = 0usize;
        let mut out = vec![false; n];
        for i in 0..n {
            run = if get(i) { run + 1 } else { 0 };
            if run > 2 * REACH {
                out[i - REACH] = true;
            }
        }
        out
    };
    let mut rows = vec![false; w * h];
    rows.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
        row.copy_from_slice(&line(&|x| visible[y * w + x], w));
    });
    let columns: Vec<Vec<bool>> = (0..w).into_par_iter().map(|x| line(&|y| rows[y * w + x], h)).collect();
    (0..w * h).map(|i| columns[i % w][i / w]).collect()
}

/// First of the four neighbours of `at` on the lattice of every second pixel, and the fraction past the second.
fn lattice(at: f64, parity: usize) -> (isize, f64) {
    let q = (at - parity as f64) / 2.0;
    let cell = q.floor();
    let t = q - cell;
    (2 * (cell as isize - 1) + parity as isize, if t < 1e-9 { 0.0 } else { t })
}

/// The 4 × 4 pixels of one colour lattice around a point.
struct Taps<'a> {
    x0: isize,
    y0: isize,
    w: isize,
    h: isize,
    visible: &'a [bool],
}

type Kernel = ([f64; 4], [f64; 4]);

impl Taps<'_> {
    /// Calls `f` with the weight of each neighbour that counts, and its place on the sensor (`None` outside).
    fn each(&self, (kx, ky): &Kernel, mut f: impl FnMut(f64, Option<usize>)) {
        for (j, wy) in ky.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            let row = self.y0 + 2 * j as isize;
            for (i, wx) in kx.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                let column = self.x0 + 2 * i as isize;
                let inside = row >= 0 && row < self.h && column >= 0 && column < self.w;
                f(wx * wy, inside.then(|| (row * self.w + column) as usize));
            }
        }
    }

    fn all_visible(&self, kernel: &Kernel) -> bool {
        let mut all = true;
        self.each(kernel, |_, p| all &= p.is_some_and(|p| self.visible[p]));
        all
    }

    fn scatter(&self, kernel: &Kernel, amount: f64, scratch: &mut [f32], touched: &mut Vec<u32>) {
        self.each(kernel, |w, p| {
            if let Some(p) = p.filter(|&p| self.visible[p]) {
                if scratch[p] == 0.0 {
                    touched.push(p as u32);
                }
                scratch[p] += (amount * w) as f32;
            }
        });
    }
}

impl Taps<'_> {
    /// Beside an edge: the surface fitted to the neighbours that are visible.
    fn scatter_fitted(&self, [tx, ty]: [f64; 2], amount: f64, scratch: &mut [f32], touched: &mut Vec<u32>) {
        let mut found = [(0usize, Neighbour::default()); 16];
        let mut n = 0;
        for j in 0..4 {
            for i in 0..4 {
                let (column, row) = (self.x0 + 2 * i, self.y0 + 2 * j);
                if row < 0 || row >= self.h || column < 0 || column >= self.w {
                    continue;
                }
                let p = (row * self.w + column) as usize;
                if self.visible[p] {
                    let (x, y) = (i as f64 - 1.0 - tx, j as f64 - 1.0 - ty);
                    found[n] = (p, Neighbour { x, y, weight: 0.0 });
                    n += 1;
                }
            }
        }
        let mut neighbours = found.map(|f| f.1);
        if !local_fit::weigh(&mut neighbours[..n]) {
            return;
        }
        for ((p, _), neighbour) in found.iter().zip(&neighbours).take(n) {
            if scratch[*p] == 0.0 {
                touched.push(*p as u32);
            }
            scratch[*p] += (amount * neighbour.weight) as f32;
        }
    }
}

/// Weights of one bin: what each pixel contributes to the interpolated radiance summed over the bin's parts.
fn gather(
    map: &PixelMap,
    view: &PoseView,
    deep: &[bool],
    parts: &[Part],
    scratch: &mut [f32],
    touched: &mut Vec<u32>,
) -> [Vec<(u32, f32)>; 3] {
    let (w, h) = (map.width() as isize, map.height() as isize);
    touched.clear();
    // the two green lattices count half each
    let shares: [f64; 4] = std::array::from_fn(|k| {
        let pixel = (k / 2) * map.width() + k % 2;
        if map.channel(pixel) == 1 { 0.5 } else { 1.0 }
    });
    for p in parts {
        let e = p.element as usize;
        let (x, y) = ((e as isize % w) as f64 + f64::from(p.dx), (e as isize / w) as f64 + f64::from(p.dy));
        for (k, share) in shares.iter().enumerate() {
            let (x0, tx) = lattice(x, k % 2);
            let (y0, ty) = lattice(y, k / 2);
            let amount = share * f64::from(p.solid_angle);
            let keys = (kernel(tx, f64::from(p.vx)), kernel(ty, f64::from(p.vy)));
            let taps = Taps { x0, y0, w, h, visible: &view.visible };
            if deep[e] || taps.all_visible(&keys) {
                taps.scatter(&keys, amount, scratch, touched);
                continue;
            }
            taps.scatter_fitted([tx, ty], amount, scratch, touched);
        }
    }
    touched.sort_unstable();
    touched.dedup();
    let mut out: [Vec<(u32, f32)>; 3] = Default::default();
    for &pixel in touched.iter() {
        let weight = std::mem::take(&mut scratch[pixel as usize]);
        if weight != 0.0 {
            out[map.channel(pixel as usize)].push((pixel, weight));
        }
    }
    out
}

/// Visible share of each bin.
fn coverage(grid: &Grid, bins: &Bins, starts: &[usize], parts: &[Part]) -> Vec<f32> {
    let np = grid.phi_deg.len();
    (0..starts.len() - 1)
        .map(|bin| {
            let cell = bin % bins.cells;
            let (to, phi) = (cell / np, cell % np);
            let whole = if to == 0 && bins.has_cap {
                // the cap, which is kept in φ bin 0
                if phi == 0 { std::f64::consts::PI * (1.0 - bins.cos_bounds[1]) } else { f64::INFINITY }
            } else {
                grid.solid_angle(to, phi)
            };
            let seen: f64 =
                parts[starts[bin]..starts[bin + 1]].iter().map(|p| f64::from(p.solid_angle)).sum();
            (seen / whole) as f32
        })
        .collect()
}

/// Distance of the visible part's centroid from the whole bin's.
fn off_centre(
    map: &PixelMap,
    view: &PoseView,
    grid: &Grid,
    bins: &Bins,
    starts: &[usize],
    parts: &[Part],
) -> Vec<f32> {
    let np = grid.phi_deg.len();
    (0..starts.len() - 1)
        .into_par_iter()
        .map(|bin| {
            let mine = &parts[starts[bin]..starts[bin + 1]];
            let cell = bin % bins.cells;
            let (to, phi) = (cell / np, cell % np);
            if mine.is_empty() {
                return 0.0;
            }
            let mut mean = Vec3::ZERO;
            let mut total = 0.0;
            for p in mine {
                let [a, b, c, d] = map.corners(p.element as usize);
                let (x, y) = (f64::from(p.dx) + 0.5, f64::from(p.dy) + 0.5);
                let at = (a * (1.0 - x) + b * x) * (1.0 - y) + (c * (1.0 - x) + d * x) * y;
                mean = mean + at * f64::from(p.solid_angle);
                total += f64::from(p.solid_angle);
            }
            let mean = view.sample_from_lab.apply(mean * (1.0 / total));
            let mean = Vec3::new(mean.x, mean.y.abs(), mean.z);
            // of a bin: ∫ d dω / ∫ dω in closed form
            let (ca, cb) = (bins.cos_bounds[to], bins.cos_bounds[to + 1]);
            let cap = to == 0 && ca >= 1.0 - 1e-15;
            let (p, q) = if cap {
                (0.0, std::f64::consts::PI)
            } else {
                (bins.phi_bounds[phi], bins.phi_bounds[phi + 1])
            };
            let (ta, tb) = (ca.min(1.0).acos(), cb.acos());
            // ∫ sin² θ dθ
            let s2 = 0.5 * (tb - ta) - 0.25 * ((2.0 * tb).sin() - (2.0 * ta).sin());
            let whole = (ca - cb) * (q - p);
            let centre = Vec3::new(
                s2 * (q.sin() - p.sin()) / whole,
                s2 * (p.cos() - q.cos()) / whole,
                0.5 * (ca + cb),
            );
            (mean - centre).norm() as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::{Pose, builtin};

    #[test]
    fn the_parts_of_the_pixels_fill_a_bin_that_is_seen_whole() {
        let mut d = builtin::description("reference").expect("known").expect("readable");
        d.camera.size = d.camera.size.map(|n| n / 2);
        d.camera.pitch_um *= 2.0;
        let map = PixelMap::new(&d);
        let weights = Weights::new(&map, &map.view(Pose::from_degrees(30.0, 0.0)), &Grid::sopp());
        // bins of 2.5° × 5° between θo = 10° and 75°; the median, as the holder cuts into some
        let mut errors: Vec<f64> = (4 * 36..31 * 36).map(|bin| (weights.coverage(bin) - 1.0).abs()).collect();
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        assert!(median < 1.8e-3, "{median:.2e}");
    }

    #[test]
    fn the_second_derivative_that_a_part_adds_is_that_of_a_parabola() {
        for t in [0.0, 0.3, 0.5, 0.9] {
            // nodes two pixels apart, x² in pixels about the point: its second derivative is 2 everywhere
            let at = |i: usize| (2.0 * (i as f64 - 1.0 - t)).powi(2);
            let sum: f64 = kernel(t, 0.25).iter().enumerate().map(|(i, k)| k * at(i)).sum();
            assert!((sum - 0.5).abs() < 1e-12, "{t}: {sum}");
        }
    }
}
