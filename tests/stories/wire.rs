//! The production driver talks to the virtual firmware: through a pseudo-terminal, and over lines that are as bad as lines get. Real
//! threads and real time; everything is awaited, nothing is timed.

use gonio_driver::camera::{CameraServer, SocketCamera};
use gonio_driver::stage::{Direction, Options, SerialStage, StageEvent};
use gonio_driver::transport::{
    FaultyTransport, LineFaults, MemoryTransport, SerialTransport, Transport, serial,
};
use gonio_instrument::{Camera, CameraInfo, Cancel, DeviceError, Frame, Pose, Stage, builtin};
use gonio_protocol::frame::{Decoder, Packet};
use gonio_protocol::message::{Command, Outcome, ToDevice, from_body};
use gonio_sim::firmware::serve::{Served, serve_memory, serve_pty};
use gonio_sim::firmware::{Faults, Firmware, Settings, What};
use gonio_sim::world::World;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Long enough for any machine; only waited for when something is broken.
const LONG: Duration = Duration::from_secs(60);

fn firmware(time_scale: f64, faults: Faults) -> (Firmware, World) {
    let instrument = builtin::description("reference").expect("known").expect("valid");
    let world = World::new(time_scale);
    (Firmware::new(Settings::new(&instrument, 5, time_scale), world.clone(), faults), world)
}

/// A firmware behind a line in memory, and the host's end of it.
fn in_memory(time_scale: f64, faults: Faults) -> (MemoryTransport, Served, World) {
    let (firmware, world) = firmware(time_scale, faults);
    let (line, served) = serve_memory(firmware).expect("a thread");
    (MemoryTransport::new("memory", line.to_device, line.from_device), served, world)
}

fn connect(transport: impl Transport + 'static) -> SerialStage {
    SerialStage::connect(Box::new(transport), Options::default()).expect("a session")
}

#[track_caller]
fn await_that(what: &str, mut happened: impl FnMut() -> bool) {
    let start = Instant::now();
    while !happened() {
        assert!(start.elapsed() < LONG, "never happened: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn is_safe(world: &World) -> bool {
    let state = world.state();
    !state.moving && !state.shutter_open
}

#[test]
fn a_stage_is_driven_through_a_pseudo_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("ttyGONIO");
    let (firmware, world) = firmware(200.0, Faults::default());
    let pty = serve_pty(firmware, Some(&link)).expect("a pseudo-terminal");
    let path = pty.path.to_str().expect("text").to_owned();
    let cancel = Cancel::new();

    let mut stage = SerialStage::open(&path, Options::default()).expect("a session");
    assert_eq!((stage.identity().serial.as_str(), stage.identity().boot_counter), ("GONIO-SIM", 1));
    let second = SerialTransport::open(&path, serial::DEFAULT_BAUD).map(drop);
    assert_eq!(second, Err(DeviceError::InUse { device: path.clone() }));

    stage.home(&cancel).expect("homed");
    let pose = Pose::from_degrees(45.0, -30.0);
    assert_eq!(stage.move_to(pose, &cancel).expect("moved"), pose);
    assert!((world.state().actual.tilt.degrees() - 45.0).abs() < 1e-9);
    stage.set_lamp(0.5, &cancel).expect("warm");
    assert_eq!(world.state().lamp, 0.5);
    stage.set_shutter(true).expect("open");
    assert!(world.state().shutter_open);
    let sensors = stage.sensors().expect("sensors");
    assert!((sensors.lamp_monitor - 0.5).abs() < 1e-3 && sensors.interlock_closed);
    assert_eq!(stage.trigger(Duration::from_millis(1)).expect("a pulse"), 1);
    let statistics = stage.statistics();
    assert!(statistics.sent > 0 && statistics.received > 0 && statistics.round_trip > Duration::ZERO);

    // The port is free again for the next program, and the lamp is still warm.
    drop(stage);
    assert!(is_safe(&world));
    let mut stage = SerialStage::open(&path, Options::default()).expect("a session");
    assert_eq!(stage.move_to(Pose::default(), &cancel).expect("still homed"), Pose::default());
    assert_eq!(world.state().lamp, 0.5);
}

#[test]
fn a_port_that_cannot_be_opened_says_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = |path: &std::path::Path| {
        SerialTransport::open(path.to_str().expect("text"), serial::DEFAULT_BAUD)
            .map(drop)
            .expect_err("no port")
    };
    let absent = folder.path().join("ttyUSB7");
    assert!(matches!(open(&absent), DeviceError::Absent { .. }));
    let file = folder.path().join("notes.txt");
    std::fs::write(&file, "not a port").expect("written");
    assert!(matches!(open(&file), DeviceError::Io { .. }));
    let link = folder.path().join("taken");
    std::fs::write(&link, "not a link").expect("written");
    assert!(serve_pty(firmware(1.0, Faults::default()).0, Some(&link)).is_err());
    assert_eq!(std::fs::read_to_string(&link).expect("still there"), "not a link");
}

