//! The virtual firmware told by the protocol's host side, in virtual time: no threads, no sleeps.

use gonio_instrument::builtin;
use gonio_protocol::hello::Version;
use gonio_protocol::host::{Host, HostEvent};
use gonio_protocol::message::{
    Axis, Command, Fault, Motion, Outcome, Position, Reason, Reply, SensorReadings, Status,
};
use gonio_sim::firmware::{Faults, Firmware, Settings, What};
use gonio_sim::world::World;
use std::collections::BTreeMap;
use std::time::Duration;

const SPEED: u32 = 40_000_000;
const ACCEL: u32 = 200_000_000;
const LONG: Duration = Duration::from_secs(120);

fn settings() -> Settings {
    let instrument = builtin::description("reference").expect("known").expect("valid");
    Settings::new(&instrument, 42, 1.0)
}

struct Bench {
    host: Host,
    firmware: Firmware,
    world: World,
    now: Duration,
    events: Vec<(Duration, HostEvent)>,
    next_id: u32,
    /// Sent and without a final reply: sent again when a session begins.
    outstanding: BTreeMap<u32, Command>,
    /// The host's process hangs: it neither sends nor reads.
    host_hangs: bool,
}

impl Bench {
    fn new(settings: Settings, faults: Faults) -> Bench {
        let world = World::new(settings.time_scale);
        let firmware = Firmware::new(settings, world.clone(), faults);
        let mut bench = Bench {
            host: Host::new(1, 1, Version::default()),
            firmware,
            world,
            now: Duration::ZERO,
            events: Vec::new(),
            next_id: 0,
            outstanding: BTreeMap::new(),
            host_hangs: false,
        };
        assert!(bench.run(LONG, |b| b.host.is_connected()));
        bench
    }

    /// A bench whose axes have been homed.
    fn homed(settings: Settings, faults: Faults) -> Bench {
        let mut bench = Bench::new(settings, faults);
        assert_eq!(bench.ask(Command::Home), Reply::Done(Outcome::At(Position::default())));
        bench
    }

    fn run(&mut self, long: Duration, mut done: impl FnMut(&Bench) -> bool) -> bool {
        let end = self.now + long;
        while self.now < end && !done(self) {
            if !self.host_hangs {
                while let Some(frame) = self.host.poll_transmit(self.now) {
                    self.firmware.receive(self.now, frame.as_slice());
                }
            }
            let mut out = Vec::new();
            self.firmware.poll(self.now, &mut out);
            let mut input = out.as_slice();
            while !self.host_hangs
                && let Some(event) = self.host.receive(self.now, &mut input)
            {
                match event {
                    HostEvent::Connected(_) => {
                        for (&id, &command) in &self.outstanding {
                            self.host.command(id, command).expect("a new link is free");
                        }
                    }
                    HostEvent::Reply { id, reply } if reply != Reply::Accepted => {
                        self.outstanding.remove(&id);
                    }
                    _ => {}
                }
                self.events.push((self.now, event));
            }
            if done(self) {
                break;
            }
            let host = if self.host_hangs { None } else { self.host.next_timeout() };
            let next = self.firmware.next_timeout(self.now).min(host.unwrap_or(end));
            self.now = next.max(self.now + Duration::from_micros(100)).min(end);
        }
        done(self)
    }

    fn send(&mut self, command: Command) -> u32 {
        self.next_id += 1;
        self.host.command(self.next_id, command).expect("free");
        self.outstanding.insert(self.next_id, command);
        self.next_id
    }

    fn final_reply(&self, id: u32) -> Option<Reply> {
        self.events.iter().rev().find_map(|(_, event)| match event {
            HostEvent::Reply { id: of, reply } if *of == id && *reply != Reply::Accepted => Some(*reply),
            _ => None,
        })
    }

    fn wait(&mut self, id: u32) -> Reply {
        assert!(self.run(LONG, |b| b.final_reply(id).is_some()), "no reply to command {id}");
        self.final_reply(id).expect("just seen")
    }

    fn ask(&mut self, command: Command) -> Reply {
        let id = self.send(command);
        self.wait(id)
    }

    fn status(&mut self) -> Status {
        match self.ask(Command::Status) {
            Reply::Done(Outcome::Status(status)) => status,
            other => panic!("{other:?}"),
        }
    }

    fn sensors(&mut self) -> SensorReadings {
        match self.ask(Command::Sensors) {
            Reply::Done(Outcome::Sensors(readings)) => readings,
            other => panic!("{other:?}"),
        }
    }

    fn fault(&self) -> Option<Fault> {
        self.events.iter().find_map(|(_, event)| match event {
            HostEvent::Fault { fault, .. } => Some(*fault),
            _ => None,
        })
    }

