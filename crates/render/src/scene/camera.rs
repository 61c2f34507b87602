//! The camera: rays through places in the picture.

use gonio_optics::{Angle, Rotation, Vec3};

/// A pinhole or a camera of parallel rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub from: Vec3,
    /// Unit vectors: to the right, up, forwards.
    pub axes: [Vec3; 3],
    /// Half the height of the picture at distance 1, or, of parallel rays, its half height.
    pub half_height: f64,
    /// Whether the rays are parallel.
    pub parallel: bool,
}

impl Camera {
    /// Origin and unit direction of the ray through (x, y), both −1…1 over the picture's height, x to the right, y up; wider pictures go beyond 1 in x.
    #[must_use]
    pub fn ray(&self, x: f64, y: f64) -> (Vec3, Vec3) {
        let [right, up, forwards] = self.axes;
        let (x, y) = (x * self.half_height, y * self.half_height);
        if self.parallel {
            (self.from + right * x + up * y, forwards)
        } else {
            (self.from, (forwards + right * x + up * y).normalized())
        }
    }

    /// Turned about the vertical through `about`.
    #[must_use]
    pub fn turned(&self, about: Vec3, angle: Angle) -> Self {
        let turn = Rotation::about_axis(Vec3::Y, angle);
        Self { from: about + turn.apply(self.from - about), axes: self.axes.map(|a| turn.apply(a)), ..*self }
    }
}
