//! The product grid of a measured table and the bins around its nodes.

use gonio_optics::{Angle, Geometry};

/// Nodes in degrees: angles of incidence, polar viewing angles, azimuths 0…180 (0 = the light's side). Each strictly increasing.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Angles of incidence, degrees.
    pub theta_i_deg: Vec<f64>,
    /// Polar viewing angles, degrees.
    pub theta_o_deg: Vec<f64>,
    /// Azimuths of the view against the light, degrees.
    pub phi_deg: Vec<f64>,
}

impl Grid {
    /// Sopp's grid: θi 0…90 by 5, θo 0…90 by 2.5, 36 azimuths over 0…180.
    #[must_use]
    pub fn sopp() -> Self {
        Self {
            theta_i_deg: (0..19).map(|k| f64::from(k) * 5.0).collect(),
            theta_o_deg: (0..37).map(|k| f64::from(k) * 2.5).collect(),
            phi_deg: (0..36).map(|k| f64::from(k) * 180.0 / 35.0).collect(),
        }
    }

    /// Sizes (θi, θo, φ).
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        [self.theta_i_deg.len(), self.theta_o_deg.len(), self.phi_deg.len()]
    }

    /// Whether every axis has nodes, strictly increasing and within 0…90°, 0…90°, 0…180°.
    ///
    /// # Errors
    /// What is wrong, with the axis and the node.
    pub fn check(&self) -> Result<(), String> {
        self.check_within(180.0)
    }

    /// The same for azimuths up to another limit.
    pub(crate) fn check_within(&self, azimuths: f64) -> Result<(), String> {
        let axes = [
            ("theta_i", &self.theta_i_deg, 90.0),
            ("theta_o", &self.theta_o_deg, 90.0),
            ("phi", &self.phi_deg, azimuths),
        ];
        for (name, nodes, limit) in axes {
            if nodes.is_empty() {
                return Err(format!("{name} without a node"));
            }
            // not written as x < 0 || x > limit, so that NaN is refused
            if let Some(x) = nodes.iter().find(|x| !(0.0..=limit).contains(*x)) {
                return Err(format!("{name} with a node at {x} degrees, outside 0 to {limit}"));
            }
            if let Some(w) = nodes.windows(2).find(|w| w[0] >= w[1]) {
                return Err(format!("{name} with a node at {} degrees after one at {}", w[1], w[0]));
            }
        }
        Ok(())
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape().iter().product()
    }

    /// Whether there is no cell at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Place of cell (ti, to, phi) in a table: φ runs fastest.
    #[must_use]
    pub fn index(&self, ti: usize, to: usize, phi: usize) -> usize {
        (ti * self.theta_o_deg.len() + to) * self.phi_deg.len() + phi
    }

    /// (ti, to, phi) of a place in a table.
    #[must_use]
    pub fn coordinates(&self, index: usize) -> [usize; 3] {
        let (no, np) = (self.theta_o_deg.len(), self.phi_deg.len());
        [index / (no * np), index / np % no, index % np]
    }

    /// Geometry of the node (ti, to, phi).
    #[must_use]
    pub fn geometry(&self, ti: usize, to: usize, phi: usize) -> Geometry {
        Geometry::from_degrees(self.theta_i_deg[ti], self.theta_o_deg[to], self.phi_deg[phi])
    }

    /// Bounds of the bin of polar viewing angle `to`: halfway to the neighbours, the outermost nodes are bounds themselves.
    #[must_use]
    pub fn theta_o_bounds(&self, to: usize) -> (Angle, Angle) {
        bounds(&self.theta_o_deg, to)
    }

    /// Bounds of the bin of azimuth `phi` within 0…180°. By mirror symmetry the bin stands for −φ as well.
    #[must_use]
    pub fn phi_bounds(&self, phi: usize) -> (Angle, Angle) {
        bounds(&self.phi_deg, phi)
    }

    /// Solid angle of the cell (to, phi) in sr, the folded side φ < 0 not counted.
    #[must_use]
    pub fn solid_angle(&self, to: usize, phi: usize) -> f64 {
        let (a, b) = self.theta_o_bounds(to);
        let (p, q) = self.phi_bounds(phi);
        (a.cos() - b.cos()) * (q - p).radians()
    }
}

fn bounds(nodes: &[f64], k: usize) -> (Angle, Angle) {
    let (low, high) = bounds_deg(nodes, k);
    (Angle::from_degrees(low), Angle::from_degrees(high))
}

/// Bounds of bin `k` in degrees, as files write them.
pub(crate) fn bounds_deg(nodes: &[f64], k: usize) -> (f64, f64) {
    let low = if k == 0 { nodes[0] } else { 0.5 * (nodes[k - 1] + nodes[k]) };
    let high = if k + 1 == nodes.len() { nodes[k] } else { 0.5 * (nodes[k] + nodes[k + 1]) };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sopps_grid_has_his_75924_values_and_covers_half_the_hemisphere() {
        let g = Grid::sopp();
        assert_eq!(g.len() * 3, 75_924);
        let total: f64 =
            (0..37).flat_map(|o| (0..36).map(move |p| (o, p))).map(|(o, p)| g.solid_angle(o, p)).sum();
        assert!((total - std::f64::consts::PI).abs() < 1e-12);
        assert_eq!(g.coordinates(g.index(3, 7, 11)), [3, 7, 11]);
    }
}
