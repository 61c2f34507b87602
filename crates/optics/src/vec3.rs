//! Three-component vectors: directions are unit length, points are in millimetres.

use std::ops::{Add, Mul, Neg, Sub};

/// A vector, direction or point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec3 {
    /// First component.
    pub x: f64,
    /// Second component.
    pub y: f64,
    /// Third component.
    pub z: f64,
}

impl Vec3 {
    /// The x axis.
    pub const X: Self = Self::new(1.0, 0.0, 0.0);
    /// The y axis.
    pub const Y: Self = Self::new(0.0, 1.0, 0.0);
    /// The z axis; the outward normal of a sample in its own frame.
    pub const Z: Self = Self::new(0.0, 0.0, 1.0);
    /// The origin.
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    /// A vector from its components.
    #[must_use]
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// The unit direction with polar angle `theta` from +z and azimuth `phi` from +x.
    #[must_use]
    pub fn from_polar(theta: crate::Angle, phi: crate::Angle) -> Self {
        let (st, ct) = theta.sin_cos();
        let (sp, cp) = phi.sin_cos();
        Self::new(st * cp, st * sp, ct)
    }

    /// Scalar product.
    #[must_use]
    pub fn dot(self, o: Self) -> f64 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Vector product.
    #[must_use]
    pub fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    /// Squared length.
    #[must_use]
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// Length.
    #[must_use]
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// The unit vector along this one; the zero vector stays zero.
    #[must_use]
    pub fn normalized(self) -> Self {
        let n = self.norm();
        if n > 0.0 { self * (1.0 / n) } else { self }
    }

    /// Angle between two vectors, accurate for nearly parallel and nearly opposite ones (2 atan2(|a−b|, |a+b|) on unit vectors).
    #[must_use]
    pub fn angle_to(self, o: Self) -> crate::Angle {
        let (a, b) = (self.normalized(), o.normalized());
        crate::Angle::from_radians(2.0 * (a - b).norm().atan2((a + b).norm()))
    }

    /// Two unit vectors that complete this unit vector to a right-handed orthonormal basis (u, v, self).
    #[must_use]
    pub fn orthonormal_basis(self) -> (Self, Self) {
        // Duff et al. 2017, "Building an orthonormal basis, revisited".
        let s = 1.0f64.copysign(self.z);
        let a = -1.0 / (s + self.z);
        let b = self.x * self.y * a;
        (
            Self::new(1.0 + s * self.x * self.x * a, s * b, -s * self.x),
            Self::new(b, s + self.y * self.y * a, -self.y),
        )
    }

    /// Components as an array.
    #[must_use]
    pub const fn to_array(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }
}

impl From<[f64; 3]> for Vec3 {
    fn from(a: [f64; 3]) -> Self {
        Self::new(a[0], a[1], a[2])
    }
}

impl Add for Vec3 {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl Sub for Vec3 {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Self;
    fn mul(self, s: f64) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(0.3, -0.5, -0.2).normalized()] {
            let (u, v) = n.orthonormal_basis();
            assert!(u.dot(v).abs() < 1e-15 && u.dot(n).abs() < 1e-15);
            assert!((u.cross(v) - n).norm() < 1e-14);
        }
    }
}