#[test]
fn a_pulled_cable_ends_the_client_with_a_clear_error() {
    let folder = tempfile::tempdir().expect("a folder");
    // a name of its own: the pseudo-terminal's is given to the next one as soon as it is free, and another device answers there
    let link = folder.path().join("ttyGONIO");
    let (firmware, _) = firmware(20.0, Faults::default());
    let mut pty = serve_pty(firmware, Some(&link)).expect("a pseudo-terminal");
    let path = pty.path.to_str().expect("text").to_owned();
    let options = Options { patience: Duration::from_millis(100), ..Options::default() };
    let mut stage = SerialStage::open(&path, options).expect("a session");
    stage.home(&Cancel::new()).expect("homed");
    pty.stop();
    assert_eq!(stage.sensors().map(drop), Err(DeviceError::Gone { device: path.clone() }));
    assert_eq!(stage.set_shutter(true), Err(DeviceError::Gone { device: path }));
}

#[test]
fn a_plug_that_is_put_back_is_found_and_the_move_it_interrupted_ends_where_it_should() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("ttyGONIO");
    let (firmware, world) = firmware(5.0, Faults::default());
    let pty = serve_pty(firmware, Some(&link)).expect("a pseudo-terminal");
    let mut stage = SerialStage::open(link.to_str().expect("text"), Options::default()).expect("a session");
    let cancel = Cancel::new();
    stage.home(&cancel).expect("homed");
    let there = Pose::from_degrees(85.0, 0.0);
    let moved = std::thread::scope(|scope| {
        scope.spawn(|| {
            await_that("motion", || world.state().readback.tilt.degrees() > 1.0);
            pty.pull();
            assert!(!link.exists(), "the port is gone");
            await_that("the lease to stop it", || !world.state().moving);
            pty.plug();
        });
        stage.move_to(there, &cancel)
    });
    assert_eq!(moved, Ok(there));
    assert_eq!((stage.statistics().sessions, stage.identity().boot_counter), (2, 1));
}

#[test]
fn a_device_that_restarts_while_its_plug_is_pulled_is_not_believed_its_positions() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("ttyGONIO");
    let mut faults = Faults::default().at_move(What::HangUp, 1).at_move(What::Restart, 1);
    faults.events[0].for_s = Some(5.0);
    let (firmware, _world) = firmware(20.0, faults);
    let _pty = serve_pty(firmware, Some(&link)).expect("a pseudo-terminal");
    let mut stage = SerialStage::open(link.to_str().expect("text"), Options::default()).expect("a session");
    let cancel = Cancel::new();
    stage.home(&cancel).expect("homed");
    let there = Pose::from_degrees(60.0, 0.0);
    let void = stage.move_to(there, &cancel).expect_err("restarted");
    assert!(matches!(&void, DeviceError::PositionsVoid { why } if why.contains("restarted")), "{void}");
    stage.home(&cancel).expect("homed again");
    assert_eq!(stage.move_to(there, &cancel), Ok(there));
    assert_eq!(stage.identity().boot_counter, 2);
}

#[test]
fn a_stop_does_not_wait_for_a_port_that_is_gone() {
    let folder = tempfile::tempdir().expect("a folder");
    // a name of its own: the pseudo-terminal's is given to the next one as soon as it is free, and another device answers there
    let link = folder.path().join("ttyGONIO");
    let (firmware, _world) = firmware(5.0, Faults::default());
    let pty = serve_pty(firmware, Some(&link)).expect("a pseudo-terminal");
    let options = Options { patience: LONG, ..Options::default() };
    let mut stage = SerialStage::open(link.to_str().expect("text"), options).expect("a session");
    stage.home(&Cancel::new()).expect("homed");
    pty.pull();
    let begun = Instant::now();
    let stopped = stage.stop();
    assert!(matches!(stopped, Err(DeviceError::Gone { .. })), "{stopped:?}");
    assert!(begun.elapsed() < LONG / 2, "it waited for the port");
}

