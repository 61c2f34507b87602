//! Evaluation of a flake map at many geometries at a time: one implementation for one geometry and for many.
//!
//! Each step is a loop without a branch or a call over L geometries, which the compiler turns into vector code; [`many`] runs it with the widest
//! registers that the processor has (AVX2 where there is one). No step depends on its neighbours, so a geometry gives the same bits alone and in
//! company, on every processor: products and sums are not contracted.

use super::{flake_point::FlakePoint, transform::exp2};

/// What an evaluation reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'a> {
    /// c_k of node (inc, flake) at `(inc·row + flake)·(K + 1) + k`.
    pub(super) coefficients: &'a [[f32; 4]],
    /// Nodes over θ_flake.
    pub(super) row: usize,
    pub(super) cells: Cells,
    pub(super) inverse_index: f32,
    /// Smallest and largest y.
    pub(super) bounds: [[f32; 4]; 2],
    /// β of the edge factor.
    pub(super) edge: f32,
}

/// The nodes as a place is looked up among them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    /// Steps per sin θ_inc and per √(sin θ_flake).
    steps: [f32; 2],
    /// Where the last cell of each axis ends.
    end: [f32; 2],
    /// Where it begins.
    last: [f32; 2],
}

impl Cells {
    #[inline]
    pub(super) fn new(index: f64, nodes: [usize; 2]) -> Self {
        Self {
            steps: [(index * (nodes[0] - 1) as f64) as f32, (index.sqrt() * (nodes[1] - 1) as f64) as f32],
            end: nodes.map(|n| (n - 1) as f32),
            last: nodes.map(|n| (n - 2) as f32),
        }
    }

    /// The cell along each axis, as the lowest bits of two numbers, and the fractions towards the next nodes.
    #[inline(always)]
    pub(super) fn at(&self, p: &FlakePoint) -> [(u32, f32); 2] {
        [self.along(p.sin_inc, 0), self.along(p.root_flake, 1)]
    }

    #[inline(always)]
    fn along(&self, x: f32, axis: usize) -> (u32, f32) {
        // 2^23: adding it leaves the nearest whole number in the lowest bits. A conversion to an integer would check for what no integer holds,
        // one number at a time. Half a step below lies the cell; on a node either of its neighbours is right, the fraction says which was taken
        const WHOLE: f32 = 8_388_608.0;
        let x = below(x * self.steps[axis], self.end[axis]);
        let cell = below(above(x - 0.5, 0.0), self.last[axis]) + WHOLE;
        (cell.to_bits() & 0xffff, x - (cell - WHOLE))
    }
}

/// The larger; `low` for what is not a number.
#[inline(always)]
pub(super) fn above(x: f32, low: f32) -> f32 {
    if x > low { x } else { low }
}

/// The smaller; `high` for what is not a number.
#[inline(always)]
pub(super) fn below(x: f32, high: f32) -> f32 {
    if x < high { x } else { high }
}

/// `1 + β (1 − cos θ)^5` of light and view, not below 0.05 each.
#[inline(always)]
pub(super) fn edge_factor(cos_i: f32, cos_o: f32, edge: f32) -> f32 {
    one_edge(cos_i, edge) * one_edge(cos_o, edge)
}

#[inline(always)]
fn one_edge(cos: f32, edge: f32) -> f32 {
    let m = above(1.0 - cos, 0.0);
    above(1.0 + edge * (m * m * m * m * m), 0.05)
}

