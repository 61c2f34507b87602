//! Host and device against a model of what they promise, through random sequences of whatever can happen: commands that end at once or later, emergency
//! stops, a line that goes silent one way or both, weather of all kinds, a device that restarts, a host program that is replaced by another.
//!
//! The model knows only the promise. At every moment: a command is executed at most once, in the order of the ids, and only where it was asked for; an answer
//! is the one that the device gave to that id. In the end, on a calm line: session, no command without an answer, no emergency stop unheard.

mod channel;

use channel::{Channel, Weather};
use gonio_protocol::UNANSWERED;
use gonio_protocol::device::{Device, DeviceEvent, Identity};
use gonio_protocol::hello::{Serial, Version};
use gonio_protocol::host::{Host, HostEvent};
use gonio_protocol::message::{Command, Outcome, Reply};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

#[derive(Clone, Debug)]
enum Happening {
    /// A command that the device takes so long for, ms; 0: it ends at once.
    Command(u64),
    Emergency,
    /// Nothing comes through for so long, ms: to the device, to the host.
    Silence(bool, bool, u64),
    Weather(Weather),
    Wait(u64),
    /// The device restarts.
    Restart,
    /// The host program is gone and another takes its place.
    Replaced,
    /// The port was found again.
    Reconnect,
}

const CALM: Weather = Weather { loss: 0, damage: 0, repeat: 0, delay_ms: 0 };

fn happenings() -> impl Strategy<Value = Vec<Happening>> {
    let weather = (0u64..40, 0u64..20, 0u64..30, 0u64..30)
        .prop_map(|(loss, damage, repeat, delay_ms)| Weather { loss, damage, repeat, delay_ms });
    let one = prop_oneof![
        12 => prop_oneof![Just(0u64), 1u64..400].prop_map(Happening::Command),
        1 => Just(Happening::Emergency),
        2 => (any::<bool>(), any::<bool>(), 1u64..1500).prop_map(|(a, b, ms)| Happening::Silence(a, b, ms)),
        2 => weather.prop_map(Happening::Weather),
        6 => (0u64..300).prop_map(Happening::Wait),
        1 => Just(Happening::Restart),
        1 => Just(Happening::Replaced),
        1 => Just(Happening::Reconnect),
    ];
    prop::collection::vec(one, 1..60)
}

/// Both ends, the lines, and the model.
struct Bench {
    host: Host,
    device: Device,
    down: Channel,
    up: Channel,
    now: Duration,
    client: u32,
    boot: u32,
    next_id: u32,
    /// Without a final answer, and not told as lost by a restart.
    waiting: BTreeSet<u32>,
    /// How long the device takes for each command, by client and id.
    takes: BTreeMap<(u32, u32), u64>,
    /// What the device did, by client and id: its answer. Never forgotten, whatever restarts.
    executed: BTreeMap<(u32, u32), u32>,
    count: u32,
    /// Answers that the device still owes: when, id, answer.
    owed: Vec<(Duration, u32, u32)>,
    /// Emergency stops asked for and not answered, by the host in charge.
    stops: BTreeSet<u32>,
    /// Stops that reached the device, by client and id.
    obeyed: BTreeSet<(u32, u32)>,
}

/// A command that tells whose it is.
fn asked(client: u32, id: u32) -> Command {
    Command::CameraTrigger { exposure_us: client * 1_000_000 + id }
}

fn host(client: u32) -> Host {
    Host::new(client, client * 1000, Version::default())
}

fn device(boot: u32) -> Device {
    Device::new(Identity::new(Version::default(), boot, Serial::new("PAIR")))
}

impl Bench {
    fn new(seed: u64) -> Self {
        Self {
            host: host(1),
            device: device(1),
            down: Channel::new(seed, CALM),
            up: Channel::new(!seed, CALM),
            now: Duration::ZERO,
            client: 1,
            boot: 1,
            next_id: 0,
            waiting: BTreeSet::new(),
            takes: BTreeMap::new(),
            executed: BTreeMap::new(),
            count: 0,
            owed: Vec::new(),
            stops: BTreeSet::new(),
            obeyed: BTreeSet::new(),
        }
    }

    fn command(&mut self, takes_ms: u64) {
        if self.host.free() == 0 || self.waiting.len() >= UNANSWERED {
            return;
        }
        self.next_id += 1;
        let id = self.next_id;
        self.takes.insert((self.client, id), takes_ms);
        self.host.command(id, asked(self.client, id)).expect("there is room");
        self.waiting.insert(id);
    }

    fn happen(&mut self, what: &Happening) -> Result<(), TestCaseError> {
        match what {
            Happening::Command(takes_ms) => self.command(*takes_ms),
            Happening::Emergency => {
                // the next one takes the place of one that is not answered yet
                self.stops = [self.host.emergency_stop()].into();
            }
            Happening::Silence(to_device, to_host, ms) => {
                let before = (self.down.weather, self.up.weather);
                let dead = Weather { loss: 100, ..CALM };
                if *to_device {
                    self.down.weather = dead;
                }
                if *to_host {
                    self.up.weather = dead;
                }
                self.run(Duration::from_millis(*ms), |_| false)?;
                (self.down.weather, self.up.weather) = before;
            }
            Happening::Weather(weather) => (self.down.weather, self.up.weather) = (*weather, *weather),
            Happening::Wait(ms) => {
                self.run(Duration::from_millis(*ms), |_| false)?;
            }
            Happening::Restart => {
                self.boot += 1;
                self.device = device(self.boot);
                self.owed.clear();
            }
            Happening::Replaced => {
                self.client += 1;
                self.host = host(self.client);
                (self.next_id, self.waiting, self.stops) = (0, BTreeSet::new(), BTreeSet::new());
            }
            Happening::Reconnect => self.host.reconnect(self.now),
        }
        Ok(())
    }

