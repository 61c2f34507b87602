//! Every pixel's way out is a way back in.

use gonio_instrument::{Misalignment, Pose};
use gonio_optics::Vec3;
use gonio_sim::optics::camera::Ray;
use gonio_sim::optics::mirror::Ellipsoid;
use gonio_sim::optics::{Sample, VirtualOptics};

use crate::{errors, instrument};

#[test]
fn a_ray_from_the_sample_along_a_pixels_view_comes_back_to_that_pixel() {
    let d = instrument("reference");
    let white = Sample::diffuser(0.98);
    for (errors, tolerance_px) in [(Misalignment::default(), 1e-6), (errors(), 1e-6)] {
        let optics = VirtualOptics::new(&d, &errors);
        let mirror = Ellipsoid::new(&d, &errors, optics.lamp().direction);
        let mut seen = 0;
        for tilt in [0.0, 40.0, 80.0] {
            for row in (3..d.camera.size[1]).step_by(61) {
                for column in (5..d.camera.size[0]).step_by(53) {
                    let Some(s) = optics.trace_pixel(Pose::from_degrees(tilt, 20.0), &white, column, row)
                    else {
                        continue;
                    };
                    // from the sample's centre, out along the view, by the mirror
                    let strike = mirror
                        .meet(Ray { origin: s.place_mm, direction: s.view_lab })
                        .expect("the sample lies inside the mirror");
                    let miss = strike.reflected.cross(optics.lens().pupil - strike.point).norm();
                    assert!(miss < 1e-9, "the reflected ray misses the pupil by {miss} mm");
                    let [c, r] = optics.lens().place(-strike.reflected).expect("in front");
                    let (dc, dr) = (c - f64::from(column) - 0.5, r - f64::from(row) - 0.5);
                    assert!(dc.hypot(dr) < tolerance_px, "({column}, {row}) came back off by {dc}, {dr}");
                    seen += 1;
                }
            }
        }
        assert!(seen > 400, "{seen} places");
    }
}

#[test]
fn the_nominal_instrument_looks_at_the_very_centre_of_the_sample() {
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let white = Sample::diffuser(0.98);
    for (column, row) in [(300, 500), (640, 900), (500, 300), (900, 700)] {
        let s = optics.trace_pixel(Pose::from_degrees(30.0, 0.0), &white, column, row);
        if let Some(s) = s {
            assert!(s.place_mm.norm() < 1e-9, "{:?}", s.place_mm);
            assert_eq!(s.lit, 1.0);
        }
    }
}

#[test]
fn light_and_view_are_in_the_sample_frame_with_the_light_at_phi_zero() {
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let white = Sample::diffuser(0.98);
    let s = optics.trace_pixel(Pose::from_degrees(30.0, 0.0), &white, 300, 500).expect("seen");
    assert!((s.light - Vec3::new(0.5, 0.0, 0.75f64.sqrt())).norm() < 2e-5);
    assert!(s.view.z > 0.0 && (s.view.norm() - 1.0).abs() < 1e-12);
    assert!((s.geometry.theta_i.degrees() - 30.0).abs() < 2e-3);
}

#[test]
fn the_pixel_pitch_seen_from_the_sample_is_that_of_the_design() {
    // 0.38° on axis, 0.16…0.18° at 90° from the axis, 0.06…0.08° at the rim; the pose is one that leaves the place free
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let mirror = Ellipsoid::new(&d, &Misalignment::default(), optics.lamp().direction);
    let pitch = |eta_deg: f64, azimuth_deg: f64| {
        let a = gonio_optics::Angle::from_degrees;
        let out = Vec3::from_polar(a(eta_deg), a(azimuth_deg));
        let strike = mirror.meet(Ray { origin: Vec3::ZERO, direction: out }).expect("inside");
        let [c, r] = optics.lens().place(strike.point - optics.lens().pupil).expect("in front");
        let back = |c: f64, r: f64| {
            let (ray, _) = optics.lens().ray(c, r);
            -mirror.meet(ray).expect("inside").reflected
        };
        assert!((back(c, r) - out).norm() < 1e-9);
        let across = (back(c + 0.5, r) - back(c - 0.5, r)).norm().to_degrees();
        let down = (back(c, r + 0.5) - back(c, r - 0.5)).norm().to_degrees();
        (across, down)
    };
    let (x, y) = pitch(0.01, 0.0);
    assert!((x - 0.38).abs() < 0.005 && (y - 0.38).abs() < 0.005, "{x} {y}");
    for azimuth in [0.0, 90.0, 180.0] {
        let (x, y) = pitch(90.0, azimuth);
        assert!((0.155..0.185).contains(&x) && (0.155..0.185).contains(&y), "90°: {x} {y}");
    }
    let (x, y) = pitch(120.0, 180.0);
    // tangentially and radially to the rim
    assert!((0.05..0.09).contains(&x) && (0.05..0.09).contains(&y), "rim: {x} {y}");
}
