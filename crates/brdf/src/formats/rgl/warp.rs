//! Bilinear images over the unit square, stacks of them over incident directions, and the map that makes a density uniform.
//!
//! A density is bilinear between the nodes of a w × h image. Its integral up to x within a row is a quadratic in x between nodes; the conditional
//! c(x | y) interpolates these between rows, and the marginal m(y) integrates the rows' totals. The map is (x, y) → (c(x | y)/c(1 | y), m(y)).

use super::NAME;
use crate::formats::Problem;

/// Slices of a stack with their weights.
pub(super) type Slices = [(usize, f64)];

/// Incident directions for which a stack has slices: slice = φ index · number of θ + θ index.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    phi: Vec<f64>,
    theta: Vec<f64>,
}

impl Parameters {
    pub(super) fn new(phi: Vec<f32>, theta: Vec<f32>) -> Result<Self, Problem> {
        for (name, nodes) in [("phi_i", &phi), ("theta_i", &theta)] {
            if nodes.windows(2).any(|w| w[0] >= w[1]) {
                return Err(Problem::malformed(NAME, name, format!("{nodes:?}"), "increasing angles"));
            }
        }
        let wide = |v: Vec<f32>| v.into_iter().map(f64::from).collect();
        Ok(Self { phi: wide(phi), theta: wide(theta) })
    }

    pub(super) fn phi_len(&self) -> usize {
        self.phi.len()
    }

    pub(super) fn theta_len(&self) -> usize {
        self.theta.len()
    }

    /// The four slices around a direction; beyond the ends the last holds.
    pub(super) fn around(&self, phi: f64, theta: f64) -> [(usize, f64); 4] {
        let ((p, s), (t, u)) = (between(&self.phi, phi), between(&self.theta, theta));
        let n = self.theta.len();
        let (q, v) = ((p + 1).min(self.phi.len() - 1), (t + 1).min(n - 1));
        [
            (p * n + t, (1.0 - s) * (1.0 - u)),
            (p * n + v, (1.0 - s) * u),
            (q * n + t, s * (1.0 - u)),
            (q * n + v, s * u),
        ]
    }
}

/// Lower neighbour and the fraction towards the next, clamped to the ends.
fn between(nodes: &[f64], x: f64) -> (usize, f64) {
    if nodes.len() < 2 {
        return (0, 0.0);
    }
    let k = nodes.partition_point(|&n| n <= x).saturating_sub(1).min(nodes.len() - 2);
    (k, ((x - nodes[k]) / (nodes[k + 1] - nodes[k])).clamp(0.0, 1.0))
}

/// A stack of w × h images, x running fastest.
#[derive(Clone, Debug)]
pub(super) struct Image {
    values: Vec<f32>,
    size: [usize; 2],
}

impl Image {
    pub(super) fn new(values: Vec<f32>, size: [usize; 2]) -> Result<Self, Problem> {
        if size.iter().any(|&n| n < 2) {
            return Err(Problem::malformed(
                NAME,
                "image",
                format!("{} by {}", size[0], size[1]),
                "at least 2 by 2",
            ));
        }
        Ok(Self { values, size })
    }

    /// Bilinear value at `u` in the unit square, slices weighted.
    pub(super) fn eval(&self, u: [f64; 2], slices: &Slices) -> f64 {
        let (k, [x, y]) = patch(self.size, u);
        let w = self.size[0];
        let at = |i| lookup(&self.values, w * self.size[1], slices, i);
        (1.0 - y) * ((1.0 - x) * at(k) + x * at(k + 1)) + y * ((1.0 - x) * at(k + w) + x * at(k + w + 1))
    }
}

/// First node of the patch around `u`, and the place within the patch.
fn patch(size: [usize; 2], u: [f64; 2]) -> (usize, [f64; 2]) {
    let axis = |a: usize| {
        let x = u[a].clamp(0.0, 1.0) * (size[a] - 1) as f64;
        // the cast takes NaN to 0
        let k = (x as usize).min(size[a] - 2);
        (k, x - k as f64)
    };
    let ((i, x), (j, y)) = (axis(0), axis(1));
    (j * size[0] + i, [x, y])
}

/// Weighted sum over slices of `size` entries each.
fn lookup(values: &[f32], size: usize, slices: &Slices, index: usize) -> f64 {
    slices
        .iter()
        .filter(|(_, w)| *w != 0.0)
        .map(|(k, w)| w * values.get(k * size + index).map_or(0.0, |&v| f64::from(v)))
        .sum()
}

