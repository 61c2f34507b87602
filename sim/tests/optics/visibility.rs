//! What one pose sees: the figures for which the reference instrument was chosen.

use gonio_instrument::{Misalignment, Pose};
use gonio_optics::{Angle, Geometry, Vec3};
use gonio_sim::optics::camera::Ray;
use gonio_sim::optics::mirror::Ellipsoid;
use gonio_sim::optics::{Sample, VirtualOptics};

use crate::instrument;

struct Looker {
    optics: VirtualOptics,
    mirror: Ellipsoid,
    white: Sample,
    size: [f64; 2],
    normal_at_zero: Vec3,
    tilt_axis: Vec3,
}

impl Looker {
    fn new() -> Self {
        let d = instrument("reference");
        let optics = VirtualOptics::new(&d, &Misalignment::default());
        let mirror = Ellipsoid::new(&d, &Misalignment::default(), optics.lamp().direction);
        let size = d.camera.size.map(f64::from);
        let (normal_at_zero, tilt_axis) = (d.holder.normal_at_zero(), d.holder.tilt_axis());
        Self { optics, mirror, white: Sample::diffuser(0.98), size, normal_at_zero, tilt_axis }
    }

    /// Whether the direction (θo, φ) of a pose is seen by some place on the sensor.
    fn sees(&self, tilt_deg: f64, theta_o_deg: f64, phi_deg: f64) -> bool {
        // the sample's axes in the lab as the file defines them, not as the tracer has them
        let (n0, axis) = (self.normal_at_zero, self.tilt_axis);
        let (s, c) = tilt_deg.to_radians().sin_cos();
        let n = n0 * c + axis.cross(n0) * s;
        let (x, y) = (n.cross(axis).normalized(), -axis);
        let v = Vec3::from_polar(Angle::from_degrees(theta_o_deg), Angle::from_degrees(phi_deg));
        let lab = x * v.x + y * v.y + n * v.z;
        let strike = self.mirror.meet(Ray { origin: Vec3::ZERO, direction: lab }).expect("inside");
        let Some([column, row]) = self.optics.lens().place(strike.point - self.optics.lens().pupil) else {
            return false;
        };
        if column < 0.0 || row < 0.0 || column > self.size[0] || row > self.size[1] {
            return false;
        }
        let pose = Pose::from_degrees(tilt_deg, 0.0);
        match self.optics.trace_place(pose, 0.0, &self.white, column, row) {
            Some(s) => {
                assert!((s.view - v).norm() < 1e-4, "asked for {v:?}, saw {:?}", s.view);
                true
            }
            None => false,
        }
    }
}

#[test]
fn one_pose_sees_ninety_one_to_ninety_four_percent_of_the_cap() {
    let look = Looker::new();
    for tilt in (0..=75).step_by(15) {
        let (mut seen, mut total) = (0.0, 0.0);
        for i in 0..75 {
            let theta = f64::from(i) + 0.5;
            for j in 0..180 {
                let w = theta.to_radians().sin();
                total += w;
                if look.sees(f64::from(tilt), theta, 2.0 * f64::from(j) + 1.0) {
                    seen += w;
                }
            }
        }
        let share = 100.0 * seen / total;
        eprintln!("tilt {tilt}: {share:.2} % of the cap");
        assert!((91.0..94.0).contains(&share), "tilt {tilt}: {share:.2} % of the cap");
    }
}

#[test]
fn the_mirror_direction_is_seen_from_5_to_80_degrees() {
    let look = Looker::new();
    for t in (5..=80).step_by(5) {
        assert!(look.sees(f64::from(t), f64::from(t), 180.0), "mirror direction at {t}°");
    }
    // at 0° it is the opening for the lamp
    assert!(!look.sees(0.0, 0.0, 0.0));
}

#[test]
fn few_nodes_of_the_default_grid_are_lost_when_phi_is_folded() {
    let look = Looker::new();
    let (mut lost, mut total, mut outside_opening) = (0, 0, 0);
    for ti in 0..=15 {
        for to in 0..=30 {
            for k in 0..36 {
                let (theta_i, theta_o) = (5.0 * f64::from(ti), 2.5 * f64::from(to));
                let phi = 180.0 * f64::from(k) / 35.0;
                total += 1;
                if !look.sees(theta_i, theta_o, phi) && !look.sees(theta_i, theta_o, -phi) {
                    lost += 1;
                    let g = Geometry::from_degrees(theta_i, theta_o, phi);
                    let (l, v) = g.directions();
                    if l.angle_to(v).degrees() > 4.0 {
                        outside_opening += 1;
                    }
                }
            }
        }
    }
    eprintln!("{lost} of {total} nodes lost");
    assert_eq!(total, 17_856);
    assert_eq!(outside_opening, 0, "nodes lost outside the lamp's opening");
    assert!((140..=155).contains(&lost), "{lost} nodes lost");
}
