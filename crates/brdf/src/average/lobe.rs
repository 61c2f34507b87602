//! Cell means of the Ashikhmin–Shirley lobe for any exponent, fast: the directions of the quadrature do not depend on the exponent, so
//! they are worked out once per grid.
//!
//! With u = −ln(n·h) ≥ 0 at a node, `S(n) = (n + 1) Σ_j k_j exp(−n u_j)`, `k_j = w_j/(8π (h·v) max(n·l, n·v))`; Schlick's factor splits it as
//! `r0 P + (1 − r0) Q`, Q with k_j (1 − h·v)^5. The nodes are kept per octave of the exponent and per θi, made when first asked for.

use std::f64::consts::PI;
use std::sync::OnceLock;

use gonio_optics::{Angle, Vec3};

use super::{CellBounds, Plan, is_cap};
use crate::{
    Grid, Meaning,
    models::half::{Half, larger_cos},
};

/// Smallest exponent with nodes of its own; smaller ones use the same.
pub const MIN_EXPONENT: f64 = 1.0;
/// Largest exponent with nodes of its own; larger ones use the same and lose accuracy.
pub const MAX_EXPONENT: f64 = 131_072.0;
/// Octaves between the two.
const LEVELS: usize = 17;

/// Lobe at one cell: P without Fresnel factor, Q with (1 − h·v)^5, and their derivatives by ln n.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeValue {
    /// Mean of S(n).
    pub p: f64,
    /// Mean of S(n)(1 − h·v)^5.
    pub q: f64,
    /// dP/d ln n.
    pub dp: f64,
    /// dQ/d ln n.
    pub dq: f64,
}

/// Quadrature nodes of many cells, one after the other.
#[derive(Clone, Debug, Default)]
pub struct LobeNodes {
    /// Nodes of cell i are `start[i]..start[i + 1]`.
    start: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Weight and denominator.
    k: f64,
    /// −ln(n·h).
    u: f64,
    /// (1 − h·v)^5.
    m: f64,
}

impl LobeNodes {
    /// One node each for pairs of directions (light, view): values at points, not means.
    #[must_use]
    pub fn at_points(points: impl IntoIterator<Item = (Vec3, Vec3)>) -> Self {
        let mut out = Self { start: vec![0], nodes: Vec::new() };
        for (light, view) in points {
            out.push(1.0, light, view);
            out.close();
        }
        out
    }

    fn push(&mut self, weight: f64, light: Vec3, view: Vec3) {
        if light.z < 0.0 || view.z < 0.0 {
            return;
        }
        let half = Half::new(light, view);
        let m = 1.0 - half.hv.min(1.0);
        let m2 = m * m;
        self.nodes.push(Node {
            k: weight / (8.0 * PI * half.hv * larger_cos(light, view)),
            u: -0.5 * (-half.sin2).ln_1p(),
            m: m2 * m2 * m,
        });
    }

    fn close(&mut self) {
        self.start.push(u32::try_from(self.nodes.len()).unwrap_or(u32::MAX));
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// Whether there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of nodes in all cells.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    fn of(&self, cell: usize) -> &[Node] {
        match (self.start.get(cell), self.start.get(cell + 1)) {
            (Some(&a), Some(&b)) => self.nodes.get(a as usize..b as usize).unwrap_or(&[]),
            _ => &[],
        }
    }

    /// (P, Q) of a cell; zero for a cell that is not there.
    #[must_use]
    pub fn value(&self, cell: usize, exponent: f64) -> (f64, f64) {
        let (mut p, mut q) = (0.0, 0.0);
        for n in self.of(cell) {
            let x = exponent * n.u;
            // false for the NaN of 0 · ∞, too
            if x < 700.0 {
                let e = n.k * (-x).exp();
                p += e;
                q += e * n.m;
            }
        }
        ((exponent + 1.0) * p, (exponent + 1.0) * q)
    }

