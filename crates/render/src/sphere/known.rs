//! A measured table as a renderer should see it: node values where there are any, and holes bridged only by their neighbours.

use gonio_brdf::{Brdf, Flag, Measured, Rgb};
use gonio_optics::{Geometry, Vec3};

/// Reads a table by linear interpolation over the cells that hold a value: weights of invalid cells are shared out among the others of
/// the eight around a geometry. NaN where all of them are invalid.
///
/// Takes `node` values where the table has them, else the cell means.
#[derive(Clone, Copy, Debug)]
pub struct KnownCells<'a> {
    table: &'a Measured,
}

impl<'a> KnownCells<'a> {
    /// A view of a table.
    #[must_use]
    pub const fn new(table: &'a Measured) -> Self {
        Self { table }
    }

    fn interpolate(&self, g: Geometry) -> Rgb {
        let m = self.table;
        let values = m.node.as_ref().unwrap_or(&m.values);
        let phi = crate::plots::folded(&m.grid.phi_deg, g.phi.degrees());
        let axes = [
            between(&m.grid.theta_i_deg, g.theta_i.degrees()),
            between(&m.grid.theta_o_deg, g.theta_o.degrees()),
            between(&m.grid.phi_deg, phi),
        ];
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for corner in 0..8usize {
            let pick = [0, 1, 2].map(|a| {
                let (k, t) = axes[a];
                if corner >> a & 1 == 1 { (k + 1, t) } else { (k, 1.0 - t) }
            });
            let w = pick[0].1 * pick[1].1 * pick[2].1;
            if w <= 0.0 {
                continue;
            }
            let i = m.grid.index(pick[0].0, pick[1].0, pick[2].0);
            let (Some(v), Some(flag)) = (values.get(i), m.flag.get(i)) else { continue };
            if *flag != Flag::Invalid && v.iter().all(|x| x.is_finite()) {
                total += w;
                for c in 0..3 {
                    sum[c] += w * f64::from(v[c]);
                }
            }
        }
        sum.map(|s| s / total)
    }
}

impl Brdf for KnownCells<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        self.interpolate(Geometry::from_directions(light, view))
    }
}

/// Lower neighbour and the fraction towards the next; the ends hold beyond the nodes.
fn between(nodes: &[f64], x: f64) -> (usize, f64) {
    let k = nodes.partition_point(|&n| n <= x);
    match (k.checked_sub(1).and_then(|j| nodes.get(j)), nodes.get(k)) {
        (Some(a), Some(b)) => (k - 1, (x - a) / (b - a)),
        (Some(_), None) => (k - 1, 0.0),
        _ => (0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::{Grid, models::AshikhminShirleySimplified};

    fn table() -> Measured {
        let paint =
            AshikhminShirleySimplified { diffuse: [0.3, 0.2, 0.1], specular: [0.1; 3], exponent: 20.0 };
        Measured::sampled(Grid::sopp(), &paint)
    }

    #[test]
    fn a_complete_table_reads_as_it_always_does() {
        let m = table();
        for (i, o, p) in [(33.0, 12.0, 71.0), (0.0, 0.0, 0.0), (90.0, 90.0, 180.0), (62.2, 88.8, 179.0)] {
            let g = Geometry::from_degrees(i, o, p);
            let (a, b) = (KnownCells::new(&m).interpolate(g), m.interpolate(g));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-9 * (1.0 + b[c])), "{a:?} {b:?}");
        }
    }

    #[test]
    fn holes_are_bridged_by_neighbours_and_voids_say_so() {
        let mut m = table();
        let g = m.grid.geometry(5, 9, 3);
        let whole = KnownCells::new(&m).interpolate(g);
        let i = m.grid.index(5, 9, 3);
        (m.flag[i], m.values[i]) = (Flag::Invalid, [f32::NAN; 3]);
        let near = Geometry::from_degrees(26.0, 23.0, 16.0);
        assert!(KnownCells::new(&m).interpolate(near).iter().all(|v| v.is_finite()));
        assert!((KnownCells::new(&m).interpolate(near)[0] / whole[0] - 1.0).abs() < 0.05);
        m.flag.fill(Flag::Invalid);
        assert!(KnownCells::new(&m).interpolate(near)[0].is_nan());
    }
}
