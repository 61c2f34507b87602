//! Turns of vectors, written for the virtual instrument alone, so that an error in the shared frame code cannot hide.

use gonio_optics::Vec3;

/// `v` turned right-handedly by `angle_rad` about the unit vector `axis` (Rodrigues).
pub(crate) fn about(v: Vec3, axis: Vec3, angle_rad: f64) -> Vec3 {
    let along = axis * axis.dot(v);
    let across = v - along;
    along + across * angle_rad.cos() + axis.cross(v) * angle_rad.sin()
}

/// `v` turned by a rotation vector: axis times angle in degrees.
pub(crate) fn by_vector_deg(v: Vec3, r_deg: Vec3) -> Vec3 {
    let size = r_deg.norm();
    if size == 0.0 { v } else { about(v, r_deg * (1.0 / size), size.to_radians()) }
}

/// The unit vector `v` turned about the two axes normal to it, `turn_deg[0]` about the first of
/// [`Vec3::orthonormal_basis`] and `turn_deg[1]` about the second (one rotation vector, not two turns in a row).
pub(crate) fn tipped(v: Vec3, turn_deg: [f64; 2]) -> Vec3 {
    let (first, second) = v.orthonormal_basis();
    by_vector_deg(v, first * turn_deg[0] + second * turn_deg[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        assert!((by_vector_deg(Vec3::X, Vec3::new(0.0, 0.0, 90.0)) - Vec3::Y).norm() < 1e-15);
    }

    #[test]
    fn tipping_moves_a_direction_by_the_length_of_the_turn() {
        let v = Vec3::new(0.67559, -0.22783, 0.70119).normalized();
        let tipped = tipped(v, [0.3, -0.4]);
        assert!((tipped.angle_to(v).degrees() - 0.5).abs() < 1e-12);
    }
}
