//! Rotations and rigid transforms, named `to_from`: `sample_from_lab.apply(d_lab)` is `d` in the sample frame.

use crate::{Angle, Vec3};

/// A proper rotation; rows are the images' coordinate axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    rows: [Vec3; 3],
}

impl Rotation {
    /// No rotation.
    pub const IDENTITY: Self = Self { rows: [Vec3::X, Vec3::Y, Vec3::Z] };

    /// The rotation whose image axes, expressed in the source frame, are `x`, `y`, `z` (orthonormal, right-handed).
    #[must_use]
    pub const fn from_axes(x: Vec3, y: Vec3, z: Vec3) -> Self {
        Self { rows: [x, y, z] }
    }

    /// Right-handed turn of vectors by `angle` about `axis` (Rodrigues).
    #[must_use]
    pub fn about_axis(axis: Vec3, angle: Angle) -> Self {
        let k = axis.normalized();
        let (s, c) = angle.sin_cos();
        let turn = |e: Vec3| e * c + k.cross(e) * s + k * (k.dot(e) * (1.0 - c));
        let (a, b, d) = (turn(Vec3::X), turn(Vec3::Y), turn(Vec3::Z));
        Self { rows: [Vec3::new(a.x, b.x, d.x), Vec3::new(a.y, b.y, d.y), Vec3::new(a.z, b.z, d.z)] }
    }

    /// Turns by the rotation vector `r` (axis times radians).
    #[must_use]
    pub fn from_vector(r: Vec3) -> Self {
        let n = r.norm();
        if n == 0.0 { Self::IDENTITY } else { Self::about_axis(r, Angle::from_radians(n)) }
    }

    /// The rotated vector.
    #[must_use]
    pub fn apply(self, v: Vec3) -> Vec3 {
        Vec3::new(self.rows[0].dot(v), self.rows[1].dot(v), self.rows[2].dot(v))
    }

    /// The opposite rotation (transpose).
    #[must_use]
    pub const fn inverse(self) -> Self {
        let [a, b, c] = self.rows;
        Self { rows: [Vec3::new(a.x, b.x, c.x), Vec3::new(a.y, b.y, c.y), Vec3::new(a.z, b.z, c.z)] }
    }

    /// `self` after `first`.
    #[must_use]
    pub fn after(self, first: Self) -> Self {
        // columns of `first` are the rows of its inverse
        let columns = first.inverse().rows;
        let row = |r: Vec3| Vec3::new(r.dot(columns[0]), r.dot(columns[1]), r.dot(columns[2]));
        Self { rows: self.rows.map(row) }
    }
}

/// A rotation followed by a translation (mm).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// Turns first.
    pub rotation: Rotation,
    /// Shifts after, in the image frame, mm.
    pub translation_mm: Vec3,
}

impl Rigid {
    /// The identity.
    pub const IDENTITY: Self = Self { rotation: Rotation::IDENTITY, translation_mm: Vec3::ZERO };

    /// The image of a point.
    #[must_use]
    pub fn apply_point(self, p: Vec3) -> Vec3 {
        self.rotation.apply(p) + self.translation_mm
    }

    /// The image of a direction (no translation).
    #[must_use]
    pub fn apply_direction(self, d: Vec3) -> Vec3 {
        self.rotation.apply(d)
    }

    /// The opposite transform.
    #[must_use]
    pub fn inverse(self) -> Self {
        let r = self.rotation.inverse();
        Self { rotation: r, translation_mm: -r.apply(self.translation_mm) }
    }

    /// `self` after `first`.
    #[must_use]
    pub fn after(self, first: Self) -> Self {
        Self {
            rotation: self.rotation.after(first.rotation),
            translation_mm: self.rotation.apply(first.translation_mm) + self.translation_mm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turn_about_z_takes_x_to_y() {
        let r = Rotation::about_axis(Vec3::Z, Angle::RIGHT);
        assert!((r.apply(Vec3::X) - Vec3::Y).norm() < 1e-15);
    }

    #[test]
    fn composition_and_inverse_agree_with_application() {
        let a = Rigid {
            rotation: Rotation::from_vector(Vec3::new(0.2, -0.4, 0.9)),
            translation_mm: Vec3::new(1.0, 2.0, 3.0),
        };
        let b = Rigid {
            rotation: Rotation::from_vector(Vec3::new(-1.2, 0.1, 0.3)),
            translation_mm: Vec3::new(-4.0, 0.5, 2.0),
        };
        let p = Vec3::new(0.3, 0.7, -1.1);
        assert!((a.after(b).apply_point(p) - a.apply_point(b.apply_point(p))).norm() < 1e-14);
        assert!((a.inverse().apply_point(a.apply_point(p)) - p).norm() < 1e-14);
    }
}
