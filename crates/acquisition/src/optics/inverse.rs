//! The way back: where the sensor shows a direction, a point of the mirror, or the mirror image of the lamp.
//!
//! Directions are inverted numerically, since a ray of a misaligned instrument does not come from F1: the pixel of the nominal mirror point starts
//! a chord iteration (Newton's with the slope of its start), which ends at 1e-11 pixels after half a dozen rays.

use gonio_optics::Vec3;

use super::Optics;

/// The image of a small disc of directions: the ellipse it becomes to first order, and its true centroid to second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// Image of the disc's centre, pixels (column, row).
    pub centre_px: [f64; 2],
    /// Centroid of the image's area, pixels: off the centre's image where the scale changes across the disc.
    pub centroid_px: [f64; 2],
    /// Half axes of the ellipse: images of the disc's two radii, pixels.
    pub radii_px: [[f64; 2]; 2],
}

/// Step of the differences by which a slope in pixels is taken.
const STEP_PX: f64 = 0.02;
/// Most rays of an inversion.
const MOST_RAYS: usize = 40;
/// A pixel moves less than this when it has arrived.
const ARRIVED_PX: f64 = 1e-11;
/// A direction is not on the sensor's map if its pixel runs this far from the start.
const LOST_PX: f64 = 200.0;

impl Optics {
    /// The pixel (column, row; see [`Optics::view`]) that shows a point of the lab, by the straight way to the pupil. `None` behind the camera.
    #[must_use]
    pub fn project(&self, point_mm: Vec3) -> Option<[f64; 2]> {
        let d = point_mm - self.pupil;
        let z = d.dot(self.axes[2]);
        if z <= 1e-6 {
            return None;
        }
        let (x, y) = (d.dot(self.axes[0]) / z, d.dot(self.axes[1]) / z);
        let r2 = x * x + y * y;
        let scale = 1.0 + r2 * (self.k1 + self.k2 * r2);
        // beyond its turning point the polynomial is no lens
        if 1.0 + r2 * (3.0 * self.k1 + 5.0 * self.k2 * r2) <= 0.0 {
            return None;
        }
        Some([self.centre_px[0] + self.focal_px * x * scale, self.centre_px[1] + self.focal_px * y * scale])
    }

    /// The point of the mirror (rim and openings not considered) in a direction from its focus F1, lab frame, mm.
    #[must_use]
    pub fn mirror_point(&self, direction: Vec3) -> Vec3 {
        let d = self.lab_from_mirror.inverse().apply(direction).normalized();
        // the ellipse about its focus: r = b² / (a − c cos η'), η' from the side of the other focus
        let r = self.b * self.b / (self.a + self.c * d.z);
        self.mirror_shift + self.lab_from_mirror.apply(d) * r
    }

    /// The direction from F1 to a point of the mirror at polar angle `eta_rad` from +z and azimuth `phi_rad`, mirror frame, as a lab direction.
    #[must_use]
    pub fn mirror_direction(&self, eta_rad: f64, phi_rad: f64) -> Vec3 {
        let (s, c) = eta_rad.sin_cos();
        self.lab_from_mirror.apply(Vec3::new(s * phi_rad.cos(), s * phi_rad.sin(), c))
    }

    /// The pixel that sees the sample from the unit direction `d` (lab frame); `None` where there is none.
    #[must_use]
    pub fn pixel(&self, d: Vec3) -> Option<[f64; 2]> {
        let start = self.project(self.mirror_point(d))?;
        let slope = self.slope(start, d)?;
        self.settle(start, &slope, d)
    }