/// f at L geometries with `N = K + 1` terms, y being log2 f or f^(1/3).
#[inline(always)]
pub(super) fn block<const N: usize, const L: usize, const LOG: bool>(
    table: &Table<'_>,
    light: &[[f32; 3]; L],
    view: &[[f32; 3]; L],
    out: &mut [[f32; 3]; L],
) {
    // plain loops throughout: a closure that is not inlined leaves the vector registers
    let (mut l, mut v) = ([[0.0; L]; 3], [[0.0; L]; 3]);
    for i in 0..L {
        for c in 0..3 {
            l[c][i] = light[i][c];
            v[c][i] = view[i][c];
        }
    }
    let (mut first, mut a, mut b) = ([0u32; L], [0.0; L], [0.0; L]);
    let (mut p, mut scale) = ([[0.0; L]; 2], [0.0; L]);
    for i in 0..L {
        let at =
            FlakePoint::new([l[0][i], l[1][i], l[2][i]], [v[0][i], v[1][i], v[2][i]], table.inverse_index);
        let [inc, flake] = table.cells.at(&at);
        first[i] = inc.0 * table.row as u32 + flake.0;
        (a[i], b[i]) = (inc.1, flake.1);
        if N > 1 {
            [p[0][i], p[1][i]] = at.first_harmonic();
        }
        let e = edge_factor(l[2][i], v[2][i], table.edge);
        scale[i] = if below(l[2][i], v[2][i]) < 0.0 { 0.0 } else { e };
    }
    let (nodes, _) = table.coefficients.as_chunks::<N>();
    let ([low, high], row) = (table.bounds, table.row);
    for i in 0..L {
        let at = first[i] as usize;
        // it is there for every place; a map is checked when it is made
        let Some(cell) = nodes.get(at..at + row + 2) else { continue };
        let (near, far) = ([&cell[0], &cell[1]], [&cell[row], &cell[row + 1]]);
        // along θ_inc for both nodes of the other axis at once: they stand side by side
        let mut e = [[[0.0; 4]; N]; 2];
        for s in 0..2 {
            for k in 0..N {
                for c in 0..4 {
                    e[s][k][c] = near[s][k][c] + a[i] * (far[s][k][c] - near[s][k][c]);
                }
            }
        }
        let mut q = [[0.0; 4]; N];
        for k in 0..N {
            for c in 0..4 {
                q[k][c] = e[0][k][c] + b[i] * (e[1][k][c] - e[0][k][c]);
            }
        }
        let mut y = q[0];
        let mut basis = [1.0; N];
        for k in 1..N {
            basis[k] = next_harmonic(k, p[0][i], p[1][i], &basis);
            for c in 0..4 {
                y[c] += q[k][c] * basis[k];
            }
        }
        for c in 0..4 {
            let z = below(above(y[c], low[c]), high[c]);
            y[c] = if LOG { z } else { scale[i] * (z * z * z) };
        }
        out[i] = [y[0], y[1], y[2]];
    }
    if LOG {
        for (f, scale) in out.iter_mut().zip(&scale) {
            for y in f {
                *y = scale * exp2(*y);
            }
        }
    }
}

/// P_k from those before it, P_1 and the square of its amplitude (Chebyshev).
#[inline(always)]
pub(super) fn next_harmonic(k: usize, first: f32, square: f32, before: &[f32]) -> f32 {
    if k == 1 { first } else { 2.0 * first * before[k - 1] - square * before[k - 2] }
}

/// Geometries in a block: enough that the loops' own cost is small, few enough that what they hold stays in the innermost cache.
const LANES: usize = 32;

struct Many<'a, const N: usize, const LOG: bool> {
    table: Table<'a>,
    light: &'a [[f32; 3]],
    view: &'a [[f32; 3]],
    out: &'a mut [[f32; 3]],
}

impl<const N: usize, const LOG: bool> pulp::WithSimd for Many<'_, N, LOG> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let count = self.light.len().min(self.view.len()).min(self.out.len());
        let (lights, light) = self.light[..count].as_chunks::<LANES>();
        let (views, view) = self.view[..count].as_chunks::<LANES>();
        let (outs, out) = self.out[..count].as_chunks_mut::<LANES>();
        for ((l, v), f) in lights.iter().zip(views).zip(outs) {
            block::<N, LANES, LOG>(&self.table, l, v, f);
        }
        for ((l, v), f) in light.iter().zip(view).zip(out) {
            block::<N, 1, LOG>(&self.table, &[*l], &[*v], std::array::from_mut(f));
        }
    }
}

/// f of many geometries; ends with the shortest of the three slices.
pub(super) fn many<const N: usize, const LOG: bool>(
    table: Table<'_>,
    light: &[[f32; 3]],
    view: &[[f32; 3]],
    out: &mut [[f32; 3]],
) {
    pulp::Arch::new().dispatch(Many::<N, LOG> { table, light, view, out });
}
