//! Flake space: what a flake inside the coat sees, from the directions outside.
//!
//! With `l`, `v` refracted into the coat, `s = l + v`, `d = l − v`:
//! `θ_inc = atan2(|d|, |s|)` (stable form of Kirchner eq. 4) and `θ_flake = atan2(|s_xy|, s_z)` (stable form of eq. 3).

use crate::{Angle, Vec3, fresnel::refract};

/// Angle of incidence on the flake and the flake's polar angle, both inside the coat.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlakeAngles {
    /// Angle of incidence on a flake that mirrors `l` into `v`.
    pub theta_inc: Angle,
    /// Polar angle of that flake's normal against the surface normal.
    pub theta_flake: Angle,
}

/// Flake angles of two unit directions outside a coat of `index` (1 for none).
#[must_use]
pub fn flake_angles(l: Vec3, v: Vec3, index: f64) -> FlakeAngles {
    let (l, v) = (refract(l, index), refract(v, index));
    let (s, d) = (l + v, l - v);
    FlakeAngles {
        theta_inc: Angle::from_radians(d.norm().atan2(s.norm())),
        theta_flake: Angle::from_radians(s.x.hypot(s.y).atan2(s.z)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Geometry;

    #[test]
    fn the_mirror_geometry_needs_a_flat_flake() {
        let (l, v) = Geometry::from_degrees(30.0, 30.0, 180.0).directions();
        let a = flake_angles(l, v, 1.5);
        assert!((a.theta_inc.sin() - 0.5 / 1.5).abs() < 1e-14 && a.theta_flake.radians() < 1e-15);
    }
}