/// A stack of densities, each normalised, with its cumulative sums.
#[derive(Clone, Debug)]
pub(super) struct Warp {
    size: [usize; 2],
    density: Vec<f32>,
    /// Integral along the row up to each node.
    conditional: Vec<f32>,
    /// Integral of the rows' totals up to each row.
    marginal: Vec<f32>,
}

impl Warp {
    pub(super) fn new(values: &[f32], size: [usize; 2]) -> Result<Self, Problem> {
        let [w, h] = size;
        if w < 2 || h < 2 || values.iter().any(|&v| v < 0.0) {
            let found = format!("{w} by {h}, or with a negative value");
            return Err(Problem::malformed(NAME, "vndf", found, "a density of at least 2 by 2"));
        }
        let mut out = Self { size, density: Vec::new(), conditional: Vec::new(), marginal: Vec::new() };
        for slice in values.chunks_exact(w * h) {
            let mut rows = Vec::with_capacity(w * h);
            for row in slice.chunks_exact(w) {
                let mut sum = 0.0;
                rows.push(sum);
                for pair in row.windows(2) {
                    sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1]));
                    rows.push(sum);
                }
            }
            let totals: Vec<f64> = rows.chunks_exact(w).filter_map(|r| r.last().copied()).collect();
            let mut sum = 0.0;
            let mut columns = vec![0.0];
            for pair in totals.windows(2) {
                sum += 0.5 * (pair[0] + pair[1]);
                columns.push(sum);
            }
            let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            out.density.extend(slice.iter().map(|&v| (f64::from(v) * scale) as f32));
            out.conditional.extend(rows.iter().map(|r| (r * scale) as f32));
            out.marginal.extend(columns.iter().map(|c| (c * scale) as f32));
        }
        Ok(out)
    }

    /// Where `u` comes from in the square in which the density is uniform.
    pub(super) fn invert(&self, u: [f64; 2], slices: &Slices) -> [f64; 2] {
        let [w, h] = self.size;
        let (k, [x, y]) = patch(self.size, u);
        let row = k / w;
        let density = |i| lookup(&self.density, w * h, slices, i);
        let conditional = |i| lookup(&self.conditional, w * h, slices, i);
        let left = (1.0 - y) * density(k) + y * density(k + w);
        let right = (1.0 - y) * density(k + 1) + y * density(k + w + 1);
        let before = (1.0 - y) * conditional(k) + y * conditional(k + w);
        let (low, high) = (conditional(row * w + w - 1), conditional((row + 1) * w + w - 1));
        let total = (1.0 - y) * low + y * high;
        let along = before + x * (left + 0.5 * x * (right - left));
        let up = lookup(&self.marginal, h, slices, row) + y * (low + 0.5 * y * (high - low));
        [if total > 0.0 { (along / total).clamp(0.0, 1.0) } else { 0.0 }, up.clamp(0.0, 1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_density_maps_the_square_to_itself() {
        let warp = Warp::new(&[2.0; 12], [4, 3]).unwrap();
        for u in [[0.0, 0.0], [0.3, 0.7], [1.0, 1.0], [0.5, 0.25]] {
            let v = warp.invert(u, &[(0, 1.0)]);
            assert!((v[0] - u[0]).abs() < 1e-6 && (v[1] - u[1]).abs() < 1e-6, "{u:?} {v:?}");
        }
    }

    #[test]
    fn the_map_is_the_integral_of_the_density() {
        // density 1 + 2x + y over the unit square, nodes 5 by 4: m(y) = (2y + y²/2)/2.5, c(x|y) = (x + x² + xy)/(2 + y)
        let nodes: Vec<f32> =
            (0..20).map(|i| 1.0 + 2.0 * (i % 5) as f32 / 4.0 + (i / 5) as f32 / 3.0).collect();
        let warp = Warp::new(&nodes, [5, 4]).unwrap();
        for [x, y] in [[0.1, 0.9], [0.55, 0.4], [0.99, 0.01]] {
            let [c, m] = warp.invert([x, y], &[(0, 1.0)]);
            assert!(
                (c - (x + x * x + x * y) / (2.0 + y)).abs() < 1e-6
                    && (m - (2.0 * y + y * y / 2.0) / 2.5).abs() < 1e-6
            );
        }
    }
}
