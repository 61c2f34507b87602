//! The device's side of the protocol: greeting, session, repeated commands, replies. Sans-I/O, no allocation.
//!
//! A greeting alone does not end the session under way: the new session begins with its first sound frame, so that a
//! stale greeting cannot throw a working host out. What commands *do* is the firmware's business; it gets each of them
//! once and answers with [`Device::reply`].

use crate::dedup::{Dedup, Seen};
use crate::frame::{Encoded, encode_hello};
use crate::hello::{Hello, Role, Serial, Version};
use crate::host::is_emergency;
use crate::link::{Link, Received, Statistics, WINDOW};
use crate::message::{Command, Reason, Reply, ToDevice, ToHost, from_body, to_body};
use crate::{PROTOCOL_VERSION, SCHEMA_HASH, UNANSWERED};
use core::time::Duration;

/// Shortest time between two announcements.
pub const ANNOUNCE_INTERVAL: Duration = Duration::from_millis(100);
/// Commands remembered.
pub const REMEMBERED: usize = 32;
/// Messages that wait while the host does not acknowledge: two replies to each unanswered command, and some faults.
const BACKLOG: usize = 2 * UNANSWERED + 4;

/// Who the device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Version of the firmware.
    pub version: Version,
    /// Starts of the device so far, this one included. Kept where a power cut does not reach it.
    pub boot: u32,
    /// Serial number.
    pub serial: Serial,
    /// Protocol version told in the hello: [`PROTOCOL_VERSION`] but in tests of refusal.
    pub protocol: u8,
}

impl Identity {
    /// An identity that speaks this protocol.
    pub fn new(version: Version, boot: u32, serial: Serial) -> Identity {
        Identity { version, boot, serial, protocol: PROTOCOL_VERSION }
    }
}

/// Something the firmware must act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceEvent {
    /// A session has begun.
    Session {
        /// Another host program than before.
        new_client: bool,
    },
    /// Execute this; it has not been executed before.
    Command {
        /// For the reply.
        id: u32,
        /// What to do.
        command: Command,
    },
    /// Renew the leases and send telemetry with this counter.
    Heartbeat {
        /// Counter to repeat.
        counter: u32,
    },
    /// Stop now; then call [`Device::emergency_stopped`]. May come more than once.
    EmergencyStop {
        /// Id to repeat.
        id: u32,
    },
}

/// The device's side.
#[derive(Clone, Debug)]
pub struct Device {
    link: Link,
    identity: Identity,
    client: Option<u32>,
    pending: Option<Pending>,
    hello: Option<Hello>,
    announced: Option<Duration>,
    dedup: Dedup<REMEMBERED>,
    heartbeat: u32,
    backlog: [Option<ToHost>; BACKLOG],
    /// An event that came together with a more urgent one.
    held_back: Option<DeviceEvent>,
}

#[derive(Clone, Copy, Debug)]
struct Pending {
    session: u32,
    client: u32,
    window: u16,
}

impl Device {
    /// A device that has just started; it announces itself at the first poll.
    pub fn new(identity: Identity) -> Device {
        let mut device = Device {
            link: Link::new(),
            identity,
            client: None,
            pending: None,
            hello: None,
            announced: None,
            dedup: Dedup::new(),
            heartbeat: 0,
            backlog: [None; BACKLOG],
            held_back: None,
        };
        device.hello = Some(device.greeting(Role::Announce, 0, 0));
        device
    }

    /// A session is under way.
    pub fn is_connected(&self) -> bool {
        self.link.session().is_some()
    }

    /// Counters of the link.
    pub fn statistics(&self) -> Statistics {
        self.link.statistics()
    }

    /// Takes bytes from the front of `input` until something is to be done or none are left; call until it gives `None`.
    pub fn receive(&mut self, now: Duration, input: &mut &[u8]) -> Option<DeviceEvent> {
        if let Some(event) = self.held_back.take() {
            return Some(event);
        }
        while let Some(received) = self.link.receive(now, input) {
            let event = match received {
                Received::Hello(hello) => {
                    self.greeted(hello);
                    None
                }
                Received::Data(body) => match from_body(&body) {
                    Ok(ToDevice::Command { id, command }) => self.command(id, command),
                    _ => None,
                },
                Received::Datagram(body) => match from_body(&body) {
                    Ok(ToDevice::Heartbeat { counter }) if counter > self.heartbeat => {
                        self.heartbeat = counter;
                        Some(DeviceEvent::Heartbeat { counter })
                    }
                    Ok(ToDevice::EmergencyStop { id }) => Some(DeviceEvent::EmergencyStop { id }),
                    _ => None,
                },
                Received::Foreign { session, kind, body } => {
                    let emergency = match from_body::<ToDevice>(&body) {
                        Ok(message @ ToDevice::EmergencyStop { id }) if is_emergency(kind, &message) => {
                            Some(id)
                        }
                        _ => None,
                    };
                    let begun = self.foreign(now, session);
                    // A stop is obeyed whoever asks, and before the session is told of that it may begin.
                    match emergency {
                        Some(id) => {
                            self.held_back = begun;
                            Some(DeviceEvent::EmergencyStop { id })
                        }
                        None => begun,
                    }
                }
                Received::Damaged(_) => None,
            };
            if event.is_some() {
                return event;
            }
        }
        None
    }

