//! The host's side of the protocol: greeting, session, heartbeats, commands, emergency stop. Sans-I/O.
//!
//! Drive it with four calls: [`Host::receive`] with bytes that came, [`Host::poll_transmit`] until it gives nothing,
//! [`Host::next_timeout`] to know when to poll again, [`Host::command`] to say something.

use crate::clock::{ClockFilter, ClockOffset};
use crate::frame::{Encoded, Kind, encode_hello};
use crate::hello::{Hello, Role, Serial, Version};
use crate::link::{Full, Link, Received, Statistics, WINDOW};
use crate::message::{Command, Fault, Reply, Telemetry, ToDevice, ToHost, from_body, to_body};
use crate::{HEARTBEAT_INTERVAL, PROTOCOL_VERSION, SCHEMA_HASH};
use core::time::Duration;

/// How often an unanswered greeting is repeated.
pub const ASK_INTERVAL: Duration = Duration::from_millis(100);
/// How often an unanswered emergency stop is repeated.
pub const EMERGENCY_INTERVAL: Duration = Duration::from_millis(20);
/// After this long without a sound byte the host asks for a new session by itself.
pub const SILENCE: Duration = Duration::from_millis(1000);

/// Something the host program should know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HostEvent {
    /// A session has begun. Commands without a final reply should be sent again with their old ids.
    Connected(Hello),
    /// The device speaks another protocol or another schema; nothing more is sent to it.
    Incompatible(Hello),
    /// The boot counter has changed: every position is void, running commands are lost, and a new session is being
    /// asked for.
    Rebooted {
        /// Boot counter in the device's announcement or answer.
        boot: u32,
    },
    /// About a command.
    Reply {
        /// Its id.
        id: u32,
        /// What became of it.
        reply: Reply,
    },
    /// The device has latched a fault.
    Fault {
        /// Which.
        fault: Fault,
        /// When, by the device's clock.
        uptime_ms: u32,
    },
    /// State, with every heartbeat.
    Telemetry(Telemetry),
    /// The device has answered an emergency stop.
    EmergencyStopped {
        /// Id of the emergency stop.
        id: u32,
    },
}

/// Counters of a host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostStatistics {
    /// Of the link.
    pub link: Statistics,
    /// Sessions begun.
    pub sessions: u32,
    /// Heartbeats sent.
    pub heartbeats: u64,
    /// Heartbeats answered.
    pub heartbeats_answered: u64,
    /// From the latest answered heartbeat to its answer.
    pub heartbeat_round_trip: Option<Duration>,
    /// When the latest answer to a heartbeat came.
    pub last_heartbeat: Option<Duration>,
    /// Bodies that were no message.
    pub malformed: u64,
    /// The device's clock against the host's; `None` before the first answered heartbeat since the device's start.
    pub clock: Option<ClockOffset>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Asking { next: Duration },
    Connected { next_heartbeat: Duration },
    Refused,
}

/// The host's side.
#[derive(Clone, Debug)]
pub struct Host {
    link: Link,
    state: State,
    client: u32,
    session: u32,
    version: Version,
    boot: Option<u32>,
    counter: u32,
    counter_sent_at: Duration,
    emergency: Option<(u32, Duration)>,
    emergencies: u32,
    heard: Option<Duration>,
    /// When the session last began or something of it came. Greetings do not count: a device that takes this host's frames for another session's announces
    /// itself for ever.
    session_heard: Duration,
    clock: ClockFilter,
    statistics: HostStatistics,
}

impl Host {
    /// A host that will ask for a session at its first poll. `client` and the first `session` should be drawn at
    /// random once per program run, so that two runs are not taken for one.
    pub fn new(client: u32, session: u32, version: Version) -> Host {
        Host {
            link: Link::new(),
            state: State::Asking { next: Duration::ZERO },
            client,
            session: session.max(1),
            version,
            boot: None,
            counter: 0,
            counter_sent_at: Duration::ZERO,
            emergency: None,
            emergencies: 0,
            heard: None,
            session_heard: Duration::ZERO,
            clock: ClockFilter::new(),
            statistics: HostStatistics::default(),
        }
    }