    /// Lets time pass until `end` from now, or until `done`.
    fn run(&mut self, time: Duration, done: impl Fn(&Self) -> bool) -> Result<bool, TestCaseError> {
        let end = self.now + time;
        while self.now < end && !done(self) {
            let now = self.now;
            for (_, id, answer) in self.owed.extract_if(.., |o| o.0 <= now) {
                self.device.reply(id, Reply::Done(Outcome::Triggered { count: answer }));
            }
            while let Some(frame) = self.host.poll_transmit(now) {
                self.down.send(now, frame.as_slice());
            }
            while let Some(frame) = self.device.poll_transmit(now) {
                self.up.send(now, frame.as_slice());
            }
            let times = [
                self.host.next_timeout(),
                self.device.next_timeout(),
                self.down.next_arrival(),
                self.up.next_arrival(),
                self.owed.iter().map(|o| o.0).min(),
            ];
            self.now = self.now.max(times.into_iter().flatten().min().unwrap_or(end)).min(end);
            self.hear_at_the_device()?;
            self.hear_at_the_host()?;
        }
        Ok(done(self))
    }

    fn hear_at_the_device(&mut self) -> Result<(), TestCaseError> {
        while let Some(bytes) = self.down.arrived(self.now) {
            let mut input = bytes.as_slice();
            while let Some(event) = self.device.receive(self.now, &mut input) {
                match event {
                    DeviceEvent::Command { id, command } => {
                        // frames of a host that is gone may still be on their way
                        let client = (1..=self.client).find(|c| command == asked(*c, id));
                        let Some((client, takes)) =
                            client.and_then(|c| self.takes.get(&(c, id)).map(|t| (c, *t)))
                        else {
                            return Err(TestCaseError::fail(format!(
                                "{id}, {command:?} was never asked for"
                            )));
                        };
                        self.count += 1;
                        let before = self.executed.insert((client, id), self.count);
                        prop_assert!(before.is_none(), "{} executed twice", id);
                        let last = self.executed.range((client, 0)..(client + 1, 0)).map(|e| e.0.1).max();
                        prop_assert_eq!(last, Some(id), "out of order");
                        match takes {
                            0 => self.device.reply(id, Reply::Done(Outcome::Triggered { count: self.count })),
                            ms => {
                                self.device.reply(id, Reply::Accepted);
                                self.owed.push((self.now + Duration::from_millis(ms), id, self.count));
                            }
                        }
                    }
                    DeviceEvent::EmergencyStop { id } => {
                        self.obeyed.insert((self.client, id));
                        self.device.emergency_stopped(id);
                    }
                    // what was begun for another host has no one left to be told
                    DeviceEvent::Session { new_client: true } => self.owed.clear(),
                    DeviceEvent::Session { .. } | DeviceEvent::Heartbeat { .. } => {}
                }
            }
        }
        Ok(())
    }

    fn hear_at_the_host(&mut self) -> Result<(), TestCaseError> {
        while let Some(bytes) = self.up.arrived(self.now) {
            let mut input = bytes.as_slice();
            while let Some(event) = self.host.receive(self.now, &mut input) {
                match event {
                    HostEvent::Connected(_) => {
                        for &id in &self.waiting {
                            let again = self.host.command(id, asked(self.client, id));
                            prop_assert!(again.is_ok(), "a new link has room for what was under way");
                        }
                    }
                    // running commands are lost, and the host is told so; a late greeting from before a restart makes it home once more, which is safe
                    HostEvent::Rebooted { boot } => {
                        prop_assert!(boot <= self.boot && self.boot > 1);
                        self.waiting.clear();
                    }
                    HostEvent::Reply { id, reply: Reply::Done(Outcome::Triggered { count }) } => {
                        let given = self.executed.get(&(self.client, id));
                        prop_assert_eq!(given, Some(&count), "the answer to another command than {}", id);
                        self.waiting.remove(&id);
                    }
                    HostEvent::Reply { id, reply } => {
                        prop_assert_eq!(reply, Reply::Accepted);
                        prop_assert!(self.executed.contains_key(&(self.client, id)));
                    }
                    HostEvent::EmergencyStopped { id } => {
                        prop_assert!(self.obeyed.contains(&(self.client, id)), "a stop that nobody heard");
                        self.stops.remove(&id);
                    }
                    HostEvent::Incompatible(_) => prop_assert!(false, "the same protocol"),
                    HostEvent::Fault { .. } | HostEvent::Telemetry(_) => {}
                }
            }
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn host_and_device_keep_what_they_promise_whatever_happens(seed: u64, course in happenings()) {
        let mut bench = Bench::new(seed);
        bench.run(Duration::from_secs(2), |b| b.host.is_connected())?;
        for what in &course {
            bench.happen(what)?;
        }
        (bench.down.weather, bench.up.weather) = (CALM, CALM);
        // what is amiss shows within the time of a silent line
        bench.run(Duration::from_secs(3), |_| false)?;
        let settled = |b: &Bench| {
            b.host.is_connected() && b.host.is_flushed() && b.waiting.is_empty() && b.stops.is_empty()
        };
        let calm = bench.run(Duration::from_secs(60), settled)?;
        prop_assert!(calm, "{:?} waiting, {:?} stops, connected {}", bench.waiting, bench.stops, bench.host.is_connected());
        // and it still works
        bench.command(0);
        let id = bench.next_id;
        prop_assert!(bench.run(Duration::from_secs(5), |b| b.waiting.is_empty())?);
        prop_assert!(bench.executed.contains_key(&(bench.client, id)));
    }
}
