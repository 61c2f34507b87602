//! The camera behind the trait.

use std::time::Duration;

use gonio_instrument::{Camera, Cancel, DeviceError, Frame, Misalignment, Pose};
use gonio_sim::firmware::Faults;
use gonio_sim::optics::Sample;
use gonio_sim::world::World;
use gonio_sim::{CameraFaults, VirtualCamera};

use crate::instrument;

const SCALE: f64 = 1e6;

fn world(tilt_deg: f64) -> World {
    let w = World::new(SCALE);
    w.update(|s| {
        s.actual = Pose::from_degrees(tilt_deg, 0.0);
        s.readback = s.actual;
        s.shutter_open = true;
        s.lamp = 1.0;
    });
    w
}

fn camera(w: &World, seed: u64) -> VirtualCamera {
    let d = instrument("tiny");
    VirtualCamera::new(w.clone(), &d, &Misalignment::default(), Sample::diffuser(0.98), seed)
}

fn shot(c: &mut VirtualCamera, ms: u64) -> Frame {
    c.capture(Duration::from_millis(ms), &Cancel::new()).expect("a frame")
}

fn mean_signal(f: &Frame) -> f64 {
    f.pixels.iter().map(|&c| f64::from(c) - 64.0).sum::<f64>() / f.pixels.len() as f64
}

#[test]
fn light_follows_shutter_lamp_and_exposure() {
    let w = world(20.0);
    let mut c = camera(&w, 1);
    let full = mean_signal(&shot(&mut c, 10));
    assert!(full > 100.0, "{full}");
    w.update(|s| s.lamp = 0.5);
    assert!((mean_signal(&shot(&mut c, 10)) / full - 0.5).abs() < 0.01);
    assert!((mean_signal(&shot(&mut c, 20)) / full - 1.0).abs() < 0.01);
    w.update(|s| s.shutter_open = false);
    assert!(mean_signal(&shot(&mut c, 10)).abs() < 2.0);
}

#[test]
fn a_resumed_scan_sees_what_the_uninterrupted_one_sees() {
    let w = world(20.0);
    let mut whole = camera(&w, 5);
    let (first, again) = (shot(&mut whole, 5), shot(&mut whole, 5));
    assert_ne!(first.pixels, again.pixels, "repeats have their own noise");
    let there = Pose::from_degrees(50.0, 0.0);
    w.update(|s| {
        s.actual = there;
        s.readback = there;
    });
    let there = shot(&mut whole, 5);
    // another process starts at the second pose
    let mut resumed = camera(&w, 5);
    assert_eq!(shot(&mut resumed, 5).pixels, there.pixels);
    assert_ne!(shot(&mut camera(&w, 6), 5).pixels, there.pixels, "another seed, another noise");
}

#[test]
fn the_exposure_really_taken_is_within_limits_and_steps() {
    let w = world(20.0);
    let mut c = camera(&w, 1);
    let took = |c: &mut VirtualCamera, d: Duration| c.capture(d, &Cancel::new()).expect("a frame").exposure;
    assert_eq!(took(&mut c, Duration::ZERO), Duration::from_micros(20));
    assert_eq!(took(&mut c, Duration::from_secs(3600)), Duration::from_secs(2));
    assert_eq!(took(&mut c, Duration::from_nanos(1_234_567)), Duration::from_micros(1235));
}

#[test]
fn a_stop_ends_a_long_exposure() {
    let w = World::new(1e-3);
    let mut c = camera(&w, 1);
    let cancel = Cancel::new();
    let stop = cancel.clone();
    let frame = std::thread::scope(|scope| {
        scope.spawn(move || stop.stop());
        c.capture(Duration::from_secs(2), &cancel)
    });
    assert_eq!(frame.expect_err("it would take half an hour"), DeviceError::Cancelled);
}

#[test]
fn camera_faults_stand_in_the_faults_file_and_chances_are_checked() {
    let head = "format = \"gonio-faults\"\nversion = 1\n[camera]\n";
    let faults = Faults::from_toml(&format!("{head}torn = 0.25\nunplugged_after = 9\n")).expect("valid");
    let expected = CameraFaults { torn: 0.25, unplugged_after: Some(9), ..CameraFaults::default() };
    assert_eq!(faults.camera, Some(expected));
    let e = Faults::from_toml(&format!("{head}late = 1.5\n")).expect_err("no chance").to_string();
    assert!(e.contains("camera.late") && e.contains("1.5"), "{e}");
}