    /// A session is under way.
    pub fn is_connected(&self) -> bool {
        matches!(self.state, State::Connected { .. })
    }

    /// Queues a command; [`Full`] also without a session. Ids must rise; a command repeated after [`HostEvent::Connected`] keeps its id.
    pub fn command(&mut self, id: u32, command: Command) -> Result<(), Full> {
        if !self.is_connected() {
            return Err(Full);
        }
        let body = to_body(&ToDevice::Command { id, command }).map_err(|_| Full)?;
        self.link.send(body)
    }

    /// Commands that can be queued before the next acknowledgement.
    pub fn free(&self) -> usize {
        if self.is_connected() { self.link.free() } else { 0 }
    }

    /// Everything queued has been acknowledged.
    pub fn is_flushed(&self) -> bool {
        self.link.is_flushed() && self.emergency.is_none()
    }

    /// Sends an emergency stop before everything else, again and again until it is answered. Gives its id.
    pub fn emergency_stop(&mut self) -> u32 {
        self.emergencies = self.emergencies.wrapping_add(1);
        self.emergency = Some((self.emergencies, Duration::ZERO));
        self.emergencies
    }

    /// How long nothing sound has come from the device; `None` if nothing ever has.
    pub fn silence(&self, now: Duration) -> Option<Duration> {
        self.heard.map(|at| now.saturating_sub(at))
    }

    /// Asks for a new session; done by itself after [`SILENCE`].
    pub fn reconnect(&mut self, now: Duration) {
        self.session = self.session.wrapping_add(1).max(1);
        self.link.close();
        self.state = State::Asking { next: now };
    }

    /// Counters.
    pub fn statistics(&self) -> HostStatistics {
        HostStatistics { link: self.link.statistics(), clock: self.clock.offset(), ..self.statistics }
    }

    /// Takes bytes from the front of `input` until something comes out or none are left; call until it gives `None`.
    pub fn receive(&mut self, now: Duration, input: &mut &[u8]) -> Option<HostEvent> {
        while let Some(received) = self.link.receive(now, input) {
            if !matches!(received, Received::Damaged(_)) {
                self.heard = Some(now);
            }
            let event = match received {
                Received::Hello(hello) => self.greeted(now, hello),
                Received::Data(body) | Received::Datagram(body) => {
                    self.session_heard = now;
                    match from_body(&body) {
                        Ok(message) => Some(self.message(now, message)),
                        Err(_) => {
                            self.statistics.malformed += 1;
                            None
                        }
                    }
                }
                Received::Foreign { .. } | Received::Damaged(_) => None,
            };
            if event.is_some() {
                return event;
            }
        }
        None
    }

