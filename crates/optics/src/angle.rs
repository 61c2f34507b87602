//! The angle type: private radians, degrees only where a name says so.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A plane angle. Stored in radians; [`Angle::from_degrees`] and [`Angle::degrees`] are the edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Angle {
    radians: f64,
}

impl Angle {
    /// 0°.
    pub const ZERO: Self = Self { radians: 0.0 };
    /// 90°.
    pub const RIGHT: Self = Self { radians: std::f64::consts::FRAC_PI_2 };
    /// 180°.
    pub const STRAIGHT: Self = Self { radians: std::f64::consts::PI };

    /// An angle from radians.
    #[must_use]
    pub const fn from_radians(radians: f64) -> Self {
        Self { radians }
    }

    /// An angle from degrees.
    #[must_use]
    pub const fn from_degrees(degrees: f64) -> Self {
        Self { radians: degrees.to_radians() }
    }

    /// The value in radians.
    #[must_use]
    pub const fn radians(self) -> f64 {
        self.radians
    }

    /// The value in degrees.
    #[must_use]
    pub const fn degrees(self) -> f64 {
        self.radians.to_degrees()
    }

    /// Sine.
    #[must_use]
    pub fn sin(self) -> f64 {
        self.radians.sin()
    }

    /// Cosine.
    #[must_use]
    pub fn cos(self) -> f64 {
        self.radians.cos()
    }

    /// Tangent.
    #[must_use]
    pub fn tan(self) -> f64 {
        self.radians.tan()
    }

    /// Sine and cosine together.
    #[must_use]
    pub fn sin_cos(self) -> (f64, f64) {
        self.radians.sin_cos()
    }

    /// The magnitude of the angle.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self { radians: self.radians.abs() }
    }

    /// The smaller of two angles.
    #[must_use]
    pub const fn min(self, other: Self) -> Self {
        Self { radians: self.radians.min(other.radians) }
    }

    /// The larger of two angles.
    #[must_use]
    pub const fn max(self, other: Self) -> Self {
        Self { radians: self.radians.max(other.radians) }
    }

    /// Folds an azimuth difference into [0°, 180°], as isotropic samples allow.
    #[must_use]
    pub fn folded(self) -> Self {
        let turn = std::f64::consts::TAU;
        let r = self.radians.rem_euclid(turn);
        Self { radians: r.min(turn - r) }
    }
}

impl Add for Angle {
    type Output = Self;
    fn add(self, rhs: Self) -> Self {
        Self { radians: self.radians + rhs.radians }
    }
}

impl AddAssign for Angle {
    fn add_assign(&mut self, rhs: Self) {
        self.radians += rhs.radians;
    }
}

impl Sub for Angle {
    type Output = Self;
    fn sub(self, rhs: Self) -> Self {
        Self { radians: self.radians - rhs.radians }
    }
}

impl SubAssign for Angle {
    fn sub_assign(&mut self, rhs: Self) {
        self.radians -= rhs.radians;
    }
}

impl Neg for Angle {
    type Output = Self;
    fn neg(self) -> Self {
        Self { radians: -self.radians }
    }
}

impl Mul<f64> for Angle {
    type Output = Self;
    fn mul(self, rhs: f64) -> Self {
        Self { radians: self.radians * rhs }
    }
}

impl Div<f64> for Angle {
    type Output = Self;
    fn div(self, rhs: f64) -> Self {
        Self { radians: self.radians / rhs }
    }
}

/// Prints degrees with the degree sign; the precision of the formatter applies.
impl std::fmt::Display for Angle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(p) = f.precision() {
            write!(f, "{:.*}°", p, self.degrees())
        } else {
            write!(f, "{}°", self.degrees())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folding_maps_both_sides_of_the_plane_of_incidence_together() {
        for deg in [-190.0, -170.0, 170.0, 190.0, 530.0] {
            assert!((Angle::from_degrees(deg).folded().degrees() - 170.0).abs() < 1e-9);
        }
    }
}
