//! The sample holder: where the sample surface stands at a pose, and what the holder hides.
//!
//! At tilt t the holder's normal is `n(t) = R(tilt axis, t) · n0`, a right-handed turn; errors tip the tilt axis and n0 (the spin
//! axis at tilt 0) about the axes normal to them. At spin 0 the sample's x axis is `n × tilt axis`, so that the nominal light lies at
//! +x for t > 0, and y = n × x; spin s turns both right-handedly about n. Tilt zero and repeatability are already in the pose that
//! the world states as actual.
//!
//! What hides: the disc, the body behind it, the crank (a bar parallel to the shaft, `behind_mm` behind the sample plane, and an arm
//! from its end to the shaft) and the shaft, all opaque and black. A reference on a wedge stands on a disc set back by
//! `disc radius · tan(wedge)`, so that its surface clears the disc; the wedge itself hides only what is behind its own surface.

use gonio_instrument::{Description, Misalignment, Pose};
use gonio_optics::{Angle, Vec3};

use super::turn;

/// How a surface is mounted: its normal leans away from the spin axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wedge {
    /// Angle between the surface's normal and the spin axis.
    pub angle: Angle,
    /// Azimuth of the lean in the sample frame.
    pub azimuth: Angle,
}

/// The holder with its errors, before a pose is given.
#[derive(Clone, Debug)]
pub struct Holder {
    tilt_axis: Vec3,
    normal_at_zero: Vec3,
    shaft: Vec3,
    disc_radius_mm: f64,
    disc_thickness_mm: f64,
    body: (f64, f64),
    shaft_radius_mm: f64,
    shaft_from_mm: f64,
    crank: (f64, f64),
}

/// The holder at a pose.
#[derive(Clone, Debug)]
pub struct Stand {
    /// Axes of the sample surface in the lab: x, y, and z its outward normal.
    pub axes: [Vec3; 3],
    /// A point of the surface, on the spin axis.
    pub point: Vec3,
    /// Radius of the sample, mm.
    pub radius_mm: f64,
    solids: Vec<Cylinder>,
    /// Everything but the shaft lies within this distance of F1, mm.
    bound_mm: f64,
    shaft: Cylinder,
}

impl Holder {
    /// The holder of an instrument with its errors.
    #[must_use]
    pub fn new(d: &Description, m: &Misalignment) -> Self {
        let h = &d.holder;
        let nominal_axis = h.tilt_axis();
        let (first, second) = nominal_axis.orthonormal_basis();
        let lean = first * m.tilt_axis_turn_deg[0] + second * m.tilt_axis_turn_deg[1];
        Self {
            tilt_axis: turn::tipped(nominal_axis, m.tilt_axis_turn_deg),
            normal_at_zero: turn::tipped(h.normal_at_zero(), m.spin_axis_turn_deg),
            shaft: turn::by_vector_deg(Vec3::from(h.shaft.direction).normalized(), lean),
            disc_radius_mm: h.disc_radius_mm,
            disc_thickness_mm: h.disc_thickness_mm,
            body: (h.body.radius_mm, h.body.length_mm),
            shaft_radius_mm: h.shaft.radius_mm,
            shaft_from_mm: h.shaft.from_mm,
            crank: (h.crank.behind_mm, h.crank.radius_mm),
        }
    }

