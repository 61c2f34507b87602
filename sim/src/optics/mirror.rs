//! The ellipsoidal mirror: where a ray meets it, how it is reflected, and where it has no surface.
//!
//! In its own frame the mirror has its focus F1 at the origin, its other focus at (0, 0, −2c) and its centre at (0, 0, −c):
//!
//! ```text
//! (x² + y²)/b² + (z + c)²/a² = 1,   c² = a² − b²
//! ```
//!
//! Errors: b grows by `mirror_b_error_mm` with F1 kept (c follows); the mirror is turned about F1 by the rotation vector
//! `mirror_turn_deg` (lab axes) and then shifted. The opening for the lamp is a cylinder about the beam, that for the shaft
//! a cylinder about the shaft's nominal axis; both axes pass through the lab origin.

use gonio_instrument::{Description, Misalignment};
use gonio_optics::Vec3;

use super::camera::Ray;
use super::turn;

/// Where a ray meets the mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strike {
    /// The point on the mirror, lab, mm.
    pub point: Vec3,
    /// Unit normal, pointing inwards.
    pub normal: Vec3,
    /// Unit direction after reflection.
    pub reflected: Vec3,
    /// Length of the way to the mirror, mm.
    pub distance_mm: f64,
}

/// The mirror.
#[derive(Clone, Debug)]
pub struct Ellipsoid {
    a: f64,
    b: f64,
    c: f64,
    axes: [Vec3; 3],
    focus: Vec3,
    cos_rim: f64,
    /// Reflectance of the coating.
    pub reflectance: f64,
    beam: Vec3,
    beam_opening_mm: f64,
    shaft: Vec3,
    shaft_opening_mm: f64,
}

impl Ellipsoid {
    /// The mirror of an instrument with its errors; `beam` is the unit direction from the sample to the lamp.
    #[must_use]
    pub fn new(d: &Description, m: &Misalignment, beam: Vec3) -> Self {
        let a = d.mirror.a;
        let b = d.mirror.b + m.mirror_b_error_mm;
        let r = Vec3::from(m.mirror_turn_deg);
        Self {
            a,
            b,
            c: ((a - b) * (a + b)).max(0.0).sqrt(),
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|e| turn::by_vector_deg(e, r)),
            focus: Vec3::from(m.mirror_shift_mm),
            cos_rim: d.mirror.rim_eta_deg.to_radians().cos(),
            reflectance: d.mirror.reflectance,
            beam,
            beam_opening_mm: d.lamp.opening_radius_mm,
            shaft: Vec3::from(d.holder.shaft.direction).normalized(),
            shaft_opening_mm: d.holder.shaft.opening_radius_mm,
        }
    }

    /// Where a ray from inside meets the full ellipsoid, rim and openings not considered; `None` for a ray that passes it by.
    #[must_use]
    pub fn meet(&self, ray: Ray) -> Option<Strike> {
        let [ex, ey, ez] = self.axes;
        let from = ray.origin - self.focus;
        let o = Vec3::new(from.dot(ex) / self.b, from.dot(ey) / self.b, (from.dot(ez) + self.c) / self.a);
        let d = Vec3::new(
            ray.direction.dot(ex) / self.b,
            ray.direction.dot(ey) / self.b,
            ray.direction.dot(ez) / self.a,
        );
        let (qa, qb, qc) = (d.norm_squared(), o.dot(d), o.norm_squared() - 1.0);
        let disc = qb * qb - qa * qc;
        if disc < 0.0 {
            return None;
        }
        // far root; −qb may cancel against the root when the start lies outside, which no camera here does
        let t = (disc.sqrt() - qb) / qa;
        if t <= 0.0 {
            return None;
        }
        let s = o + d * t;
        let outward = (ex * (s.x / self.b) + ey * (s.y / self.b) + ez * (s.z / self.a)).normalized();
        let reflected = ray.direction - outward * (2.0 * ray.direction.dot(outward));
        Some(Strike { point: ray.origin + ray.direction * t, normal: -outward, reflected, distance_mm: t })
    }

    /// Whether there is a reflecting surface at a point of the ellipsoid: within the rim and not in an opening.
    #[must_use]
    pub fn covers(&self, point: Vec3) -> bool {
        let p = point - self.focus;
        p.dot(self.axes[2]) >= self.cos_rim * p.norm()
            && !within(point, self.beam, self.beam_opening_mm)
            && !within(point, self.shaft, self.shaft_opening_mm)
    }

    /// The far focus, lab, mm.
    #[must_use]
    pub fn camera_focus(&self) -> Vec3 {
        self.focus - self.axes[2] * (2.0 * self.c)
    }

    /// The near focus, lab, mm.
    #[must_use]
    pub fn sample_focus(&self) -> Vec3 {
        self.focus
    }
}

/// Whether a point lies in the half cylinder of `radius` about the axis from the origin along the unit vector `axis`.
fn within(point: Vec3, axis: Vec3, radius: f64) -> bool {
    let along = point.dot(axis);
    along > 0.0 && (point - axis * along).norm_squared() <= radius * radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;
    use gonio_optics::Angle;

    #[test]
    fn every_ray_that_leaves_one_focus_meets_the_other_however_the_mirror_stands() {
        let d = builtin::description("reference").expect("known").expect("readable");
        for m in [Misalignment::default(), builtin::misalignment().expect("readable")] {
            let e = Ellipsoid::new(&d, &m, d.lamp.direction());
            for k in 0..400 {
                let theta = Angle::from_degrees(0.3 * f64::from(k) + 0.1);
                let direction = Vec3::from_polar(theta, Angle::from_degrees(137.5 * f64::from(k)));
                let s = e.meet(Ray { origin: e.sample_focus(), direction }).expect("inside");
                let to = e.camera_focus() - s.point;
                // closed-form check that does not use the reflection: the two ways add up to 2a
                assert!((s.distance_mm + to.norm() - 2.0 * d.mirror.a).abs() < 1e-10);
                assert!((s.reflected - to.normalized()).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn the_nominal_camera_focus_is_where_the_camera_stands() {
        let d = builtin::description("reference").expect("known").expect("readable");
        let e = Ellipsoid::new(&d, &Misalignment::default(), d.lamp.direction());
        assert!((e.camera_focus() - Vec3::from(d.camera.pupil)).norm() < 1e-12);
    }

    #[test]
    fn the_surface_ends_at_the_rim_and_at_the_openings() {
        let d = builtin::description("reference").expect("known").expect("readable");
        let e = Ellipsoid::new(&d, &Misalignment::default(), d.lamp.direction());
        let at = |direction: Vec3| e.meet(Ray { origin: Vec3::ZERO, direction }).expect("inside").point;
        let polar = |t: f64, p: f64| Vec3::from_polar(Angle::from_degrees(t), Angle::from_degrees(p));
        assert!(e.covers(at(polar(119.9, 45.0))) && !e.covers(at(polar(120.1, 45.0))));
        assert!(!e.covers(at(d.lamp.direction())));
        let (side, _) = d.lamp.direction().orthonormal_basis();
        assert!(!e.covers(at((d.lamp.direction() + side * 0.04).normalized())));
        assert!(e.covers(at((d.lamp.direction() + side * 0.07).normalized())));
        assert!(!e.covers(at(Vec3::from(d.holder.shaft.direction).normalized())));
    }
}
