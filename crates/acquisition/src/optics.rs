//! The calibrated optics: camera model, ellipsoid, lamp and holder axes, from a description and what a calibration found.
//!
//! Pixel → image point → undistorted ray → mirror point M → reflected ray. The ray that leaves the mirror towards the
//! sample is reversed to give the direction from the sample to the camera's eye, lab frame.

mod inverse;

pub use inverse::Image;

use gonio_instrument::{Description, Misalignment};
use gonio_optics::{Angle, Rotation, Vec3};

/// Where a camera ray goes.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Unit direction from the sample towards the mirror point, lab frame.
    pub direction: Vec3,
    /// Mirror point, lab frame, mm.
    pub mirror_mm: Vec3,
    /// Cosine of the angle from +z at F1 of the mirror point, mirror frame.
    pub cos_eta: f64,
}

/// Camera, mirror, lamp and axes with a calibration applied.
#[derive(Clone, Debug)]
pub struct Optics {
    lab_from_mirror: Rotation,
    mirror_shift: Vec3,
    a: f64,
    b: f64,
    c: f64,
    pupil: Vec3,
    axes: [Vec3; 3],
    focal_px: f64,
    centre_px: [f64; 2],
    k1: f64,
    k2: f64,
    lamp: Vec3,
    tilt_axis: Vec3,
    spin_axis_at_zero: Vec3,
    tilt_zero: Angle,
}

fn turn_vector(degrees: [f64; 3], axes: [Vec3; 3]) -> Rotation {
    let [x, y, z] = degrees.map(f64::to_radians);
    Rotation::from_vector(axes[0] * x + axes[1] * y + axes[2] * z)
}

/// A unit vector turned about the two axes normal to it.
fn turned(v: Vec3, degrees: [f64; 2]) -> Vec3 {
    let (p, q) = v.orthonormal_basis();
    Rotation::from_vector(p * degrees[0].to_radians() + q * degrees[1].to_radians()).apply(v)
}

impl Optics {
    /// The optics of a description, its calibration applied.
    #[must_use]
    pub fn new(description: &Description) -> Self {
        let nominal = Misalignment::default();
        Self::with(description, description.calibration.as_ref().unwrap_or(&nominal))
    }

    /// The optics of a description with the departures `m` in place of what its calibration found.
    #[must_use]
    pub fn with(description: &Description, m: &Misalignment) -> Self {
        let camera = &description.camera;
        let look = Vec3::from(camera.look).normalized();
        // `up` made normal to the axis; columns grow along `right`, rows along `down`
        let right = look.cross(Vec3::from(camera.up)).normalized();
        let down = look.cross(right);
        let turn = turn_vector(m.camera_turn_deg, [right, down, look]);
        let (a, b) = (description.mirror.a, description.mirror.b + m.mirror_b_error_mm);
        Self {
            lab_from_mirror: turn_vector(m.mirror_turn_deg, [Vec3::X, Vec3::Y, Vec3::Z]),
            mirror_shift: Vec3::from(m.mirror_shift_mm),
            a,
            b,
            c: ((a - b) * (a + b)).max(0.0).sqrt(),
            pupil: Vec3::from(camera.pupil) + Vec3::from(m.camera_shift_mm),
            axes: [right, down, look].map(|v| turn.apply(v)),
            focal_px: camera.f_mm * (1.0 + m.focal_length_error) / (camera.pitch_um * 1e-3),
            centre_px: [0, 1].map(|k| 0.5 * f64::from(camera.size[k]) + m.principal_point_px[k]),
            k1: m.k1,
            k2: m.k2,
            lamp: turned(description.lamp.direction(), m.lamp_direction_deg),
            tilt_axis: turned(description.holder.tilt_axis(), m.tilt_axis_turn_deg),
            spin_axis_at_zero: turned(description.holder.normal_at_zero(), m.spin_axis_turn_deg),
            tilt_zero: Angle::from_degrees(m.tilt_zero_deg),
        }
    }

    /// Unit vector from the sample towards the lamp, lab frame.
    #[must_use]
    pub const fn lamp(&self) -> Vec3 {
        self.lamp
    }

    /// Entrance pupil, lab frame, mm.
    #[must_use]
    pub const fn pupil_mm(&self) -> Vec3 {
        self.pupil
    }

