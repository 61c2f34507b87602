//! Two ends over a channel that loses, damages, repeats and delays, in virtual time: everything queued arrives
//! exactly once and in order, whatever the channel does short of staying silent for ever.

mod channel;

use channel::{Channel, Weather};
use gonio_protocol::device::{Device, DeviceEvent, Identity};
use gonio_protocol::frame::Body;
use gonio_protocol::hello::{Serial, Version};
use gonio_protocol::host::{Host, HostEvent};
use gonio_protocol::link::{Link, Received};
use gonio_protocol::message::{Command, Outcome, Reply};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::time::Duration;

fn number(n: u32) -> Body {
    Body::new(&n.to_le_bytes()).expect("four bytes fit")
}

/// Sends `count` numbers each way and gives what arrived, and the time it took.
fn exchange(count: u32, weather: Weather, seed: u64) -> (Vec<u32>, Vec<u32>, Duration, [Link; 2]) {
    let mut ends = [Link::new(), Link::new()];
    let mut channels = [Channel::new(seed, weather), Channel::new(!seed, weather)];
    let mut queued = [0u32; 2];
    let mut got = [Vec::new(), Vec::new()];
    for end in &mut ends {
        end.open(7, 8);
    }
    let mut now = Duration::ZERO;
    let limit = Duration::from_secs(3600);
    while now < limit
        && (got.iter().any(|g| g.len() < count as usize) || ends.iter().any(|e| !e.is_flushed()))
    {
        for side in 0..2 {
            while queued[side] < count && ends[side].send(number(queued[side])).is_ok() {
                queued[side] += 1;
            }
            while let Some(frame) = ends[side].poll_transmit(now) {
                channels[side].send(now, frame.as_slice());
            }
        }
        let next = ends
            .iter()
            .filter_map(Link::next_timeout)
            .chain(channels.iter().filter_map(Channel::next_arrival))
            .min()
            .unwrap_or(limit);
        now = now.max(next);
        for side in 0..2 {
            while let Some(bytes) = channels[1 - side].arrived(now) {
                let mut input = bytes.as_slice();
                while let Some(received) = ends[side].receive(now, &mut input) {
                    if let Received::Data(body) = received {
                        let bytes: [u8; 4] = body.as_slice().try_into().expect("a number");
                        got[side].push(u32::from_le_bytes(bytes));
                    }
                }
            }
        }
    }
    let [a, b] = got;
    (a, b, now, ends)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn everything_arrives_once_and_in_order_in_bad_weather(
        seed: u64, loss in 0u64..40, damage in 0u64..20, repeat in 0u64..30, delay_ms in 0u64..30,
    ) {
        let count = 60;
        let (a, b, ..) = exchange(count, Weather { loss, damage, repeat, delay_ms }, seed);
        let want: Vec<u32> = (0..count).collect();
        prop_assert_eq!(a, want.clone());
        prop_assert_eq!(b, want);
    }
}

#[test]
fn in_fair_weather_nothing_is_sent_twice() {
    let weather = Weather { loss: 0, damage: 0, repeat: 0, delay_ms: 0 };
    let (_, _, _, ends) = exchange(200, weather, 1);
    for end in &ends {
        let statistics = end.statistics();
        assert_eq!((statistics.retransmits, statistics.duplicates, statistics.damaged), (0, 0, 0));
        assert!(statistics.round_trip.is_some_and(|r| r < Duration::from_millis(10)));
    }
}

#[test]
fn sequence_numbers_wrap() {
    let weather = Weather { loss: 5, damage: 0, repeat: 5, delay_ms: 1 };
    let count = 70_000;
    let (a, b, ..) = exchange(count, weather, 5);
    assert!(a.iter().copied().eq(0..count) && b.iter().copied().eq(0..count));
}

/// A host and a device that executes shutter commands, over two channels.
struct Bench {
    host: Host,
    device: Device,
    down: Channel,
    up: Channel,
    now: Duration,
    executed: Vec<u32>,
    events: Vec<HostEvent>,
    stopped: u32,
    outstanding: BTreeMap<u32, Command>,
}

impl Bench {
    fn new(weather: Weather, seed: u64) -> Bench {
        Bench {
            host: Host::new(1, 100, Version::default()),
            device: Device::new(identity(1)),
            down: Channel::new(seed, weather),
            up: Channel::new(!seed, weather),
            now: Duration::ZERO,
            executed: Vec::new(),
            events: Vec::new(),
            stopped: 0,
            outstanding: BTreeMap::new(),
        }
    }

    fn command(&mut self, id: u32, command: Command) {
        self.host.command(id, command).expect("free");
        self.outstanding.insert(id, command);
    }

    fn run_until(&mut self, end: Duration, mut done: impl FnMut(&Bench) -> bool) -> bool {
        while self.now < end && !done(self) {
            while let Some(frame) = self.host.poll_transmit(self.now) {
                self.down.send(self.now, frame.as_slice());
            }
            while let Some(frame) = self.device.poll_transmit(self.now) {
                self.up.send(self.now, frame.as_slice());
            }
            let next = [
                self.host.next_timeout(),
                self.device.next_timeout(),
                self.down.next_arrival(),
                self.up.next_arrival(),
            ];
            self.now = self.now.max(next.into_iter().flatten().min().unwrap_or(end)).min(end);
            while let Some(bytes) = self.down.arrived(self.now) {
                let mut input = bytes.as_slice();
                while let Some(event) = self.device.receive(self.now, &mut input) {
                    match event {
                        DeviceEvent::Command { id, .. } => {
                            self.executed.push(id);
                            self.device.reply(id, Reply::Done(Outcome::Nothing));
                        }
                        DeviceEvent::EmergencyStop { id } => {
                            self.stopped += 1;
                            self.device.emergency_stopped(id);
                        }
                        DeviceEvent::Session { .. } | DeviceEvent::Heartbeat { .. } => {}
                    }
                }
            }
            while let Some(bytes) = self.up.arrived(self.now) {
                let mut input = bytes.as_slice();
                while let Some(event) = self.host.receive(self.now, &mut input) {
                    match event {
                        HostEvent::Connected(_) => {
                            for (&id, &command) in &self.outstanding {
                                self.host.command(id, command).expect("a new link is free");
                            }
                        }
                        HostEvent::Reply { id, reply: Reply::Done(_) } => {
                            self.outstanding.remove(&id);
                        }
                        _ => {}
                    }
                    self.events.push(event);
                }
            }
        }
        done(self)
    }

