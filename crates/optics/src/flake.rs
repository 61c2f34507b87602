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

/// Lengths of sum and difference of the refracted directions: the flake angles without an inverse function, for look-ups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeVectors {
    /// |s|, 2 cos θ_inc.
    pub sum: f64,
    /// |d|, 2 sin θ_inc.
    pub difference: f64,
    /// |s_xy|, |s| sin θ_flake.
    pub sum_xy: f64,
    /// s_z, |s| cos θ_flake.
    pub sum_z: f64,
}

impl FlakeVectors {
    /// Of two unit directions outside a coat of `index` (1 for none).
    #[must_use]
    pub fn new(l: Vec3, v: Vec3, index: f64) -> Self {
        Self::inside(refract(l, index), refract(v, index))
    }

    /// Of two unit directions inside the coat.
    #[must_use]
    pub fn inside(l: Vec3, v: Vec3) -> Self {
        let s = l + v;
        let sum_xy = s.x.hypot(s.y);
        Self { sum: sum_xy.hypot(s.z), difference: (l - v).norm(), sum_xy, sum_z: s.z }
    }

    /// The angles.
    #[must_use]
    pub fn angles(self) -> FlakeAngles {
        FlakeAngles {
            theta_inc: Angle::from_radians(self.difference.atan2(self.sum)),
            theta_flake: Angle::from_radians(self.sum_xy.atan2(self.sum_z)),
        }
    }

    /// `sin(θ_inc + θ_flake)`: sin θ_inc cos θ_flake + cos θ_inc sin θ_flake with |s|² + |d|² = 4.
    #[must_use]
    pub fn sin_sum(self) -> f64 {
        0.5 * (self.difference * self.cos_flake() + self.sum_xy)
    }

    /// `sin(θ_inc − θ_flake)`; positive on the mirror side.
    #[must_use]
    pub fn sin_difference(self) -> f64 {
        0.5 * (self.difference * self.cos_flake() - self.sum_xy)
    }

    /// `cos(θ_inc + θ_flake)`.
    #[must_use]
    pub fn cos_sum(self) -> f64 {
        0.5 * (self.sum_z - self.difference * self.sin_flake())
    }

    /// cos θ_flake; the flake lies flat where light and view are opposite (|s| = 0, both at 90°).
    fn cos_flake(self) -> f64 {
        if self.sum > 0.0 { self.sum_z / self.sum } else { 1.0 }
    }

    fn sin_flake(self) -> f64 {
        if self.sum > 0.0 { self.sum_xy / self.sum } else { 0.0 }
    }
}

/// Flake angles of two unit directions outside a coat of `index` (1 for none).
#[must_use]
pub fn flake_angles(l: Vec3, v: Vec3, index: f64) -> FlakeAngles {
    FlakeVectors::new(l, v, index).angles()
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

    #[test]
    fn sums_of_the_angles_agree_with_trigonometry() {
        for (ti, to, phi) in [(10.0, 60.0, 35.0), (80.0, 85.0, 120.0), (0.0, 0.0, 0.0), (90.0, 90.0, 180.0)] {
            let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
            let f = FlakeVectors::new(l, v, 1.5);
            let a = f.angles();
            assert!((f.sin_sum() - (a.theta_inc + a.theta_flake).sin()).abs() < 1e-15);
            assert!((f.sin_difference() - (a.theta_inc - a.theta_flake).sin()).abs() < 1e-15);
            assert!((f.cos_sum() - (a.theta_inc + a.theta_flake).cos()).abs() < 1e-15);
        }
    }
}
