//! The equations of a flake map: what each measurement says about the coefficients, and what smoothness does.

use gonio_optics::Vec3;

use super::{
    FlakeFitOptions, Sample, Transform,
    banded::Banded,
    flake_lanes::edge_factor,
    flake_map::{MAX_HARMONICS, place},
    flake_point::{FlakePoint, single},
};

/// Reflectance at which the map's own error is reckoned, 1/sr: L* = 64.
const TYPICAL: f64 = 0.1;

/// A measurement with the geometries over which it is a mean: one for a node value, several for a cell mean. Shares sum to 1.
#[derive(Clone, Debug)]
pub(super) struct Datum {
    pub(super) sample: Sample,
    pub(super) points: Vec<(Vec3, Vec3, f64)>,
}

impl Datum {
    /// A node value.
    pub(super) fn node(sample: Sample) -> Self {
        Self { sample, points: vec![(sample.light, sample.view, 1.0)] }
    }
}

/// Nodes and shape of a fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) index: f64,
    pub(super) nodes: [usize; 2],
    /// K + 1.
    pub(super) terms: usize,
    pub(super) transform: Transform,
    /// τ.
    pub(super) own_error: f64,
}

impl Shape {
    pub(super) fn of(o: &FlakeFitOptions) -> Self {
        Self {
            index: o.index,
            nodes: o.nodes,
            terms: o.harmonics + 1,
            transform: o.transform,
            own_error: o.own_error,
        }
    }

    pub(super) const fn count(&self) -> usize {
        self.nodes[0] * self.nodes[1]
    }
}

/// Share of the mean, E, and the unknowns with their factors, of one point of a datum.
type Part = (f64, f64, Vec<(usize, f64)>);

/// One datum's equation: `Σ share · c = y`.
#[derive(Clone, Debug)]
pub(super) struct Row {
    points: Vec<Part>,
    /// Unknowns and their factors in the mean over the points.
    pub(super) used: Vec<(usize, f64)>,
    /// f over the mean of E, 1/sr.
    f: [f64; 3],
    pub(super) y: [f64; 3],
    /// y of f over that of f/E, for differences.
    pub(super) scale: f64,
    pub(super) weight: f64,
}

impl Row {
    pub(super) fn new(d: &Datum, shape: &Shape, edge: f64) -> Self {
        let mut points = Vec::with_capacity(d.points.len());
        let mut used: Vec<(usize, f64)> = Vec::new();
        let mut factor = 0.0;
        for &(light, view, share) in &d.points {
            let p = FlakePoint::new(single(light), single(view), (1.0 / shape.index) as f32);
            let (corner, bilinear) = place(&p, shape.index, shape.nodes);
            let basis = p.harmonics::<{ MAX_HARMONICS + 1 }>();
            let e = f64::from(edge_factor(light.z as f32, view.z as f32, edge as f32));
            factor += share * e;
            let mut own = Vec::with_capacity(4 * shape.terms);
            for (node, part) in corner.into_iter().zip(bilinear) {
                for (k, p) in basis.iter().enumerate().take(shape.terms) {
                    let entry = (node * shape.terms + k, f64::from(part) * f64::from(*p));
                    own.push(entry);
                    match used.iter_mut().find(|(m, _)| *m == entry.0) {
                        Some((_, w)) => *w += share * entry.1,
                        None => used.push((entry.0, share * entry.1)),
                    }
                }
            }
            points.push((share, e, own));
        }
        let s = &d.sample;
        let f = s.value.map(|f| f / factor);
        // of the three channels the mean: one weight keeps one matrix for all of them
        let deviation = |c: usize| shape.transform.slope(f[c]) * s.sigma[c] / factor;
        let variance = (0..3).map(|c| deviation(c).powi(2)).sum::<f64>() / 3.0;
        let own = shape.own_error * TYPICAL * shape.transform.slope(TYPICAL);
        let scale = match shape.transform {
            Transform::Log => 1.0,
            Transform::CubeRoot => factor.cbrt(),
        };
        Self {
            points,
            used,
            y: f.map(|f| shape.transform.forward(f)),
            f,
            scale,
            weight: s.weight * scale * scale / (variance + own * own),
        }
    }