#[test]
fn dropping_the_client_stops_motion_and_closes_the_shutter() {
    let (transport, _served, world) = in_memory(5.0, Faults::default());
    let mut stage = connect(transport);
    stage.home(&Cancel::new()).expect("homed");
    stage.set_shutter(true).expect("open");
    let far = Command::Move {
        tilt_udeg: 85_000_000,
        spin_udeg: 0,
        speed_udeg_s: 10_000_000,
        accel_udeg_s2: 100_000_000,
    };
    let _pending = stage.client().start(far).expect("a client");
    await_that("motion", || world.state().moving);
    drop(stage);
    assert!(is_safe(&world), "{:?}", world.state());
    assert!(world.state().readback.tilt.degrees() < 84.0);
}

#[test]
fn a_panic_with_the_stage_in_hand_leaves_the_device_safe() {
    let (transport, _served, world) = in_memory(5.0, Faults::default());
    let mut stage = connect(transport);
    stage.home(&Cancel::new()).expect("homed");
    let panicked = std::thread::spawn(move || {
        stage.set_shutter(true).expect("open");
        std::panic::resume_unwind(Box::new("as any bug would"));
    });
    assert!(panicked.join().is_err());
    assert!(is_safe(&world), "{:?}", world.state());
}

#[test]
fn the_clock_of_the_device_is_told() {
    let begun = Instant::now();
    let (transport, _served, _world) = in_memory(1.0, Faults::default());
    let stage = connect(transport);
    await_that("a heartbeat", || stage.statistics().clock_offset_s.is_some());
    let statistics = stage.statistics();
    let (offset, error) =
        (statistics.clock_offset_s.expect("just seen"), statistics.clock_error_s.expect("with it"));
    // both clocks began since
    assert!(offset.abs() < begun.elapsed().as_secs_f64() + error, "{offset} s ± {error} s");
    assert!(error > 0.0 && error < begun.elapsed().as_secs_f64());
}

#[test]
fn a_client_that_loses_its_line_in_mid_motion_leaves_a_safe_device_behind() {
    let (transport, _served, world) = in_memory(5.0, Faults::default());
    let faults = LineFaults { hang_up_after: Some(3_000), ..LineFaults::default() };
    let mut stage = connect(FaultyTransport::new(transport, faults, 1));
    let cancel = Cancel::new();
    stage.set_shutter(true).expect("open");
    let lost = loop {
        if let Err(error) = stage.home(&cancel) {
            break error;
        }
    };
    assert!(matches!(lost, DeviceError::Gone { .. }), "{lost}");
    await_that("a safe device", || is_safe(&world));
}

#[test]
fn on_a_bad_line_every_command_is_executed_exactly_once() {
    for seed in 0..4 {
        let (transport, _served, world) = in_memory(20.0, Faults::default());
        let faults = LineFaults {
            loss: 0.15,
            corruption: 0.1,
            duplication: 0.15,
            reorder: 0.1,
            delay: Duration::from_millis(4),
            ..LineFaults::default()
        };
        let stage = connect(FaultyTransport::new(transport, faults, seed));
        let trigger = Command::CameraTrigger { exposure_us: 1 };
        let pending: Vec<_> = (0..40).map(|_| stage.client().start(trigger).expect("a client")).collect();
        for (n, pending) in (1..).zip(&pending) {
            let outcome = pending.wait(LONG).expect("an end");
            assert_eq!(outcome, Ok(Outcome::Triggered { count: n }), "seed {seed}");
        }
        assert_eq!(world.state().triggers, 40);
        let statistics = stage.statistics();
        assert!(statistics.retransmitted > 0 && statistics.corrupted > 0, "{statistics:?}");
    }
}

#[test]
fn a_stop_request_ends_a_move_and_leaves_the_stage_usable() {
    let (transport, _served, world) = in_memory(5.0, Faults::default());
    let mut stage = connect(transport);
    let cancel = Cancel::new();
    stage.home(&cancel).expect("homed");
    stage.set_shutter(true).expect("open");
    std::thread::scope(|scope| {
        scope.spawn(|| {
            await_that("motion", || world.state().readback.tilt.degrees() > 1.0);
            cancel.stop();
        });
        let stopped = stage.move_to(Pose::from_degrees(85.0, 0.0), &cancel);
        assert_eq!(stopped, Err(DeviceError::Cancelled));
    });
    assert!(is_safe(&world) && world.state().readback.tilt.degrees() < 80.0);
    assert_eq!(stage.home(&cancel), Err(DeviceError::Cancelled));
    stage.home(&Cancel::new()).expect("usable");
}