    fn moving(&mut self) -> u32 {
        let id = self.send(go(80_000_000, 0));
        assert!(self.run(LONG, |b| b.world.state().readback.tilt.degrees() > 10.0));
        id
    }
}

fn go(tilt_udeg: i32, spin_udeg: i32) -> Command {
    Command::Move { tilt_udeg, spin_udeg, speed_udeg_s: SPEED, accel_udeg_s2: ACCEL }
}

fn at(tilt_udeg: i32, spin_udeg: i32) -> Reply {
    Reply::Done(Outcome::At(Position { tilt_udeg, spin_udeg }))
}

const OPEN: Command = Command::Shutter { open: true };
const LAMP: Command = Command::Lamp { on: true, level_ppm: 1_000_000 };

#[test]
fn a_move_before_homing_is_refused_and_after_it_ends_where_it_should() {
    let mut bench = Bench::new(settings(), Faults::default());
    assert_eq!(bench.ask(go(1, 1)), Reply::Rejected(Reason::NotHomed));
    assert_eq!(bench.ask(Command::Home), at(0, 0));
    assert_eq!(bench.ask(go(45_000_000, -90_000_000)), at(45_000_000, -90_000_000));
    let state = bench.world.state();
    assert_eq!((state.actual.tilt.degrees().round(), state.actual.spin.degrees().round()), (45.0, -90.0));
    assert!((state.actual.tilt.degrees() - 45.0).abs() < 1e-9, "play must not show");
}

#[test]
fn the_sample_is_where_the_encoders_say_from_above_and_from_below() {
    let mut bench = Bench::homed(settings(), Faults::default());
    for tilt in [60_000_000, 20_000_000, 45_000_000] {
        assert_eq!(bench.ask(go(tilt, 0)), at(tilt, 0));
        assert!((bench.world.state().actual.tilt.degrees() - f64::from(tilt) / 1e6).abs() < 1e-9);
    }
}

#[test]
fn targets_outside_the_limits_and_impossible_rates_are_refused_with_what_is_possible() {
    let mut bench = Bench::homed(settings(), Faults::default());
    let limits = Reason::OutsideLimits { axis: Axis::Tilt, min_udeg: -2_000_000, max_udeg: 87_000_000 };
    assert_eq!(bench.ask(go(87_000_001, 0)), Reply::Rejected(limits));
    for (speed_udeg_s, accel_udeg_s2) in [(0, ACCEL), (SPEED, 0), (u32::MAX, ACCEL)] {
        let command = Command::Move { tilt_udeg: 0, spin_udeg: 0, speed_udeg_s, accel_udeg_s2 };
        assert!(matches!(bench.ask(command), Reply::Rejected(Reason::Rate { .. })));
    }
}

#[test]
fn a_second_move_is_refused_while_one_is_under_way_and_a_stop_ends_it() {
    let mut bench = Bench::homed(settings(), Faults::default());
    let first = bench.moving();
    assert_eq!(bench.ask(go(0, 0)), Reply::Rejected(Reason::Busy));
    let Reply::Done(Outcome::At(stopped)) = bench.ask(Command::Stop) else { panic!("stop") };
    assert_eq!(bench.wait(first), Reply::Aborted(None));
    assert!(stopped.tilt_udeg > 10_000_000 && stopped.tilt_udeg < 80_000_000);
    assert_eq!(bench.status().position, stopped, "it stands, and knows where");
    assert_eq!(bench.ask(go(0, 0)), at(0, 0));
}

#[test]
fn without_heartbeats_motion_stops_the_shutter_closes_and_the_fault_stays_until_rearmed() {
    let mut bench = Bench::homed(settings(), Faults::default());
    bench.ask(LAMP);
    bench.ask(OPEN);
    let id = bench.moving();
    assert!(bench.world.state().shutter_open);
    bench.host_hangs = true;
    let hung = bench.now;
    assert!(bench.run(LONG, |b| !b.world.state().moving && !b.world.state().shutter_open));
    // Lease, deceleration (40/200 s), and steps.
    assert!(bench.now - hung < Duration::from_millis(150 + 200 + 20), "{:?}", bench.now - hung);
    assert!(bench.world.state().lamp > 0.0, "the lamp is slow to warm and has a lease of its own");
    bench.host_hangs = false;
    assert_eq!(bench.wait(id), Reply::Aborted(Some(Fault::LeaseExpired)));
    assert!(bench.run(LONG, |b| b.fault() == Some(Fault::LeaseExpired)));
    assert_eq!(bench.ask(go(0, 0)), Reply::Rejected(Reason::FaultLatched(Fault::LeaseExpired)));
    assert_eq!(bench.ask(OPEN), Reply::Rejected(Reason::FaultLatched(Fault::LeaseExpired)));
    assert_eq!(bench.ask(Command::Rearm), Reply::Done(Outcome::Nothing));
    assert_eq!(bench.ask(go(0, 0)), at(0, 0));
}