    /// y of the mean of f less the mean of y, with these coefficients: what averaging on a curved scale costs.
    fn bend(&self, shape: &Shape, coefficients: &[[f64; 3]]) -> [f64; 3] {
        let (mut mean_y, mut mean_f, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        for (share, e, own) in &self.points {
            let y = value(own, coefficients);
            total += share * e;
            for c in 0..3 {
                mean_y[c] += share * y[c];
                mean_f[c] += share * e * f64::from(shape.transform.inverse(y[c] as f32));
            }
        }
        std::array::from_fn(|c| shape.transform.forward(mean_f[c] / total) - mean_y[c])
    }

    /// y less what the coefficients say.
    pub(super) fn residual(&self, coefficients: &[[f64; 3]]) -> [f64; 3] {
        let y = value(&self.used, coefficients);
        std::array::from_fn(|c| self.y[c] - y[c])
    }

    /// Takes the target back to the mean of y that belongs to the measured mean of f.
    pub(super) fn unbend(&mut self, shape: &Shape, coefficients: &[[f64; 3]]) {
        if self.points.len() > 1 {
            let bend = self.bend(shape, coefficients);
            self.y = std::array::from_fn(|c| shape.transform.forward(self.f[c]) - bend[c]);
        }
    }
}

fn value(used: &[(usize, f64)], coefficients: &[[f64; 3]]) -> [f64; 3] {
    let mut y = [0.0; 3];
    for &(m, w) in used {
        for c in 0..3 {
            y[c] += w * coefficients[m][c];
        }
    }
    y
}

/// The coefficients that fit the rows best; `None` where the equations have no solution in f64.
pub(super) fn solve<'a>(
    rows: impl Iterator<Item = &'a Row> + Clone,
    shape: &Shape,
    smoothness: f64,
) -> Option<Vec<[f64; 3]>> {
    let unknowns = shape.count() * shape.terms;
    let total: f64 = rows.clone().map(|r| r.weight).sum();
    let unit = shape.count() as f64 / total;
    // means are taken off, so that the hold on the overall level pulls towards them and not to zero
    let mut mean = [0.0; 3];
    let mut reach = 2 * shape.nodes[1] * shape.terms;
    for row in rows.clone() {
        for (mean, y) in mean.iter_mut().zip(row.y) {
            *mean += row.weight * y / total;
        }
        let ends = row.used.iter().fold((usize::MAX, 0), |(low, high), &(m, _)| (low.min(m), high.max(m)));
        reach = reach.max(ends.1 - ends.0.min(ends.1));
    }
    let mut matrix = Banded::new(unknowns, reach);
    let mut right = [vec![0.0; unknowns], vec![0.0; unknowns], vec![0.0; unknowns]];
    for row in rows {
        let w = row.weight * unit;
        for (a, &(m, p)) in row.used.iter().enumerate() {
            for (c, r) in right.iter_mut().enumerate() {
                r[m] += w * p * (row.y[c] - mean[c]);
            }
            for &(n, q) in &row.used[..=a] {
                matrix.add(m, n, w * p * q);
            }
        }
    }
    smooth(&mut matrix, shape, smoothness);
    if !matrix.solve(&mut right) {
        return None;
    }
    let level = |i: usize, c: usize| if i.is_multiple_of(shape.terms) { mean[c] } else { 0.0 };
    Some((0..unknowns).map(|i| std::array::from_fn(|c| right[c][i] + level(i, c))).collect())
}

/// λ times the squares of second differences along both axes, and a faint hold on each unknown where nothing else decides.
fn smooth(matrix: &mut Banded, shape: &Shape, smoothness: f64) {
    let ([across, along], terms) = (shape.nodes, shape.terms);
    let at = |i: usize, j: usize, k: usize| (i * along + j) * terms + k;
    let mut bend = |u: [usize; 3]| {
        for (a, &m) in u.iter().enumerate() {
            for (b, &n) in u.iter().enumerate().take(a + 1) {
                let c = [1.0, -2.0, 1.0];
                matrix.add(m, n, smoothness * c[a] * c[b]);
            }
        }
    };
    for i in 0..across {
        for j in 0..along {
            for k in 0..terms {
                if i + 2 < across {
                    bend([at(i, j, k), at(i + 1, j, k), at(i + 2, j, k)]);
                }
                if j + 2 < along {
                    bend([at(i, j, k), at(i, j + 1, k), at(i, j + 2, k)]);
                }
            }
        }
    }
    for m in 0..shape.count() * terms {
        // harmonics are held a little more: where the azimuth was not varied they stay at zero
        let hold = if m.is_multiple_of(terms) { 1e-6 } else { 1e-3 };
        matrix.add(m, m, hold * smoothness.min(1.0));
    }
}