#[test]
fn an_emergency_stop_from_another_thread_is_obeyed_and_stays_until_rearmed() {
    let (transport, _served, world) = in_memory(5.0, Faults::default());
    let mut stage = connect(transport);
    let cancel = Cancel::new();
    stage.home(&cancel).expect("homed");
    std::thread::scope(|scope| {
        scope.spawn(|| {
            await_that("motion", || world.state().readback.tilt.degrees() > 1.0);
            cancel.emergency_stop();
        });
        let stopped = stage.move_to(Pose::from_degrees(85.0, 0.0), &cancel);
        assert!(matches!(stopped, Err(DeviceError::Cancelled | DeviceError::Fault { .. })), "{stopped:?}");
    });
    await_that("standstill", || is_safe(&world));
    let latched = stage.set_shutter(true);
    assert!(
        matches!(&latched, Err(DeviceError::Fault { fault, .. }) if fault.contains("emergency")),
        "{latched:?}"
    );
    stage.rearm().expect("re-armed");
    stage.move_to(Pose::default(), &Cancel::new()).expect("usable, and still homed");
    stage.emergency_stop().expect("heard");
    assert!(matches!(stage.set_shutter(true), Err(DeviceError::Fault { .. })));
}

#[test]
fn faults_of_the_device_are_told_with_advice() {
    let faults = Faults::default().at_move(What::StallTilt, 1).at_move(What::Restart, 2);
    let (transport, _served, _world) = in_memory(20.0, faults);
    let events = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&events);
    let options = Options {
        events: Some(Arc::new(move |event: &StageEvent| {
            seen.lock().expect("not poisoned").push(event.clone());
        })),
        ..Options::default()
    };
    let mut stage = SerialStage::connect(Box::new(transport), options).expect("a session");
    let cancel = Cancel::new();
    let there = Pose::from_degrees(60.0, 0.0);
    stage.home(&cancel).expect("homed");
    let stall = stage.move_to(there, &cancel).expect_err("stalled").to_string();
    assert!(stall.contains("tilt axis has stalled") && stall.contains("re-arm and home"), "{stall}");
    stage.rearm().expect("re-armed");
    let void = stage.move_to(there, &cancel).expect_err("void").to_string();
    assert!(void.contains("home it first"), "{void}");
    stage.home(&cancel).expect("homed");
    let restart = stage.move_to(there, &cancel).expect_err("restarted").to_string();
    assert!(restart.contains("restart"), "{restart}");
    stage.home(&cancel).expect("a new session has begun");
    assert_eq!(stage.identity().boot_counter, 2);
    stage.move_to(there, &cancel).expect("all is well");
    let outside = stage.move_to(Pose::from_degrees(88.0, 0.0), &cancel).expect_err("outside").to_string();
    assert!(outside.contains("reaches from -2° to 87°"), "{outside}");
    let events = events.lock().expect("not poisoned");
    assert!(events.contains(&StageEvent::Restarted { boot: 2 }));
    assert!(events.iter().any(|event| matches!(event, StageEvent::Fault { .. })));
}

#[test]
fn a_device_of_another_protocol_version_is_refused_with_both_versions() {
    let faults = Faults { protocol_version: Some(9), ..Faults::default() };
    let (transport, _served, _world) = in_memory(1.0, faults);
    let refused =
        SerialStage::connect(Box::new(transport), Options::default()).map(drop).expect_err("refused");
    let DeviceError::Version { found, expected, .. } = &refused else { panic!("{refused}") };
    assert!(found.starts_with("9 ") && expected.starts_with("1 "), "{refused}");
}

#[test]
fn a_silent_device_fails_commands_and_is_found_again_when_it_speaks() {
    let (transport, _served, world) = in_memory(1.0, Faults::default());
    let options = Options { silence_timeout: Duration::from_millis(300), ..Options::default() };
    let mut stage = SerialStage::connect(Box::new(transport), options).expect("a session");
    world.switch(|s| s.silent = true);
    let silent = stage.sensors().expect_err("silent");
    assert!(matches!(silent, DeviceError::Timeout { .. }), "{silent}");
    world.switch(|s| s.silent = false);
    await_that("an answer", || stage.sensors().is_ok());

    let (transport, _served, world) = in_memory(1.0, Faults::default());
    world.switch(|s| s.silent = true);
    let options = Options { connect_timeout: Duration::from_millis(300), ..Options::default() };
    let never = SerialStage::connect(Box::new(transport), options).map(drop).expect_err("no greeting");
    assert!(matches!(never, DeviceError::Timeout { .. }), "{never}");
}