    /// Where everything stands at an actual pose, with the surface `height_mm` above F1 along the holder's normal.
    #[must_use]
    pub fn at(&self, actual: Pose, height_mm: f64, wedge: Option<Wedge>) -> Stand {
        let n = turn::about(self.normal_at_zero, self.tilt_axis, actual.tilt.radians());
        let x0 = n.cross(self.tilt_axis).normalized();
        let x = turn::about(x0, n, actual.spin.radians());
        let y = n.cross(x);
        let mut axes = [x, y, n];
        let mut set_back = 0.0;
        if let Some(w) = wedge {
            // lean the whole sample frame about the in-plane axis normal to the azimuth
            let hinge = y * w.azimuth.cos() - x * w.azimuth.sin();
            axes = axes.map(|e| turn::about(e, hinge, w.angle.radians()));
            set_back = self.disc_radius_mm * w.angle.tan();
        }
        let back = |depth: f64| n * (height_mm - set_back - depth);
        let bar_start = back(self.crank.0);
        let bar_end = bar_start + self.shaft * self.shaft_from_mm;
        let shaft_start = self.shaft * self.shaft_from_mm;
        let solids = vec![
            Cylinder::new(back(0.0), back(self.disc_thickness_mm), self.disc_radius_mm),
            Cylinder::new(
                back(self.disc_thickness_mm),
                back(self.disc_thickness_mm + self.body.1),
                self.body.0,
            ),
            Cylinder::new(bar_start, bar_end, self.crank.1),
            Cylinder::new(bar_end, shaft_start, self.crank.1),
        ];
        let bound_mm = solids.iter().map(Cylinder::reach).fold(0.0, f64::max);
        // out through the mirror and beyond
        let shaft = Cylinder::new(shaft_start, self.shaft * 1e4, self.shaft_radius_mm);
        Stand { axes, point: n * height_mm, radius_mm: self.disc_radius_mm, solids, bound_mm, shaft }
    }
}

impl Stand {
    /// A lab direction in the sample frame.
    #[must_use]
    pub fn sample_from_lab(&self, d: Vec3) -> Vec3 {
        Vec3::new(d.dot(self.axes[0]), d.dot(self.axes[1]), d.dot(self.axes[2]))
    }

    /// Where a ray meets the surface's plane from the front: distance and the point relative to the surface's centre. `None`
    /// from behind or along it.
    #[must_use]
    pub fn meet(&self, origin: Vec3, direction: Vec3) -> Option<(f64, Vec3)> {
        let n = self.axes[2];
        let slope = direction.dot(n);
        if slope > -1e-9 {
            return None;
        }
        let t = (self.point - origin).dot(n) / slope;
        (t > 0.0).then(|| (t, origin + direction * t - self.point))
    }

    /// Whether the holder stands in the way between `origin` and `origin + direction · length`.
    #[must_use]
    pub fn hides(&self, origin: Vec3, direction: Vec3, length: f64) -> bool {
        if self.shaft.cuts(origin, direction, length) {
            return true;
        }
        let nearest = (-origin.dot(direction)).clamp(0.0, length);
        if (origin + direction * nearest).norm_squared() > self.bound_mm * self.bound_mm {
            return false;
        }
        self.solids.iter().any(|s| s.cuts(origin, direction, length))
    }
}

/// A solid round bar with flat ends.
#[derive(Clone, Debug)]
struct Cylinder {
    start: Vec3,
    axis: Vec3,
    length: f64,
    radius: f64,
}

impl Cylinder {
    fn new(start: Vec3, end: Vec3, radius: f64) -> Self {
        let along = end - start;
        Self { start, axis: along.normalized(), length: along.norm(), radius }
    }

    /// A bound on the distance of any of its points from the origin.
    fn reach(&self) -> f64 {
        let end = self.start + self.axis * self.length;
        self.start.norm().max(end.norm()) + self.radius
    }

