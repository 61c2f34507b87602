//! The lens and sensor as geometry: from a place on the sensor to a ray in the lab, and back.
//!
//! Conventions. Sensor places are `(column, row)` in pixels with (0, 0) the outer corner of the first pixel, so the centre of
//! pixel (i, j) is (i + ½, j + ½). Camera axes are right, down, look (right-handed; right = look × up, columns grow to the right and rows
//! downwards). A scene direction with components (X, Y, Z) on them has the ideal image point x = X/Z, y = Y/Z; the lens moves it to
//!
//! ```text
//! (x_d, y_d) = (x, y) · (1 + k1 r² + k2 r⁴),  r² = x² + y²
//! column = width/2  + principal_point[0] + x_d · f (1 + focal_length_error) / pitch
//! row    = height/2 + principal_point[1] + y_d · f (1 + focal_length_error) / pitch
//! ```
//!
//! The pupil is shifted in the lab; the axes are turned about it by the rotation vector `camera_turn` expressed in (right, down, look).

use gonio_instrument::{Description, Misalignment};
use gonio_optics::Vec3;

use super::turn;

/// A ray in the lab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, mm.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

/// The camera's lens and sensor.
#[derive(Clone, Debug)]
pub struct Lens {
    /// Centre of the entrance pupil, lab, mm.
    pub pupil: Vec3,
    /// Radius of the entrance pupil, mm.
    pub pupil_radius_mm: f64,
    right: Vec3,
    down: Vec3,
    look: Vec3,
    focal_px: f64,
    nominal_focal_px: f64,
    centre: [f64; 2],
    k1: f64,
    k2: f64,
}

impl Lens {
    /// The lens of an instrument with its errors.
    #[must_use]
    pub fn new(d: &Description, m: &Misalignment) -> Self {
        let c = &d.camera;
        let look = Vec3::from(c.look).normalized();
        let up = Vec3::from(c.up);
        let right = look.cross(up).normalized();
        let down = look.cross(right);
        let [tr, td, tl] = m.camera_turn_deg;
        let r = right * tr + down * td + look * tl;
        let nominal_focal_px = c.f_mm / (c.pitch_um * 1e-3);
        Self {
            pupil: Vec3::from(c.pupil) + Vec3::from(m.camera_shift_mm),
            pupil_radius_mm: 0.5 * c.pupil_diameter_mm,
            right: turn::by_vector_deg(right, r),
            down: turn::by_vector_deg(down, r),
            look: turn::by_vector_deg(look, r),
            focal_px: nominal_focal_px * (1.0 + m.focal_length_error),
            nominal_focal_px,
            centre: [
                0.5 * f64::from(c.size[0]) + m.principal_point_px[0],
                0.5 * f64::from(c.size[1]) + m.principal_point_px[1],
            ],
            k1: m.k1,
            k2: m.k2,
        }
    }

    /// The ray that a sensor place sees, and its étendue per pixel relative to the axis of the nominal lens (cos⁴ law, the
    /// lens' local scale and focal length included).
    #[must_use]
    pub fn ray(&self, column: f64, row: f64) -> (Ray, f64) {
        let xd = (column - self.centre[0]) / self.focal_px;
        let yd = (row - self.centre[1]) / self.focal_px;
        let rd = xd.hypot(yd);
        let (r, slope) = self.undistort(rd);
        let scale = if rd > 0.0 { r / rd } else { 1.0 };
        let across = self.right * (xd * scale) + self.down * (yd * scale);
        let direction = (across + self.look).normalized();
        let cos = direction.dot(self.look);
        // area of ideal image per area of sensor: tangential scale times radial slope
        let area = scale / slope;
        let focal = self.nominal_focal_px / self.focal_px;
        let cos2 = cos * cos;
        (Ray { origin: self.pupil, direction }, cos2 * cos2 * area * focal * focal)
    }

    /// Where the sensor sees a lab direction from the pupil; `None` behind the camera.
    #[must_use]
    pub fn place(&self, direction: Vec3) -> Option<[f64; 2]> {
        let z = direction.dot(self.look);
        if z <= 1e-9 {
            return None;
        }
        let (x, y) = (direction.dot(self.right) / z, direction.dot(self.down) / z);
        let r2 = x * x + y * y;
        let scale = self.focal_px * (1.0 + r2 * (self.k1 + r2 * self.k2));
        Some([self.centre[0] + x * scale, self.centre[1] + y * scale])
    }

    /// A vector in the pupil's plane from the centre, for coordinates in the unit disc.
    pub(crate) fn pupil_axes(&self) -> (Vec3, Vec3) {
        (self.right * self.pupil_radius_mm, self.down * self.pupil_radius_mm)
    }

    /// Solves r (1 + k1 r² + k2 r⁴) = `rd` by Newton; returns r and the slope d rd / d r there.
    fn undistort(&self, rd: f64) -> (f64, f64) {
        let slope_at = |r2: f64| 1.0 + r2 * (3.0 * self.k1 + 5.0 * r2 * self.k2);
        let mut r = rd;
        if self.k1 == 0.0 && self.k2 == 0.0 {
            return (r, 1.0);
        }
        for _ in 0..20 {
            let r2 = r * r;
            let step = (r * (1.0 + r2 * (self.k1 + r2 * self.k2)) - rd) / slope_at(r2).max(0.05);
            r -= step;
            if step.abs() < 1e-14 {
                break;
            }
        }
        (r, slope_at(r * r).max(0.05))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    fn lens(misaligned: bool) -> Lens {
        let d = builtin::description("reference").expect("known").expect("readable");
        let m = if misaligned { builtin::misalignment().expect("readable") } else { Misalignment::default() };
        Lens::new(&d, &m)
    }

    #[test]
    fn a_place_on_the_sensor_survives_the_way_out_and_back() {
        for misaligned in [false, true] {
            let l = lens(misaligned);
            for (c, r) in [(0.0, 0.0), (1280.0, 1024.0), (640.0, 512.0), (13.5, 900.25), (1111.0, 3.0)] {
                let [c2, r2] = l.place(l.ray(c, r).0.direction).expect("in front");
                assert!((c - c2).abs() < 1e-9 && (r - r2).abs() < 1e-9, "{c} {r} came back as {c2} {r2}");
            }
        }
    }

    #[test]
    fn rows_grow_downwards_and_the_axes_are_right_handed() {
        let l = lens(false);
        assert!((l.right.cross(l.down) - l.look).norm() < 1e-15);
        assert!(l.ray(640.0, 600.0).0.direction.y < 0.0);
        assert!(l.ray(700.0, 512.0).0.direction.x < 0.0);
    }

    #[test]
    fn etendue_is_the_area_of_the_pupil_times_the_solid_angle_of_the_pixel() {
        // by finite differences of the directions around a place
        let l = lens(true);
        let (c, r, h) = (1000.0, 200.0, 0.5);
        let d = |dc: f64, dr: f64| l.ray(c + dc, r + dr).0.direction;
        let solid = (d(h, 0.0) - d(-h, 0.0)).cross(d(0.0, h) - d(0.0, -h)).norm();
        let cos = d(0.0, 0.0).dot(l.look);
        let axis = 1.0 / (l.nominal_focal_px * l.nominal_focal_px);
        let expected = solid * cos / axis;
        assert!((l.ray(c, r).1 / expected - 1.0).abs() < 1e-5);
    }
}