    /// Unit vectors along the pupil's two half axes (right and down in the picture), lab frame.
    #[must_use]
    pub const fn pupil_axes(&self) -> [Vec3; 2] {
        [self.axes[0], self.axes[1]]
    }

    /// Unit tilt axis, lab frame.
    #[must_use]
    pub const fn tilt_axis(&self) -> Vec3 {
        self.tilt_axis
    }

    /// The sample's normal at the tilt read back, lab frame.
    #[must_use]
    pub fn normal(&self, tilt_read_back: Angle) -> Vec3 {
        Rotation::about_axis(self.tilt_axis, tilt_read_back + self.tilt_zero).apply(self.spin_axis_at_zero)
    }

    /// Sample frame (rotation from the lab: x towards the lamp, z the normal) and angle of incidence at the tilt read back.
    #[must_use]
    pub fn frame(&self, tilt_read_back: Angle) -> (Rotation, Angle) {
        let (n, l) = (self.normal(tilt_read_back), self.lamp);
        let across = l - n * l.dot(n);
        // at normal incidence the plane of incidence is the one that tilting would give
        let x = if across.norm() > 1e-4 { across } else { -self.tilt_axis.cross(n) };
        let x = (x - n * x.dot(n)).normalized();
        (Rotation::from_axes(x, n.cross(x), n), l.angle_to(n))
    }

    /// The tilt to be read back at which the angle of incidence is `theta_i`; where the axes are off so far that it is never reached, the
    /// tilt that comes nearest.
    #[must_use]
    pub fn tilt_for(&self, theta_i: Angle) -> Angle {
        let at = |tilt: f64| self.normal(Angle::from_radians(tilt)).angle_to(self.lamp).radians();
        let wanted = theta_i.radians();
        // golden section on the distance about the nominal tilt, which is within a few degrees
        let (mut low, mut high) = (wanted - 0.1, wanted + 0.1);
        let off = |t: f64| (at(t) - wanted).abs();
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        // the smallest angle of incidence splits the tilts in two branches: the one of growing tilts is meant
        let mut least = (low, f64::INFINITY);
        for k in 0..=200 {
            let t = low + (high - low) * f64::from(k) / 200.0;
            if at(t) < least.1 {
                least = (t, at(t));
            }
        }
        low = low.max(least.0 - 2e-3);
        while high - low > 1e-10 {
            let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
            if off(a) < off(b) { high = b } else { low = a }
        }
        Angle::from_radians(0.5 * (low + high))
    }

    /// The view of the image point (`column`, `row`) in pixels, (0, 0) being the outer corner of the first pixel.
    /// `None` where the ray misses the ellipsoid.
    #[must_use]
    pub fn view(&self, column: f64, row: f64) -> Option<View> {
        let image = [(column - self.centre_px[0]) / self.focal_px, (row - self.centre_px[1]) / self.focal_px];
        let [x, y] = self.undistorted(image);
        let ray = (self.axes[0] * x + self.axes[1] * y + self.axes[2]).normalized();
        // in the mirror's frame, origin at the centre of the ellipsoid
        let mirror_from_lab = self.lab_from_mirror.inverse();
        let to_centre = Vec3::new(0.0, 0.0, self.c);
        let o = mirror_from_lab.apply(self.pupil - self.mirror_shift) + to_centre;
        let d = mirror_from_lab.apply(ray);
        let (ia, ib) = (1.0 / (self.a * self.a), 1.0 / (self.b * self.b));
        let metric = |p: Vec3, q: Vec3| (p.x * q.x + p.y * q.y) * ib + p.z * q.z * ia;
        let (aa, bb, cc) = (metric(d, d), metric(o, d), metric(o, o) - 1.0);
        let disc = bb * bb - aa * cc;
        if disc <= 0.0 {
            return None;
        }
        let t = (-bb + disc.sqrt()) / aa;
        if t <= 0.0 {
            return None;
        }
        let p = o + d * t;
        let normal = Vec3::new(p.x * ib, p.y * ib, p.z * ia).normalized();
        let towards_sample = d + normal * (-2.0 * d.dot(normal));
        let from_f1 = p - to_centre;
        Some(View {
            direction: self.lab_from_mirror.apply(-towards_sample).normalized(),
            mirror_mm: self.lab_from_mirror.apply(from_f1) + self.mirror_shift,
            cos_eta: from_f1.z / from_f1.norm(),
        })
    }