#[test]
fn an_idle_device_may_be_left_alone() {
    let mut bench = Bench::homed(settings(), Faults::default());
    bench.host_hangs = true;
    bench.run(Duration::from_secs(5), |_| false);
    bench.host_hangs = false;
    assert_eq!(bench.status().fault, None);
}

#[test]
fn the_lamp_goes_off_when_nobody_has_been_there_for_its_lease() {
    let mut bench = Bench::homed(settings(), Faults::default());
    bench.ask(LAMP);
    bench.run(Duration::from_secs(120), |_| false);
    assert!(bench.world.state().lamp > 0.9, "heartbeats renew it");
    bench.host_hangs = true;
    bench.run(Duration::from_secs(59), |_| false);
    assert!(bench.world.state().lamp > 0.9);
    bench.run(Duration::from_secs(2), |_| false);
    assert_eq!(bench.world.state().lamp, 0.0);
}

#[test]
fn time_scale_compresses_motion_and_warm_up_and_leaves_leases_alone() {
    let time = |time_scale| {
        let mut bench = Bench::homed(Settings { time_scale, ..settings() }, Faults::default());
        let start = bench.now;
        assert_eq!(bench.ask(go(80_000_000, 0)), at(80_000_000, 0));
        bench.now - start
    };
    let (real, fast) = (time(1.0), time(20.0));
    assert!(real > Duration::from_secs(2) && fast < real / 15, "{real:?} {fast:?}");

    let mut bench = Bench::homed(Settings { time_scale: 100.0, ..settings() }, Faults::default());
    bench.ask(LAMP);
    let start = bench.now;
    assert!(bench.run(LONG, |b| b.world.state().lamp == 1.0));
    assert!(bench.now - start < Duration::from_secs(2));
    bench.ask(OPEN);
    bench.host_hangs = true;
    let hung = bench.now;
    assert!(bench.run(LONG, |b| !b.world.state().shutter_open));
    assert!(bench.now - hung > Duration::from_millis(100), "a lease is not compressed");
}

#[test]
fn an_opened_lid_stops_everything_and_the_fault_persists_until_it_is_closed() {
    let mut bench = Bench::homed(settings(), Faults::default());
    bench.ask(LAMP);
    bench.ask(OPEN);
    let id = bench.moving();
    bench.world.switch(|s| s.interlock_open = true);
    assert_eq!(bench.wait(id), Reply::Aborted(Some(Fault::InterlockOpen)));
    assert!(bench.run(LONG, |b| !b.world.state().moving && !b.world.state().shutter_open));
    assert_eq!(bench.world.state().lamp, 0.0);
    assert_eq!(bench.ask(Command::Rearm), Reply::Rejected(Reason::FaultPersists(Fault::InterlockOpen)));
    bench.world.switch(|s| s.interlock_open = false);
    assert_eq!(bench.ask(Command::Rearm), Reply::Done(Outcome::Nothing));
    assert_eq!(bench.status().fault, None);
}

#[test]
fn a_hot_lamp_goes_off_at_once() {
    let faults = Faults::default().at_s(What::OverTemperature, 20.0, Some(5.0));
    let mut bench = Bench::homed(settings(), faults);
    bench.ask(LAMP);
    assert!(bench.run(LONG, |b| b.fault().is_some()));
    assert!(
        matches!(bench.fault(), Some(Fault::OverTemperature { temperature_mc }) if temperature_mc > 85_000)
    );
    assert_eq!(bench.world.state().lamp, 0.0);
    assert!(matches!(bench.ask(Command::Rearm), Reply::Rejected(Reason::FaultPersists(_))));
    bench.run(Duration::from_secs(6), |_| false);
    assert_eq!(bench.ask(Command::Rearm), Reply::Done(Outcome::Nothing));
}

#[test]
fn a_stalled_axis_voids_the_positions() {
    let mut bench = Bench::homed(settings(), Faults::default().at_move(What::StallTilt, 2));
    assert_eq!(bench.ask(go(10_000_000, 0)), at(10_000_000, 0));
    let stall = Fault::Stall { axis: Axis::Tilt };
    assert_eq!(bench.ask(go(50_000_000, 0)), Reply::Aborted(Some(stall)));
    let tilt = bench.world.state().actual.tilt.degrees();
    assert!((20.0..40.0).contains(&tilt), "half-way, not {tilt}");
    assert_eq!(bench.ask(Command::Rearm), Reply::Done(Outcome::Nothing));
    assert_eq!(bench.ask(go(0, 0)), Reply::Rejected(Reason::NotHomed));
    assert_eq!(bench.ask(Command::Home), at(0, 0));
    assert_eq!(bench.ask(go(50_000_000, 0)), at(50_000_000, 0));
}