    /// The image of a disc of directions of angular radius `radius_rad` about `d`.
    #[must_use]
    pub fn image(&self, d: Vec3, radius_rad: f64) -> Option<Image> {
        let start = self.project(self.mirror_point(d))?;
        let slope = self.slope(start, d)?;
        let centre = self.settle(start, &slope, d)?;
        let (p, q) = d.orthonormal_basis();
        let mut at = [[[0.0; 2]; 3]; 3];
        for (i, row) in at.iter_mut().enumerate() {
            for (j, slot) in row.iter_mut().enumerate() {
                let (s, t) = (radius_rad * (i as f64 - 1.0), radius_rad * (j as f64 - 1.0));
                let guess = [0, 1].map(|k| centre[k] + slope[k][0] * s + slope[k][1] * t);
                *slot = if (i, j) == (1, 1) {
                    centre
                } else {
                    self.settle(guess, &slope, (d + p * s + q * t).normalized())?
                };
            }
        }
        // first and second differences per radius
        let first = |k: usize| [0.5 * (at[2][1][k] - at[0][1][k]), 0.5 * (at[1][2][k] - at[1][0][k])];
        let second = |k: usize| {
            let twice = 2.0 * at[1][1][k];
            let mixed = 0.25 * (at[2][2][k] - at[2][0][k] - at[0][2][k] + at[0][0][k]);
            [at[2][1][k] - twice + at[0][1][k], mixed, at[1][2][k] - twice + at[1][0][k]]
        };
        let (ju, jv) = (first(0), first(1));
        let (hu, hv) = (second(0), second(1));
        let det = ju[0] * jv[1] - ju[1] * jv[0];
        if det.abs() < 1e-12 {
            return None;
        }
        // derivative of the area's scale along the two radii; the disc's second moment is ¼ of its radius squared
        let grow = [
            (hu[0] * jv[1] + ju[0] * hv[1] - hu[1] * jv[0] - ju[1] * hv[0]) / det,
            (hu[1] * jv[1] + ju[0] * hv[2] - hu[2] * jv[0] - ju[1] * hv[1]) / det,
        ];
        let shift =
            |j: [f64; 2], h: [f64; 3]| 0.125 * (h[0] + h[2]) + 0.25 * (j[0] * grow[0] + j[1] * grow[1]);
        Some(Image {
            centre_px: centre,
            centroid_px: [centre[0] + shift(ju, hu), centre[1] + shift(jv, hv)],
            radii_px: [[ju[0], jv[0]], [ju[1], jv[1]]],
        })
    }

    /// Étendue of a pixel relative to one on the axis of an ideal lens of the nominal focal length: cos⁴ law and distortion.
    #[must_use]
    pub fn etendue(&self, column: f64, row: f64) -> f64 {
        let image = [(column - self.centre_px[0]) / self.focal_px, (row - self.centre_px[1]) / self.focal_px];
        let [x, y] = self.undistorted(image);
        let r2 = x * x + y * y;
        let scale = 1.0 + r2 * (self.k1 + self.k2 * r2);
        let slope = 1.0 + r2 * (3.0 * self.k1 + 5.0 * self.k2 * r2);
        1.0 / ((1.0 + r2) * (1.0 + r2) * scale * slope).max(1e-9)
    }

    /// Pixels per radian at a pixel: rows column and row, columns the two directions normal to `d`.
    fn slope(&self, at: [f64; 2], d: Vec3) -> Option<[[f64; 2]; 2]> {
        let (p, q) = d.orthonormal_basis();
        let difference = |du: f64, dv: f64| -> Option<[f64; 2]> {
            let ahead = self.view(at[0] + du, at[1] + dv)?.direction;
            let behind = self.view(at[0] - du, at[1] - dv)?.direction;
            let e = (ahead - behind) * (0.5 / STEP_PX);
            Some([e.dot(p), e.dot(q)])
        };
        let (u, v) = (difference(STEP_PX, 0.0)?, difference(0.0, STEP_PX)?);
        let det = u[0] * v[1] - v[0] * u[1];
        (det.abs() > 1e-18).then(|| [[v[1] / det, -v[0] / det], [-u[1] / det, u[0] / det]])
    }