    fn replies(&self) -> Vec<u32> {
        self.events
            .iter()
            .filter_map(|event| match event {
                HostEvent::Reply { id, reply: Reply::Done(_) } => Some(*id),
                _ => None,
            })
            .collect()
    }
}

fn identity(boot: u32) -> Identity {
    Identity::new(Version { major: 1, minor: 2, patch: 3 }, boot, Serial::new("BENCH-1"))
}

const ROUGH: Weather = Weather { loss: 20, damage: 10, repeat: 20, delay_ms: 5 };
const MINUTE: Duration = Duration::from_secs(60);

#[test]
fn every_command_is_executed_once_and_answered_in_rough_weather() {
    for seed in 0..20 {
        let mut bench = Bench::new(ROUGH, seed);
        assert!(bench.run_until(MINUTE, |b| b.host.is_connected()), "seed {seed}");
        for id in 1..=40 {
            assert!(bench.run_until(MINUTE, |b| b.host.free() > 0 && b.outstanding.len() < 8), "seed {seed}");
            bench.command(id, Command::Shutter { open: id % 2 == 0 });
        }
        assert!(bench.run_until(MINUTE, |b| b.replies().len() >= 40), "seed {seed}");
        assert_eq!(bench.executed, (1..=40).collect::<Vec<_>>(), "seed {seed}");
        assert_eq!(bench.replies(), bench.executed, "seed {seed}");
    }
}

#[test]
fn a_command_repeated_in_a_new_session_is_answered_and_not_executed_again() {
    let fair = Weather { loss: 0, damage: 0, repeat: 0, delay_ms: 0 };
    let mut bench = Bench::new(fair, 3);
    assert!(bench.run_until(MINUTE, |b| b.host.is_connected()));
    bench.host.command(9, Command::Sensors).expect("free");
    assert!(bench.run_until(MINUTE, |b| b.replies().len() == 1));
    bench.host.reconnect(bench.now);
    assert!(!bench.host.is_connected());
    assert!(bench.run_until(MINUTE, |b| b.host.is_connected()));
    bench.host.command(9, Command::Sensors).expect("free");
    assert!(bench.run_until(MINUTE, |b| b.replies().len() == 2));
    assert_eq!(bench.executed, [9]);
}

#[test]
fn a_restarted_device_is_noticed_and_a_new_session_begins() {
    let mut bench = Bench::new(ROUGH, 4);
    assert!(bench.run_until(MINUTE, |b| b.host.is_connected()));
    bench.device = Device::new(identity(2));
    let rebooted = |b: &Bench| b.events.contains(&HostEvent::Rebooted { boot: 2 });
    assert!(bench.run_until(MINUTE, rebooted));
    assert!(bench.run_until(MINUTE, |b| b.host.is_connected()));
}

#[test]
fn an_emergency_stop_is_repeated_until_it_is_answered_and_passes_a_full_queue() {
    let mut bench = Bench::new(Weather { loss: 60, ..ROUGH }, 5);
    assert!(bench.run_until(MINUTE, |b| b.host.is_connected()));
    for id in 1..=8 {
        bench.host.command(id, Command::Status).expect("free");
    }
    assert!(bench.host.command(9, Command::Status).is_err());
    let id = bench.host.emergency_stop();
    assert!(bench.run_until(MINUTE, |b| b.events.contains(&HostEvent::EmergencyStopped { id })));
    assert!(bench.stopped >= 1);
}

#[test]
fn a_device_of_another_protocol_version_is_refused_and_named() {
    let mut bench = Bench::new(Weather { loss: 0, damage: 0, repeat: 0, delay_ms: 0 }, 6);
    bench.device = Device::new(Identity { protocol: 2, ..identity(1) });
    let refused = |b: &Bench| {
        b.events.iter().any(|e| matches!(e, HostEvent::Incompatible(hello) if hello.protocol == 2))
    };
    assert!(bench.run_until(MINUTE, refused));
    assert!(bench.host.poll_transmit(bench.now + MINUTE).is_none());
}

#[test]
fn a_stale_greeting_does_not_end_the_session_under_way() {
    let fair = Weather { loss: 0, damage: 0, repeat: 0, delay_ms: 0 };
    let mut bench = Bench::new(fair, 7);
    assert!(bench.run_until(MINUTE, |b| b.host.is_connected() && b.device.is_connected()));
    let mut stranger = Host::new(2, 999, Version::default());
    let hello = stranger.poll_transmit(bench.now).expect("a greeting");
    bench.down.send(bench.now, hello.as_slice());
    bench.command(1, Command::Status);
    assert!(bench.run_until(MINUTE, |b| b.replies() == [1]));
    assert_eq!(bench.host.statistics().sessions, 1);
}
