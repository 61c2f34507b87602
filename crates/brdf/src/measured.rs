//! A measured BRDF on a product grid, with a standard uncertainty and a flag per cell.

use std::collections::BTreeMap;

use gonio_optics::{Angle, Geometry, Vec3};

use crate::{Brdf, Grid, Rgb};

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Flag {
    /// Measured.
    Measured = 0,
    /// Filled from neighbours or by reciprocity.
    Filled = 1,
    /// Beyond the limit of the measurement.
    Extrapolated = 2,
    /// No value.
    Invalid = 3,
}

impl Flag {
    /// The flag of a byte in a file.
    #[must_use]
    pub const fn from_byte(b: u8) -> Option<Self> {
        match b {
            0 => Some(Self::Measured),
            1 => Some(Self::Filled),
            2 => Some(Self::Extrapolated),
            3 => Some(Self::Invalid),
            _ => None,
        }
    }
}

/// What a number in the table stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meaning {
    /// f at the node.
    Node,
    /// The solid-angle mean of f over the bin in (θo, φ) and over the lamp's disc; θi is that of the pose.
    CellMean {
        /// Angular radius α of the lamp.
        lamp_half_angle: Angle,
    },
}

/// A measured table; `values`, `sigma`, `flag` run as [`Grid::index`] says.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Nodes.
    pub grid: Grid,
    /// Cell means or node values.
    pub meaning: Meaning,
    /// f in 1/sr.
    pub values: Vec<[f32; 3]>,
    /// Standard uncertainty (k = 1) in 1/sr.
    pub sigma: Vec<[f32; 3]>,
    /// What is known of the cell (all channels alike).
    pub flag: Vec<Flag>,
    /// Base coat under a clear coat (two-way form), where it was separated.
    pub base: Option<Vec<[f32; 3]>>,
    /// The same in single-pass form (Sopp 4.20: divided by 1 − F(θi)), not reciprocal.
    pub base_single_pass: Option<Vec<[f32; 3]>>,
    /// Node values for renderers, where they were derived from cell means.
    pub node: Option<Vec<[f32; 3]>>,
    /// Parts of `sigma` kept apart (shot, reference, flakes, …), by name.
    pub sigma_parts: BTreeMap<String, Vec<[f32; 3]>>,
    /// Sample record, conventions and provenance, as written in files; no clock, host or path.
    pub attributes: BTreeMap<String, String>,
}

impl Measured {
    /// A table of invalid cells.
    #[must_use]
    pub fn empty(grid: Grid, meaning: Meaning) -> Self {
        let n = grid.len();
        Self {
            grid,
            meaning,
            values: vec![[0.0; 3]; n],
            sigma: vec![[0.0; 3]; n],
            flag: vec![Flag::Invalid; n],
            base: None,
            base_single_pass: None,
            node: None,
            sigma_parts: BTreeMap::new(),
            attributes: BTreeMap::new(),
        }
    }

    /// A table of node values taken from a BRDF; cells where it gives no finite number are invalid.
    #[must_use]
    pub fn sampled(grid: Grid, brdf: &dyn Brdf) -> Self {
        let mut m = Self::empty(grid, Meaning::Node);
        for i in 0..m.grid.len() {
            let [ti, to, phi] = m.grid.coordinates(i);
            let (l, v) = m.grid.geometry(ti, to, phi).directions();
            let f = brdf.eval(l, v).map(|x| x as f32);
            if f.iter().all(|x| x.is_finite()) {
                m.values[i] = f;
                m.flag[i] = Flag::Measured;
            }
        }
        m
    }

    /// f by linear interpolation between nodes; outside the nodes the nearest one counts.
    ///
    /// Invalid cells do not take part: the others of the eight share their weight, and where none is valid f is 0.
    /// An angle that is not a number gives NaN.
    #[must_use]
    pub fn interpolate(&self, g: Geometry) -> Rgb {
        if [g.theta_i, g.theta_o, g.phi].iter().any(|a| a.radians().is_nan()) {
            return [f64::NAN; 3];
        }
        let axes = [
            locate(&self.grid.theta_i_deg, g.theta_i.degrees()),
            locate(&self.grid.theta_o_deg, g.theta_o.degrees()),
            locate(&self.grid.phi_deg, g.phi.folded().degrees()),
        ];
        let mut out = [0.0; 3];
        let mut total = 0.0;
        for corner in 0..8 {
            let pick = [0, 1, 2].map(|a| {
                let (k, t) = axes[a];
                if corner >> a & 1 == 1 { (k + 1, t) } else { (k, 1.0 - t) }
            });
            let w: f64 = pick.iter().map(|p| p.1).product();
            if w > 0.0 {
                let i = self.grid.index(pick[0].0, pick[1].0, pick[2].0);
                if let (Some(v), Some(true)) =
                    (self.values.get(i), self.flag.get(i).map(|&f| f != Flag::Invalid))
                {
                    total += w;
                    for c in 0..3 {
                        out[c] += w * f64::from(v[c]);
                    }
                }
            }
        }
        if total > 0.0 { out.map(|v| v / total) } else { out }
    }
}

/// Lower neighbour and the fraction towards the next.
pub(crate) fn locate(nodes: &[f64], x: f64) -> (usize, f64) {
    let last = nodes.len().saturating_sub(1);
    // not a number: the first node
    if last == 0 || x.is_nan() || x <= nodes[0] {
        return (0, 0.0);
    }
    if x >= nodes[last] {
        return (last - 1, 1.0);
    }
    let k = nodes.partition_point(|&n| n <= x).saturating_sub(1);
    (k, (x - nodes[k]) / (nodes[k + 1] - nodes[k]))
}

impl Brdf for Measured {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        self.interpolate(Geometry::from_directions(light, view))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::Lambert;

    #[test]
    fn no_geometry_panics_and_invalid_cells_do_not_darken_their_neighbours() {
        let mut m = Measured::sampled(Grid::sopp(), &Lambert { diffuse: [0.3, 0.5, 0.7] });
        for i in (0..m.grid.len()).step_by(3) {
            m.flag[i] = Flag::Invalid;
            m.values[i] = [0.0; 3];
        }
        for deg in [11.0, 33.0, 57.0, 77.0] {
            let f = m.interpolate(Geometry::from_degrees(deg, deg + 8.0, 2.1 * deg));
            let expected = [0.3, 0.5, 0.7].map(|d| d / std::f64::consts::PI);
            assert!((0..3).all(|c| (f[c] - expected[c]).abs() < 1e-7), "{deg}: {f:?}");
        }
        for deg in [-10.0, 0.0, 90.0, 1e9, f64::INFINITY] {
            let f = m.interpolate(Geometry::from_degrees(deg, deg, deg));
            assert!(f.iter().all(|x| x.is_finite()), "{deg}: {f:?}");
        }
        assert!(m.interpolate(Geometry::from_degrees(f64::NAN, 0.0, 0.0))[0].is_nan());
        assert_eq!(locate(&[0.0, 1.0], f64::NAN), (0, 0.0));
    }

    #[test]
    fn a_table_without_cells_is_black() {
        let grid = Grid { theta_i_deg: vec![], theta_o_deg: vec![], phi_deg: vec![] };
        let m = Measured::empty(grid, Meaning::Node);
        assert_eq!(m.interpolate(Geometry::from_degrees(10.0, 10.0, 10.0)), [0.0; 3]);
    }
}