    /// P, Q and their derivatives by ln n: dS/d ln n = n (S/(n + 1) − (n + 1) Σ k u e^(−nu)), the mean of Sopp's (4.29).
    #[must_use]
    pub fn with_derivative(&self, cell: usize, exponent: f64) -> LobeValue {
        let mut v = LobeValue::default();
        for n in self.of(cell) {
            let x = exponent * n.u;
            if x < 700.0 {
                let e = n.k * (-x).exp();
                v.p += e;
                v.q += e * n.m;
                v.dp += e * (1.0 - (exponent + 1.0) * n.u);
                v.dq += e * (1.0 - (exponent + 1.0) * n.u) * n.m;
            }
        }
        LobeValue {
            p: v.p * (exponent + 1.0),
            q: v.q * (exponent + 1.0),
            dp: v.dp * exponent,
            dq: v.dq * exponent,
        }
    }
}

/// Lobe means on a grid.
#[derive(Debug)]
pub struct LobeCells {
    grid: Grid,
    meaning: Meaning,
    max_theta_o: Angle,
    /// `[level][theta_i]`, made when first asked for.
    rows: Vec<OnceLock<LobeNodes>>,
}

impl LobeCells {
    /// For the cells of `grid` whose node has θo ≤ `max_theta_o`; the others have no value.
    #[must_use]
    pub fn new(grid: Grid, meaning: Meaning, max_theta_o: Angle) -> Self {
        let rows = (0..LEVELS * grid.theta_i_deg.len()).map(|_| OnceLock::new()).collect();
        Self { grid, meaning, max_theta_o, rows }
    }

    /// Whether this serves the same cells.
    #[must_use]
    pub fn serves(&self, grid: &Grid, meaning: Meaning, max_theta_o: Angle) -> bool {
        self.meaning == meaning && self.max_theta_o == max_theta_o && self.grid == *grid
    }

    /// Nodes of the cells (to, phi) of row `theta_i`, φ fastest, for a given exponent; none for a row that is not there.
    ///
    /// Cells of the cap θo = 0 are all alike.
    #[must_use]
    pub fn row(&self, theta_i: usize, exponent: f64) -> &LobeNodes {
        static NONE: LobeNodes = LobeNodes { start: Vec::new(), nodes: Vec::new() };
        let level = match self.meaning {
            Meaning::Node => 0,
            Meaning::CellMean { .. } => level(exponent),
        };
        match self.rows.get(level * self.grid.theta_i_deg.len() + theta_i) {
            Some(row) if theta_i < self.grid.theta_i_deg.len() => {
                row.get_or_init(|| self.make(theta_i, level))
            }
            _ => &NONE,
        }
    }

    fn make(&self, ti: usize, level: usize) -> LobeNodes {
        let low = MIN_EXPONENT * (level as f64).exp2();
        let plan = Plan::lobes(if level == 0 { 0.1 } else { low }, 2.0 * low);
        let [_, no, np] = self.grid.shape();
        let mut out = LobeNodes { start: vec![0], nodes: Vec::new() };
        for to in 0..no {
            let inside = self.grid.theta_o_deg[to] <= self.max_theta_o.degrees() + 1e-9;
            for phi in 0..np {
                // the cap is one cell: its nodes stand under φ = 0 alone and are copied
                if inside && is_cap(&self.grid, to) && phi > 0 {
                    let first = out.of(0).to_vec();
                    out.nodes.extend(first);
                } else if inside {
                    match self.meaning {
                        Meaning::Node => {
                            let (l, v) = self.grid.geometry(ti, to, phi).directions();
                            out.push(1.0, l, v);
                        }
                        Meaning::CellMean { lamp_half_angle } => {
                            let b = CellBounds::of(&self.grid, lamp_half_angle, [ti, to, phi]);
                            plan.samples(&b, &mut |w, l, v| out.push(w, l, v));
                        }
                    }
                }
                out.close();
            }
        }
        out
    }
}

fn level(exponent: f64) -> usize {
    let l = (exponent / MIN_EXPONENT).max(1.0).log2().floor();
    if l.is_finite() { (l as usize).min(LEVELS - 1) } else { LEVELS - 1 }
}