    /// Solves `distorted = p (1 + k1 r² + k2 r⁴)` for p by Newton's method on r.
    fn undistorted(&self, distorted: [f64; 2]) -> [f64; 2] {
        if self.k1 == 0.0 && self.k2 == 0.0 {
            return distorted;
        }
        let rd = distorted[0].hypot(distorted[1]);
        if rd == 0.0 {
            return distorted;
        }
        let mut r = rd;
        for _ in 0..20 {
            let r2 = r * r;
            let f = r * (1.0 + r2 * (self.k1 + self.k2 * r2)) - rd;
            let slope = 1.0 + r2 * (3.0 * self.k1 + 5.0 * self.k2 * r2);
            if slope.abs() < 1e-6 {
                break;
            }
            let step = f / slope;
            r -= step;
            if step.abs() < 1e-14 {
                break;
            }
        }
        distorted.map(|v| v * r / rd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    fn reference() -> Description {
        builtin::description("reference").expect("known").expect("readable")
    }

    #[test]
    fn every_ray_of_the_nominal_instrument_leaves_from_f1() {
        let optics = Optics::new(&reference());
        for (u, v) in [(640.0, 512.0), (3.0, 500.0), (900.5, 120.5), (640.0, 1000.0)] {
            let view = optics.view(u, v).expect("hits the mirror");
            // the mirror point seen from F1 lies in the direction of view
            assert!((view.mirror_mm.normalized() - view.direction).norm() < 1e-12);
            // |F1 M| + |M F2| = 2a
            let path = view.mirror_mm.norm() + (view.mirror_mm - optics.pupil_mm()).norm();
            assert!((path - 400.0).abs() < 1e-9, "{path}");
        }
    }

    #[test]
    fn the_pixel_pitch_seen_from_the_sample_is_as_designed() {
        let optics = Optics::new(&reference());
        let pitch = |u: f64, v: f64| {
            let d = |u: f64| optics.view(u, v).expect("hits").direction;
            d(u + 0.5).angle_to(d(u - 0.5)).degrees()
        };
        assert!((pitch(640.0, 512.0) - 0.38).abs() < 0.01, "{}", pitch(640.0, 512.0));
    }

    #[test]
    fn the_tilt_is_the_angle_of_incidence() {
        let optics = Optics::new(&reference());
        for deg in [0.0, 5.0, 45.0, 85.0] {
            let n = optics.normal(Angle::from_degrees(deg));
            assert!((n.angle_to(optics.lamp()).degrees() - deg).abs() < 1e-3);
        }
    }

    #[test]
    fn a_calibrated_tilt_gives_the_angle_of_incidence_or_comes_as_near_as_the_axes_allow() {
        let mut d = reference();
        d.calibration = Some(builtin::misalignment().expect("readable"));
        let optics = Optics::new(&d);
        let theta = |tilt: Angle| optics.normal(tilt).angle_to(optics.lamp()).degrees();
        for deg in [5.0, 10.0, 45.0, 85.0] {
            let tilt = optics.tilt_for(Angle::from_degrees(deg));
            assert!((theta(tilt) - deg).abs() < 1e-6, "{deg}: {}", theta(tilt));
            assert!((tilt.degrees() - deg).abs() < 2.0);
        }
        let nearest = optics.tilt_for(Angle::ZERO);
        for off in [-0.2, 0.2] {
            assert!(theta(nearest) <= theta(nearest + Angle::from_degrees(off)));
        }
    }

    #[test]
    fn distortion_is_undone() {
        let mut d = reference();
        d.calibration = Some(Misalignment { k1: 0.02, k2: -0.003, ..Misalignment::default() });
        let optics = Optics::new(&d);
        let p = [0.7, -0.5];
        let r2: f64 = p[0] * p[0] + p[1] * p[1];
        let q = p.map(|v: f64| v * (1.0 + 0.02 * r2 - 0.003 * r2 * r2));
        let back = optics.undistorted(q);
        assert!((back[0] - p[0]).abs() < 1e-13 && (back[1] - p[1]).abs() < 1e-13);
    }
}