#[test]
fn a_restart_during_a_move_is_told_and_voids_the_positions() {
    let mut bench = Bench::homed(settings(), Faults::default().at_move(What::Restart, 1));
    bench.send(go(50_000_000, 0));
    let rebooted = |b: &Bench| b.events.iter().any(|(_, e)| *e == HostEvent::Rebooted { boot: 2 });
    assert!(bench.run(LONG, rebooted));
    assert!(bench.run(LONG, |b| b.host.is_connected()));
    assert_eq!(bench.ask(go(0, 0)), Reply::Rejected(Reason::NotHomed));
    assert_eq!(bench.status().boot, 2);
}

#[test]
fn an_emergency_stop_works_in_every_state() {
    for state in 0..5 {
        let mut bench = Bench::homed(settings(), Faults::default());
        bench.ask(LAMP);
        let running = match state {
            0 => None,
            1 => Some(bench.moving()),
            2 => {
                let id = bench.send(Command::Home);
                assert!(bench.run(LONG, |b| b.world.state().moving));
                Some(id)
            }
            3 => {
                bench.ask(OPEN);
                None
            }
            _ => {
                bench.world.switch(|s| s.interlock_open = true);
                bench.run(Duration::from_millis(50), |_| false);
                None
            }
        };
        let id = bench.host.emergency_stop();
        let answered = |b: &Bench| b.events.iter().any(|(_, e)| *e == HostEvent::EmergencyStopped { id });
        assert!(bench.run(LONG, answered), "state {state}");
        assert!(bench.run(LONG, |b| !b.world.state().moving && !b.world.state().shutter_open));
        assert_eq!(bench.world.state().lamp, 0.0, "state {state}");
        if let Some(id) = running {
            assert_eq!(bench.wait(id), Reply::Aborted(Some(Fault::EmergencyStop)), "state {state}");
        }
        assert!(bench.status().fault.is_some());
    }
}

#[test]
fn another_host_finds_a_device_at_rest() {
    let mut bench = Bench::homed(settings(), Faults::default());
    bench.ask(OPEN);
    let old = bench.moving();
    bench.host = Host::new(2, 77, Version::default());
    bench.outstanding.clear();
    bench.events.clear();
    assert!(bench.run(LONG, |b| b.host.is_connected()));
    assert!(bench.run(LONG, |b| !b.world.state().moving && !b.world.state().shutter_open));
    let Status { motion, fault, homed, .. } = bench.status();
    assert_eq!((motion, fault, homed), (Motion::Idle, None, true));
    assert_eq!(bench.ask(go(0, 0)), at(0, 0));
    assert_eq!(bench.final_reply(old), None, "the new host never asked for it");
}

#[test]
fn a_silent_device_makes_itself_safe_and_comes_back() {
    let mut bench = Bench::homed(settings(), Faults::default());
    bench.ask(OPEN);
    bench.world.switch(|s| s.silent = true);
    assert!(bench.run(LONG, |b| !b.world.state().shutter_open));
    assert!(bench.run(LONG, |b| !b.host.is_connected()), "the host notices");
    bench.world.switch(|s| s.silent = false);
    assert!(bench.run(LONG, |b| b.host.is_connected()));
    assert_eq!(bench.status().fault, Some(Fault::LeaseExpired));
}

#[test]
fn sensors_and_poses_depend_on_seed_and_pose_and_not_on_time() {
    let drifting =
        Settings { lamp_drift: 0.02, tilt_zero_deg: 0.5, tilt_repeatability_deg: 0.01, ..settings() };
    let visit = |settings: &Settings, tilts: &[i32]| {
        let mut bench = Bench::homed(settings.clone(), Faults::default());
        bench.ask(LAMP);
        assert!(bench.run(LONG * 2, |b| b.world.state().lamp >= 1.0));
        let mut seen = None;
        for &tilt in tilts {
            bench.ask(go(tilt, 0));
            seen = Some((bench.sensors(), bench.world.state().actual, bench.world.state().lamp));
        }
        seen.expect("one tilt at least")
    };
    let whole = visit(&drifting, &[0, 5_000_000, 30_000_000, 85_000_000, 40_000_000]);
    let resumed = visit(&drifting, &[40_000_000]);
    assert_eq!(whole, resumed);
    let other = visit(&Settings { seed: 43, ..drifting.clone() }, &[40_000_000]);
    assert_ne!(whole.1, other.1);
    // 40° is the ninth of eighteen poses.
    assert!((whole.2 - (1.0 + 0.02 * 8.0 / 17.0)).abs() < 1e-12);
    assert!((whole.1.tilt.degrees() - 40.5).abs() < 0.05 && whole.1.tilt.degrees() != 40.5);
    assert!((f64::from(whole.0.lamp_monitor_ppm) / 1e6 - whole.2).abs() < 1e-3);
}
