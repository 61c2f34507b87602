//! A GenICam camera end to end: Aravis' own fake camera on loopback. Runs with the feature `genicam` and the package aravis-tools.

#![cfg(feature = "genicam")]

use gonio_driver::camera::genicam::{list, open};
use gonio_driver::camera::raw::Wanted;
use gonio_instrument::{BayerPattern, Camera as _, Cancel, DeviceError};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

struct Fake(Child);

impl Fake {
    fn start(serial: &str) -> Fake {
        let program = "arv-fake-gv-camera-0.8";
        let child = Command::new(program)
            .args(["-i", "127.0.0.1", "-s", serial])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| panic!("{program}: {e}; install aravis-tools"));
        Fake(child)
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const WANTED: Wanted = Wanted { width: 160, height: 128, bits: 8, pattern: BayerPattern::Rggb };

/// One test: the fake camera has one address, and cameras by that name would be mixed up.
#[test]
fn a_fake_camera_is_found_read_lost_and_found_again() {
    let fake = Fake::start("G7");
    let start = Instant::now();
    while !list().iter().any(|d| d.id.contains("G7")) {
        assert!(start.elapsed() < Duration::from_secs(20), "not listed: {:?}", list());
    }
    let id = list().into_iter().find(|d| d.id.contains("G7")).map(|d| d.id).expect("listed");
    let mut camera = open(&id, &WANTED, Duration::from_secs(20)).expect("opened");
    let info = camera.info();
    assert_eq!((info.width, info.height, info.serial.as_str()), (160, 128, "G7"));

    let cancel = Cancel::new();
    let mut before: Option<gonio_instrument::Frame> = None;
    for ms in [1u64, 20, 20, 5] {
        let asked = Duration::from_millis(ms);
        let frame = camera.capture(asked, &cancel).expect("a frame");
        assert_eq!(frame.pixels.len(), 160 * 128);
        let off = frame.exposure.as_secs_f64() / asked.as_secs_f64();
        assert!((off - 1.0).abs() < 0.01, "{:?} was asked, {:?} taken", asked, frame.exposure);
        assert!(frame.pixels.iter().any(|p| *p != frame.pixels[0]), "a picture, not a blank");
        if let Some(before) = &before {
            assert_eq!(frame.sequence, before.sequence + 1, "none is lost on loopback");
            assert!(frame.stamp > before.stamp);
            assert_ne!(frame.pixels, before.pixels, "the fake camera's picture moves from frame to frame");
        }
        before = Some(frame);
    }
    let shortest = camera.capture(Duration::from_nanos(1), &cancel).expect("the shortest it can");
    assert_eq!(shortest.exposure, Duration::from_micros(10), "what it took, not what was asked");

    let deep = Wanted { bits: 14, ..WANTED };
    assert!(matches!(open("nobody", &WANTED, Duration::ZERO), Err(DeviceError::Absent { .. })));
    drop(fake);
    let again = std::thread::spawn(|| {
        std::thread::sleep(Duration::from_secs(1));
        Fake::start("G7")
    });
    let frame = camera.capture(Duration::from_millis(2), &cancel).expect("found again");
    assert!(frame.sequence > shortest.sequence);
    drop(camera);
    let _fake = again.join().expect("started");
    // its deepest format is chosen for a deeper instrument, or refused with what it has
    match open(&id, &deep, Duration::from_secs(5)) {
        Ok(camera) => assert_eq!(camera.format(), "Mono16"),
        Err(error) => assert!(error.to_string().contains("Mono8"), "{error}"),
    }
}