#[test]
fn a_late_heartbeat_costs_time_and_is_never_taken_for_a_dark_sample() {
    let (transport, _served, world) = in_memory(5.0, Faults::default());
    let mut stage = connect(transport);
    let cancel = Cancel::new();
    stage.home(&cancel).expect("homed");
    let there = Pose::from_degrees(85.0, 0.0);
    let interrupted = std::thread::scope(|scope| {
        scope.spawn(|| {
            await_that("motion", || world.state().readback.tilt.degrees() > 1.0);
            world.switch(|s| s.silent = true);
            await_that("the lease to expire", || !world.state().moving);
            world.switch(|s| s.silent = false);
        });
        stage.move_to(there, &cancel)
    });
    assert_eq!(interrupted, Ok(there));

    stage.set_shutter(true).expect("open");
    assert!(stage.sensors().is_ok());
    world.switch(|s| s.silent = true);
    await_that("the lease to expire", || !world.state().shutter_open);
    world.switch(|s| s.silent = false);
    let noticed = stage.sensors();
    assert!(matches!(noticed, Err(DeviceError::Fault { .. })), "{noticed:?}");
    stage.set_shutter(true).expect("open again");
    assert!(stage.sensors().is_ok());
}

#[test]
fn the_tap_sees_every_byte_in_both_directions() {
    let taken = Arc::new(Mutex::new((Vec::new(), Vec::new())));
    let seen = Arc::clone(&taken);
    let options = Options {
        tap: Some(Arc::new(move |direction, _at: Instant, bytes: &[u8]| {
            let mut taken = seen.lock().expect("not poisoned");
            match direction {
                Direction::ToDevice => taken.0.extend_from_slice(bytes),
                Direction::FromDevice => taken.1.extend_from_slice(bytes),
            }
        })),
        ..Options::default()
    };
    let (transport, _served, _world) = in_memory(20.0, Faults::default());
    let mut stage = SerialStage::connect(Box::new(transport), options).expect("a session");
    stage.home(&Cancel::new()).expect("homed");
    drop(stage);
    let taken = taken.lock().expect("not poisoned");
    let packets = |bytes: &[u8]| -> Vec<Packet> {
        let mut decoder = Decoder::new();
        bytes.iter().filter_map(|&byte| decoder.push(byte)).map(|packet| packet.expect("sound")).collect()
    };
    let homed = packets(&taken.0).iter().any(|packet| match packet {
        Packet::Frame(_, body) => {
            matches!(from_body(body), Ok(ToDevice::Command { command: Command::Home, .. }))
        }
        Packet::Hello(_) => false,
    });
    assert!(homed && packets(&taken.1).len() > 3);
}

/// Gives frames that hold their exposure, and takes as long.
struct Ramp(u64);

impl Camera for Ramp {
    fn info(&self) -> CameraInfo {
        CameraInfo { name: "ramp".into(), serial: "1".into(), width: 40, height: 30, bits: 12 }
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        let end = Instant::now() + exposure;
        while Instant::now() < end {
            if cancel.is_raised() {
                return Err(DeviceError::Cancelled);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.0 += 1;
        Ok(Frame {
            width: 40,
            height: 30,
            pixels: (0..1200).map(|n| n % 4096).collect(),
            exposure,
            sequence: self.0,
            stamp: Duration::from_millis(7),
            sensor_temperature_c: Some(31.25),
        })
    }
}

#[test]
fn a_camera_is_lent_through_a_socket() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("camera");
    let absent = SocketCamera::connect(&path).map(drop).expect_err("nobody serves");
    assert!(matches!(absent, DeviceError::Absent { .. }));
    let server = CameraServer::serve(Box::new(Ramp(0)), &path).expect("a server");
    assert!(matches!(
        CameraServer::serve(Box::new(Ramp(0)), &path).map(drop),
        Err(DeviceError::InUse { .. })
    ));

    let mut camera = SocketCamera::connect(&path).expect("a camera");
    assert_eq!(camera.info(), Ramp(0).info());
    let second = SocketCamera::connect(&path).map(drop).expect_err("one client at a time");
    assert!(matches!(second, DeviceError::InUse { .. }), "{second}");

    let exposure = Duration::from_micros(1500);
    let frame = camera.capture(exposure, &Cancel::new()).expect("a frame");
    assert_eq!(frame, Ramp(0).capture(exposure, &Cancel::new()).expect("the same"));

    let cancel = Cancel::new();
    std::thread::scope(|scope| {
        scope.spawn(|| cancel.stop());
        let stopped = camera.capture(LONG, &cancel);
        assert_eq!(stopped, Err(DeviceError::Cancelled));
    });
    let next = camera.capture(exposure, &Cancel::new()).expect("usable");
    assert_eq!(next.sequence, 2);

    drop(camera);
    let mut camera = SocketCamera::connect(&path).expect("the camera is free again");
    drop(server);
    let gone = camera.capture(exposure, &Cancel::new());
    assert!(matches!(gone, Err(DeviceError::Gone { .. })), "{gone:?}");
    assert!(!path.exists());
}