    fn settle(&self, start: [f64; 2], slope: &[[f64; 2]; 2], d: Vec3) -> Option<[f64; 2]> {
        let (p, q) = d.orthonormal_basis();
        let mut at = start;
        for _ in 0..MOST_RAYS {
            let e = d - self.view(at[0], at[1])?.direction;
            let (s, t) = (e.dot(p), e.dot(q));
            let step = [0, 1].map(|k| slope[k][0] * s + slope[k][1] * t);
            at = [at[0] + step[0], at[1] + step[1]];
            let far = (at[0] - start[0]).hypot(at[1] - start[1]);
            if !far.is_finite() || far > LOST_PX {
                return None;
            }
            if step[0].hypot(step[1]) < ARRIVED_PX {
                return Some(at);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    fn misaligned() -> Optics {
        let d = builtin::description("reference").expect("known").expect("readable");
        Optics::with(&d, &builtin::misalignment().expect("readable"))
    }

    #[test]
    fn a_pixel_survives_the_way_to_its_direction_and_back() {
        let optics = misaligned();
        for (u, v) in [(640.0, 512.0), (20.0, 500.0), (900.5, 120.5), (640.0, 1000.0), (1200.0, 700.0)] {
            let d = optics.view(u, v).expect("hits").direction;
            let back = optics.pixel(d).expect("comes back");
            assert!((back[0] - u).abs() < 1e-8 && (back[1] - v).abs() < 1e-8, "{u} {v}: {back:?}");
        }
    }

    #[test]
    fn a_mirror_point_is_shown_where_its_ray_comes_from() {
        let optics = misaligned();
        for (u, v) in [(640.0, 512.0), (100.0, 300.0), (1100.0, 900.0)] {
            let m = optics.view(u, v).expect("hits").mirror_mm;
            let back = optics.project(m).expect("in front");
            assert!((back[0] - u).abs() < 1e-8 && (back[1] - v).abs() < 1e-8, "{u} {v}: {back:?}");
            // and it lies on the mirror in its own direction from F1
            let again = optics.mirror_point(m - optics.mirror_shift);
            assert!((again - m).norm() < 1e-9);
        }
    }

    #[test]
    fn the_centroid_of_a_disc_is_that_of_its_image_by_brute_force() {
        let optics = misaligned();
        // far out the scale changes quickly
        for (u, v) in [(640.0, 512.0), (60.0, 500.0), (500.0, 980.0)] {
            let d = optics.view(u, v).expect("hits").direction;
            let radius = 0.5f64.to_radians();
            let image = optics.image(d, radius).expect("on the sensor");
            // share of fine sub-pixels whose directions lie within the disc
            let (mut sum, mut n) = ([0.0; 2], 0.0);
            let (reach, step) = (14.0, 0.04);
            let cells = (2.0 * reach / step) as i32;
            for i in 0..cells {
                for j in 0..cells {
                    let p = [u - reach + step * f64::from(i), v - reach + step * f64::from(j)];
                    let seen = optics.view(p[0], p[1]).expect("hits").direction;
                    if (seen - d).norm() < 2.0 * (0.5 * radius).sin() {
                        sum = [sum[0] + p[0], sum[1] + p[1]];
                        n += 1.0;
                    }
                }
            }
            for (s, centroid) in sum.iter().zip(image.centroid_px) {
                let brute = s / n;
                assert!((brute - centroid).abs() < 3e-3, "{u} {v}: {brute} {image:?}");
            }
        }
    }

    #[test]
    fn etendue_is_the_solid_angle_of_a_pixel_at_the_pupil_times_its_cosine() {
        let optics = misaligned();
        let (u, v, h) = (1000.0, 200.0, 0.5);
        let ray = |u: f64, v: f64| (optics.view(u, v).expect("hits").mirror_mm - optics.pupil).normalized();
        let solid = (ray(u + h, v) - ray(u - h, v)).cross(ray(u, v + h) - ray(u, v - h)).norm();
        let expected = solid * ray(u, v).dot(optics.axes[2]) * optics.focal_px * optics.focal_px;
        assert!((optics.etendue(u, v) / expected - 1.0).abs() < 1e-4);
    }
}
