//! A measurement geometry (θi, θo, φ) and its directions in the sample frame.

use crate::{Angle, Vec3};

/// Angles of light and view in the sample frame. φ = φo − φi; 0° is the light's own side, 180° the mirror side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geometry {
    /// Polar angle of the light.
    pub theta_i: Angle,
    /// Polar angle of the view.
    pub theta_o: Angle,
    /// Azimuth of the view against the light.
    pub phi: Angle,
}

impl Geometry {
    /// A geometry from degrees, for the edges of the program.
    #[must_use]
    pub const fn from_degrees(theta_i_deg: f64, theta_o_deg: f64, phi_deg: f64) -> Self {
        Self {
            theta_i: Angle::from_degrees(theta_i_deg),
            theta_o: Angle::from_degrees(theta_o_deg),
            phi: Angle::from_degrees(phi_deg),
        }
    }

    /// Unit directions `(l, v)` towards light and viewer: `l` in the xz plane.
    #[must_use]
    pub fn directions(self) -> (Vec3, Vec3) {
        (Vec3::from_polar(self.theta_i, Angle::ZERO), Vec3::from_polar(self.theta_o, self.phi))
    }

    /// The geometry of two unit directions in the sample frame, φ folded to [0°, 180°]; φ = 0 where an azimuth is undefined.
    #[must_use]
    pub fn from_directions(l: Vec3, v: Vec3) -> Self {
        let theta = |d: Vec3| Angle::from_radians(d.x.hypot(d.y).atan2(d.z));
        let cross = l.x * v.y - l.y * v.x;
        let dot = l.x * v.x + l.y * v.y;
        Self { theta_i: theta(l), theta_o: theta(v), phi: Angle::from_radians(cross.abs().atan2(dot)) }
    }

    /// Light and view exchanged (Helmholtz).
    #[must_use]
    pub const fn swapped(self) -> Self {
        Self { theta_i: self.theta_o, theta_o: self.theta_i, phi: self.phi }
    }

    /// Angle between the view and the mirror direction of the light.
    #[must_use]
    pub fn from_mirror(self) -> Angle {
        let (l, v) = self.directions();
        v.angle_to(Vec3::new(-l.x, -l.y, l.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_angles_are_inverse() {
        let g = Geometry::from_degrees(35.0, 62.5, 140.0);
        let (l, v) = g.directions();
        let back = Geometry::from_directions(l, v);
        assert!((back.theta_i - g.theta_i).abs().radians() < 1e-15);
        assert!((back.theta_o - g.theta_o).abs().radians() < 1e-15);
        assert!((back.phi - g.phi).abs().radians() < 1e-15);
    }

    #[test]
    fn the_mirror_direction_lies_at_phi_180() {
        assert!(Geometry::from_degrees(40.0, 40.0, 180.0).from_mirror().degrees() < 1e-12);
        assert!((Geometry::from_degrees(40.0, 40.0, 0.0).from_mirror().degrees() - 80.0).abs() < 1e-12);
    }
}