    /// Answers a command, now or later; the latest reply is what a repeat gets.
    pub fn reply(&mut self, id: u32, reply: Reply) {
        self.dedup.record(id, reply);
        self.tell(ToHost::Reply { id, reply });
    }

    /// Sends a message as data: a fault, say.
    pub fn tell(&mut self, message: ToHost) {
        if let Some(free) = self.backlog.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(message);
        } else {
            // The host has not acknowledged for long; it will ask again in its next session.
            self.backlog.rotate_left(1);
            if let Some(last) = self.backlog.last_mut() {
                *last = Some(message);
            }
        }
    }

    /// Sends a message as a datagram: telemetry.
    pub fn tell_now(&mut self, message: ToHost) {
        if let Ok(body) = to_body(&message) {
            self.link.send_datagram(body);
        }
    }

    /// Answers an emergency stop.
    pub fn emergency_stopped(&mut self, id: u32) {
        self.tell_now(ToHost::EmergencyStopped { id });
    }

    /// The next bytes to send, if any are due; call until it gives `None`.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Encoded> {
        if let Some(hello) = self.hello.take() {
            if hello.role == Role::Announce {
                self.announced = Some(now);
            }
            return Some(encode_hello(&hello));
        }
        self.drain_backlog();
        self.link.poll_transmit(now)
    }

    /// When [`Device::poll_transmit`] must be called next at the latest. `None`: only when something has come.
    pub fn next_timeout(&self) -> Option<Duration> {
        let waiting = self.backlog.iter().any(Option::is_some) && self.link.free() > 0 && self.is_connected();
        if self.hello.is_some() || waiting { Some(Duration::ZERO) } else { self.link.next_timeout() }
    }

    fn drain_backlog(&mut self) {
        if !self.is_connected() {
            return;
        }
        while let Some(message) = self.backlog.first().copied().flatten() {
            if let Ok(body) = to_body(&message)
                && self.link.send(body).is_err()
            {
                return;
            }
            if let Some(first) = self.backlog.first_mut() {
                *first = None;
            }
            self.backlog.rotate_left(1);
        }
    }

    fn greeting(&self, role: Role, session: u32, client: u32) -> Hello {
        Hello {
            role,
            protocol: self.identity.protocol,
            window: WINDOW as u16,
            schema: SCHEMA_HASH,
            version: self.identity.version,
            boot: self.identity.boot,
            session,
            client,
            serial: self.identity.serial,
        }
    }

    fn greeted(&mut self, hello: Hello) {
        if hello.role != Role::Ask {
            return;
        }
        self.hello = Some(self.greeting(Role::Answer, hello.session, hello.client));
        let compatible = hello.protocol == self.identity.protocol && hello.schema == SCHEMA_HASH;
        if compatible && self.link.session() != Some(hello.session) {
            self.pending =
                Some(Pending { session: hello.session, client: hello.client, window: hello.window });
        }
    }

    fn foreign(&mut self, now: Duration, session: u32) -> Option<DeviceEvent> {
        match self.pending {
            Some(pending) if pending.session == session => {
                self.pending = None;
                self.link.open(session, pending.window);
                self.heartbeat = 0;
                let new_client = self.client != Some(pending.client);
                if new_client {
                    self.dedup.clear();
                    self.backlog = [None; BACKLOG];
                    self.client = Some(pending.client);
                }
                Some(DeviceEvent::Session { new_client })
            }
            _ => {
                // A late frame of an old session is normal while a session runs; without one the host must learn
                // that its session is gone.
                let due = !self.is_connected()
                    && self.announced.is_none_or(|at| now.saturating_sub(at) >= ANNOUNCE_INTERVAL);
                if due && self.hello.is_none() {
                    self.hello = Some(self.greeting(Role::Announce, 0, 0));
                }
                None
            }
        }
    }

    fn command(&mut self, id: u32, command: Command) -> Option<DeviceEvent> {
        match self.dedup.begin(id) {
            Seen::New => return Some(DeviceEvent::Command { id, command }),
            Seen::Before(reply) => self.tell(ToHost::Reply { id, reply }),
            Seen::Forgotten => self.tell(ToHost::Reply { id, reply: Reply::Rejected(Reason::Forgotten) }),
        }
        None
    }
}