    /// The next bytes to send, if any are due; call until it gives `None`.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Encoded> {
        if self.is_connected() && now.saturating_sub(self.session_heard) >= SILENCE {
            self.reconnect(now);
        }
        match self.state {
            State::Refused => None,
            State::Asking { next } => (now >= next).then(|| {
                self.state = State::Asking { next: now + ASK_INTERVAL };
                encode_hello(&self.hello())
            }),
            State::Connected { next_heartbeat } => {
                if let Some((id, at)) = self.emergency
                    && now >= at
                {
                    self.emergency = Some((id, now + EMERGENCY_INTERVAL));
                    self.datagram(&ToDevice::EmergencyStop { id });
                } else if now >= next_heartbeat {
                    self.state = State::Connected { next_heartbeat: now + HEARTBEAT_INTERVAL };
                    self.counter = self.counter.wrapping_add(1);
                    self.counter_sent_at = now;
                    self.statistics.heartbeats += 1;
                    self.datagram(&ToDevice::Heartbeat { counter: self.counter });
                }
                self.link.poll_transmit(now)
            }
        }
    }

    /// When [`Host::poll_transmit`] must be called next at the latest. `None`: only when something has come.
    pub fn next_timeout(&self) -> Option<Duration> {
        match self.state {
            State::Refused => None,
            State::Asking { next } => Some(next),
            State::Connected { next_heartbeat } => {
                let emergency = self.emergency.map(|(_, at)| at);
                [Some(next_heartbeat), self.link.next_timeout(), emergency].into_iter().flatten().min()
            }
        }
    }

    fn hello(&self) -> Hello {
        Hello {
            role: Role::Ask,
            protocol: PROTOCOL_VERSION,
            window: WINDOW as u16,
            schema: SCHEMA_HASH,
            version: self.version,
            boot: 0,
            session: self.session,
            client: self.client,
            serial: Serial::default(),
        }
    }

    fn datagram(&mut self, message: &ToDevice) {
        if let Ok(body) = to_body(message) {
            self.link.send_datagram(body);
        }
    }

    fn greeted(&mut self, now: Duration, hello: Hello) -> Option<HostEvent> {
        match (hello.role, self.state) {
            (Role::Ask, _) | (_, State::Refused) => None,
            (Role::Answer, State::Asking { .. }) if hello.session == self.session => {
                if hello.protocol != PROTOCOL_VERSION || hello.schema != SCHEMA_HASH {
                    self.state = State::Refused;
                    return Some(HostEvent::Incompatible(hello));
                }
                if let Some(rebooted) = self.started(hello.boot) {
                    // The caller must hear of it before a session begins; the next greeting begins it.
                    self.reconnect(now);
                    return Some(rebooted);
                }
                self.link.open(hello.session, hello.window);
                self.state = State::Connected { next_heartbeat: now };
                self.counter = 0;
                self.session_heard = now;
                self.statistics.sessions += 1;
                Some(HostEvent::Connected(hello))
            }
            (Role::Answer, _) => None,
            (Role::Announce, State::Asking { .. }) => {
                self.state = State::Asking { next: now };
                self.started(hello.boot)
            }
            // With the known boot counter it is a late one, from before the session.
            (Role::Announce, State::Connected { .. }) if self.boot == Some(hello.boot) => None,
            (Role::Announce, State::Connected { .. }) => {
                self.reconnect(now);
                self.started(hello.boot)
            }
        }
    }

    /// Told once per restart.
    fn started(&mut self, boot: u32) -> Option<HostEvent> {
        let rebooted = self.boot.is_some_and(|known| known != boot);
        self.boot = Some(boot);
        if rebooted {
            // its clock began anew
            self.clock = ClockFilter::new();
        }
        rebooted.then_some(HostEvent::Rebooted { boot })
    }

    fn message(&mut self, now: Duration, message: ToHost) -> HostEvent {
        match message {
            ToHost::Reply { id, reply } => HostEvent::Reply { id, reply },
            ToHost::Fault { fault, uptime_ms } => HostEvent::Fault { fault, uptime_ms },
            ToHost::Telemetry(telemetry) => {
                self.statistics.heartbeats_answered += 1;
                self.statistics.last_heartbeat = Some(now);
                if telemetry.counter == self.counter {
                    self.statistics.heartbeat_round_trip = Some(now.saturating_sub(self.counter_sent_at));
                    let uptime = Duration::from_millis(u64::from(telemetry.status.uptime_ms));
                    self.clock.sample(self.counter_sent_at, now, uptime);
                }
                HostEvent::Telemetry(telemetry)
            }
            ToHost::EmergencyStopped { id } => {
                if self.emergency.is_some_and(|(sent, _)| sent == id) {
                    self.emergency = None;
                }
                HostEvent::EmergencyStopped { id }
            }
        }
    }
}

/// Kinds in which a message may travel; the other is ignored. Kept here because both ends must agree.
pub(crate) fn is_emergency(kind: Kind, message: &ToDevice) -> bool {
    kind == Kind::Datagram && matches!(message, ToDevice::EmergencyStop { .. })
}