    /// Whether the segment cuts the solid: the part of the line inside the infinite cylinder and the part between the two end
    /// planes must overlap within the segment.
    fn cuts(&self, origin: Vec3, direction: Vec3, length: f64) -> bool {
        let o = origin - self.start;
        let (oa, da) = (o.dot(self.axis), direction.dot(self.axis));
        let (op, dp) = (o - self.axis * oa, direction - self.axis * da);
        let (a, b, c) = (dp.norm_squared(), op.dot(dp), op.norm_squared() - self.radius * self.radius);
        let (mut near, mut far) = (0.0f64, length);
        if a > 1e-18 {
            let disc = b * b - a * c;
            if disc <= 0.0 {
                return false;
            }
            let root = disc.sqrt();
            near = near.max((-b - root) / a);
            far = far.min((-b + root) / a);
        } else if c > 0.0 {
            return false;
        }
        if da.abs() > 1e-12 {
            let (t0, t1) = (-oa / da, (self.length - oa) / da);
            near = near.max(t0.min(t1));
            far = far.min(t0.max(t1));
        } else if !(0.0..=self.length).contains(&oa) {
            return false;
        }
        // a touch at the very end is where the ray was going
        near < far - 1e-9
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
    fn tilt_is_the_angle_of_incidence_and_the_light_lies_at_plus_x() {
        let d = reference();
        let h = Holder::new(&d, &Misalignment::default());
        for t in [0.0, 10.0, 45.0, 85.0] {
            let l = h.at(Pose::from_degrees(t, 0.0), 0.0, None).sample_from_lab(d.lamp.direction());
            let expected = Vec3::new(t.to_radians().sin(), 0.0, t.to_radians().cos());
            // the file gives five digits
            assert!((l - expected).norm() < 2e-5, "tilt {t}: {l:?}");
        }
    }

    #[test]
    fn spin_turns_the_sample_under_the_light() {
        let d = reference();
        let h = Holder::new(&d, &Misalignment::default());
        let l = h.at(Pose::from_degrees(30.0, 90.0), 0.0, None).sample_from_lab(d.lamp.direction());
        // the sample's x axis went to where y was, so the light lies at −y
        assert!((l - Vec3::new(0.0, -0.5, 0.75f64.sqrt())).norm() < 2e-5, "{l:?}");
    }

    #[test]
    fn a_wedge_leans_the_normal_by_its_angle_towards_its_azimuth() {
        let d = reference();
        let h = Holder::new(&d, &Misalignment::default());
        let pose = Pose::from_degrees(20.0, 35.0);
        let flat = h.at(pose, 0.0, None);
        let wedge = Wedge { angle: Angle::from_degrees(21.3), azimuth: Angle::from_degrees(70.0) };
        let leaning = h.at(pose, 0.0, Some(wedge));
        let n = flat.sample_from_lab(leaning.axes[2]);
        assert!((n - Vec3::from_polar(wedge.angle, wedge.azimuth)).norm() < 1e-12, "{n:?}");
    }

    #[test]
    fn a_bar_cuts_what_crosses_it_and_lets_pass_what_stops_short() {
        let bar = Cylinder::new(Vec3::new(0.0, 0.0, -5.0), Vec3::new(0.0, 0.0, 5.0), 1.0);
        let from = Vec3::new(-10.0, 0.5, 0.0);
        assert!(bar.cuts(from, Vec3::X, 20.0));
        assert!(!bar.cuts(from, Vec3::X, 8.0));
        assert!(!bar.cuts(from, -Vec3::X, 20.0));
        assert!(!bar.cuts(Vec3::new(-10.0, 1.1, 0.0), Vec3::X, 20.0));
        assert!(!bar.cuts(Vec3::new(-10.0, 0.0, 5.1), Vec3::X, 20.0));
        // along the axis, through the end caps
        assert!(bar.cuts(Vec3::new(0.2, 0.0, -20.0), Vec3::Z, 40.0));
        assert!(!bar.cuts(Vec3::new(1.2, 0.0, -20.0), Vec3::Z, 40.0));
    }

    #[test]
    fn the_sample_is_seen_from_the_front_and_its_back_is_hidden_by_the_body() {
        let d = reference();
        let s = Holder::new(&d, &Misalignment::default()).at(Pose::from_degrees(30.0, 0.0), 0.0, None);
        let n = s.axes[2];
        let front = (n + s.axes[0] * 0.3).normalized();
        let (t, at) = s.meet(front * 100.0, -front).expect("from the front");
        assert!((t - 100.0).abs() < 1e-9 && at.norm() < 1e-9);
        assert!(!s.hides(front * 100.0, -front, t));
        assert!(s.hides(n * -100.0, n, 100.0));
        assert!(s.meet(n * -100.0, n).is_none());
    }
}
