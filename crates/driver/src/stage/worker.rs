//! The device thread: the only place that touches transport and protocol.

use super::outcome::{describe_command, restarted_error, result_of};
use super::returning::{Checked, Returning};
use super::{Direction, Options, Snapshot, StageEvent};
use crate::transport::{Transport, Waker, memory_pair};
use gonio_instrument::{DeviceError, LinkStatistics, StageIdentity};
use gonio_protocol::hello::{Hello, Version};
use gonio_protocol::host::{Host, HostEvent};
use gonio_protocol::message::{Command, Outcome};
use gonio_protocol::{PROTOCOL_VERSION, SCHEMA_HASH, UNANSWERED};
use std::collections::BTreeMap;
use std::hash::{BuildHasher, RandomState};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest wait, so that watchdogs are looked at.
const LONGEST_WAIT: Duration = Duration::from_millis(50);
/// How long a dropped client tries to make the device safe.
const FAREWELL: Duration = Duration::from_millis(1500);

/// How often a port that hung up is looked for.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Told the end of a command.
pub(super) type Done = Box<dyn FnOnce(Result<Outcome, DeviceError>) + Send>;

/// What the client asks of the thread.
pub(super) enum Request {
    Command { command: Command, done: Done },
    EmergencyStop,
}

struct Outstanding {
    command: Command,
    done: Done,
    asked: Instant,
    /// In the session under way.
    sent: bool,
}

pub(super) struct Worker {
    transport: Box<dyn Transport>,
    options: Options,
    inbox: Receiver<Request>,
    snapshot: Arc<Mutex<Snapshot>>,
    ready: Option<SyncSender<Result<(), DeviceError>>>,
    host: Host,
    start: Instant,
    next_id: u32,
    outstanding: BTreeMap<u32, Outstanding>,
    /// The silence has been told.
    silent: bool,
    /// Wakes the transport under way, whichever that is.
    waker: Arc<Mutex<Waker>>,
    /// The port is back and the device not yet checked: commands wait.
    returning: Option<Returning>,
}

impl Worker {
    pub fn new(
        transport: Box<dyn Transport>,
        options: Options,
        inbox: Receiver<Request>,
        snapshot: Arc<Mutex<Snapshot>>,
        ready: SyncSender<Result<(), DeviceError>>,
        waker: Arc<Mutex<Waker>>,
    ) -> Worker {
        // Ids that no other run of the program has: the standard library's hash keys are random.
        let random = RandomState::new().hash_one(std::process::id());
        let (client, session) = (random as u32, (random >> 32) as u32);
        Worker {
            transport,
            options,
            inbox,
            snapshot,
            ready: Some(ready),
            host: Host::new(client, session, program_version()),
            start: Instant::now(),
            next_id: 0,
            outstanding: BTreeMap::new(),
            silent: false,
            waker,
            returning: None,
        }
    }

    pub fn run(mut self) {
        if let Err(error) = self.serve() {
            self.fail_all(&error);
            self.tell(&StageEvent::Gone(error.clone()));
            if let Some(ready) = self.ready.take() {
                let _ = ready.try_send(Err(error));
            }
        }
    }

    /// Until the client is dropped (`Ok`) or the port is gone.
    fn serve(&mut self) -> Result<(), DeviceError> {
        // Brings a decoder that has heard half a frame into step.
        self.send(&[0])?;
        loop {
            if !self.take_requests() {
                return self.farewell();
            }
            if let Err(error) = self.step(LONGEST_WAIT) {
                self.find_again(error)?;
            }
            if self.ready.is_some() && self.start.elapsed() >= self.options.connect_timeout {
                return Err(DeviceError::Timeout {
                    device: self.transport.name().to_owned(),
                    what: "the greeting".to_owned(),
                    waited: self.options.connect_timeout,
                });
            }
            self.watch();
        }
    }

    /// Sends what is due, waits for bytes, and takes them.
    fn step(&mut self, longest: Duration) -> Result<(), DeviceError> {
        self.send_commands();
        let now = self.now();
        while let Some(frame) = self.host.poll_transmit(now) {
            self.send(frame.as_slice())?;
        }
        let now = self.now();
        let wait = self.host.next_timeout().map_or(longest, |at| at.saturating_sub(now).min(longest));
        let bytes = self.transport.receive(wait)?;
        if !bytes.is_empty() {
            if let Some(tap) = &self.options.tap {
                tap(Direction::FromDevice, Instant::now(), &bytes);
            }
            let now = self.now();
            let mut input = bytes.as_slice();
            while let Some(event) = self.host.receive(now, &mut input) {
                self.event(event)?;
            }
        }
        self.publish();
        Ok(())
    }

    /// False once the client has been dropped.
    fn take_requests(&mut self) -> bool {
        loop {
            match self.inbox.try_recv() {
                Ok(Request::Command { command, done }) => {
                    self.next_id = self.next_id.wrapping_add(1);
                    let outstanding = Outstanding { command, done, asked: Instant::now(), sent: false };
                    self.outstanding.insert(self.next_id, outstanding);
                }
                Ok(Request::EmergencyStop) => {
                    self.host.emergency_stop();
                }
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }

    /// A port that hung up is looked for until it is back or patience ends; commands wait meanwhile, and go out again with their old
    /// ids once the device has been found to be the same, and to stand where it stood.
    fn find_again(&mut self, error: DeviceError) -> Result<(), DeviceError> {
        let lost = matches!(error, DeviceError::Gone { .. } | DeviceError::Io { .. });
        let Some(reopen) = self.options.reopen.clone().filter(|_| lost && self.ready.is_none()) else {
            return Err(error);
        };
        let since = Instant::now();
        self.tell(&StageEvent::HungUp(error.clone()));
        let telemetry = self.update(|snapshot| snapshot.telemetry.take());
        // put down at once: a port that is still held comes back under another name, or not at all
        self.transport = Box::new(memory_pair(self.transport.name()).0);
        loop {
            if !self.take_requests() {
                return Err(error);
            }
            match reopen() {
                Ok(transport) => {
                    *self.waker.lock().unwrap_or_else(PoisonError::into_inner) = transport.waker();
                    self.transport = transport;
                    break;
                }
                Err(_) if since.elapsed() < self.patience() => std::thread::sleep(LOOK_AGAIN),
                // the last word is why it cannot be opened: in use, denied, absent
                Err(why @ (DeviceError::InUse { .. } | DeviceError::Denied { .. })) => return Err(why),
                Err(_) => return Err(error),
            }
        }
        let motion = self.outstanding.values().any(|o| moves(o.command));
        self.returning = Some(Returning::new(telemetry.map(|t| t.status), motion, since));
        self.host.reconnect(self.now());
        // one that hangs up again at once is looked for again at the next step
        let _ = self.send(&[0]);
        Ok(())
    }

    /// Whoever asks for a stop does not want to wait for the port: the device has made itself safe by its lease.
    fn patience(&self) -> Duration {
        let stopping = self.outstanding.values().any(|o| o.command == Command::Stop);
        if stopping { self.options.patience.min(FAREWELL) } else { self.options.patience }
    }

    /// The first state that the device tells after the port came back.
    fn check_return(&mut self, status: &gonio_protocol::message::Status) {
        let Some(returning) = self.returning.take() else { return };
        match returning.check(status) {
            Checked::Same => {
                self.tell(&StageEvent::Returned { away: returning.away(), position: status.position });
            }
            Checked::Moved(why) => {
                self.tell(&StageEvent::Shifted { why: why.clone() });
                self.fail_all(&DeviceError::PositionsVoid { why });
            }
        }
    }

    fn send_commands(&mut self) {
        if self.returning.is_some() {
            return;
        }
        // The oldest ones only: the device keeps replies for no more while the line is bad.
        let allowed = self.outstanding.iter_mut().take(UNANSWERED);
        for (&id, outstanding) in allowed.filter(|(_, o)| !o.sent) {
            if self.host.command(id, outstanding.command).is_err() {
                return;
            }
            outstanding.sent = true;
        }
    }

    fn event(&mut self, event: HostEvent) -> Result<(), DeviceError> {
        match event {
            HostEvent::Connected(hello) => {
                let identity = identity(&hello);
                let known = self.update(|snapshot| snapshot.identity.serial.clone());
                if self.ready.is_none() && known != identity.serial {
                    return Err(DeviceError::Refused {
                        command: format!("to go on as {known}"),
                        reason: format!("{} answers at {} now", identity.serial, self.transport.name()),
                    });
                }
                self.silent = false;
                for outstanding in self.outstanding.values_mut() {
                    outstanding.sent = false;
                }
                self.update(|snapshot| snapshot.identity = identity.clone());
                self.tell(&StageEvent::Connected(identity));
                if let Some(ready) = self.ready.take() {
                    let _ = ready.try_send(Ok(()));
                }
            }
            HostEvent::Incompatible(hello) => {
                let device = self.transport.name().to_owned();
                let version = |protocol, schema: u64| format!("{protocol} (schema {schema:016x})");
                return Err(DeviceError::Version {
                    device,
                    found: format!("{} in firmware {}", version(hello.protocol, hello.schema), hello.version),
                    expected: version(PROTOCOL_VERSION, SCHEMA_HASH),
                });
            }
            HostEvent::Rebooted { boot } => {
                self.returning = None;
                // what was told before says nothing of this start, and a restart is told once
                self.update(|snapshot| snapshot.telemetry = None);
                self.fail_all(&restarted_error(boot));
                self.tell(&StageEvent::Restarted { boot });
            }
            HostEvent::Reply { id, reply } => {
                let result = self.outstanding.get(&id).and_then(|o| result_of(o.command, reply));
                if let Some(result) = result
                    && let Some(outstanding) = self.outstanding.remove(&id)
                {
                    (outstanding.done)(result);
                }
            }
            HostEvent::Fault { fault, uptime_ms } => {
                self.tell(&StageEvent::Fault { fault, uptime: Duration::from_millis(uptime_ms.into()) });
            }
            HostEvent::Telemetry(telemetry) => {
                self.check_return(&telemetry.status);
                self.update(|snapshot| snapshot.telemetry = Some(telemetry));
            }
            HostEvent::EmergencyStopped { id } => self.tell(&StageEvent::EmergencyStopped { id }),
        }
        Ok(())
    }

    /// Commands must not wait for ever on a device that says nothing.
    fn watch(&mut self) {
        let now = self.now();
        let waited = self.host.silence(now).unwrap_or(now);
        if waited < self.options.silence_timeout || self.ready.is_some() {
            return;
        }
        if !self.silent {
            self.silent = true;
            self.tell(&StageEvent::Silent { waited });
        }
        let patience = self.options.silence_timeout;
        let overdue = |o: &Outstanding| o.asked.elapsed() >= patience;
        let ids: Vec<u32> = self.outstanding.iter().filter(|(_, o)| overdue(o)).map(|(id, _)| *id).collect();
        for id in ids {
            if let Some(outstanding) = self.outstanding.remove(&id) {
                let what = describe_command(outstanding.command);
                let device = self.transport.name().to_owned();
                (outstanding.done)(Err(DeviceError::Timeout { device, what, waited }));
            }
        }
    }

    /// The client is gone: stop motion, close the shutter, let the device acknowledge, then close the port.
    fn farewell(&mut self) -> Result<(), DeviceError> {
        self.fail_all(&DeviceError::Gone { device: self.transport.name().to_owned() });
        let end = Instant::now() + FAREWELL;
        for command in [Command::Stop, Command::Shutter { open: false }] {
            self.next_id = self.next_id.wrapping_add(1);
            let outstanding =
                Outstanding { command, done: Box::new(drop), asked: Instant::now(), sent: false };
            self.outstanding.insert(self.next_id, outstanding);
        }
        while !(self.outstanding.is_empty() && self.host.is_flushed()) && Instant::now() < end {
            self.step(LONGEST_WAIT)?;
        }
        Ok(())
    }

    fn fail_all(&mut self, error: &DeviceError) {
        for (_, outstanding) in std::mem::take(&mut self.outstanding) {
            (outstanding.done)(Err(error.clone()));
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        if let Some(tap) = &self.options.tap {
            tap(Direction::ToDevice, Instant::now(), bytes);
        }
        self.transport.send(bytes)
    }

    fn tell(&self, event: &StageEvent) {
        match event {
            StageEvent::Connected(identity) => tracing::debug!(?identity, "session begun"),
            StageEvent::Gone(error) => tracing::debug!(%error, "device thread ends"),
            other => tracing::warn!(?other, "stage"),
        }
        if let Some(events) = &self.options.events {
            events(event);
        }
    }

    fn update<T>(&self, change: impl FnOnce(&mut Snapshot) -> T) -> T {
        change(&mut self.snapshot.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn publish(&self) {
        let statistics = self.host.statistics();
        let silence = self.host.silence(self.now());
        self.update(|snapshot| {
            snapshot.heard = silence.and_then(|long| Instant::now().checked_sub(long));
            snapshot.statistics = LinkStatistics {
                sent: statistics.link.sent,
                received: statistics.link.received,
                retransmitted: statistics.link.retransmits,
                corrupted: statistics.link.damaged,
                duplicates: statistics.link.duplicates,
                round_trip: statistics
                    .heartbeat_round_trip
                    .or(statistics.link.round_trip)
                    .unwrap_or_default(),
                silent_for: Duration::ZERO,
                sessions: statistics.sessions,
                clock_offset_s: statistics.clock.map(|c| c.offset_us as f64 * 1e-6),
                clock_error_s: statistics.clock.map(|c| c.error.as_secs_f64()),
            };
        });
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }
}

/// Whether a command changes where the axes stand.
const fn moves(command: Command) -> bool {
    matches!(command, Command::Home | Command::Move { .. } | Command::Stop)
}

fn identity(hello: &Hello) -> StageIdentity {
    StageIdentity {
        name: "motion controller".to_owned(),
        serial: hello.serial.as_str().to_owned(),
        firmware: hello.version.to_string(),
        boot_counter: hello.boot,
    }
}

fn program_version() -> Version {
    let mut parts = env!("CARGO_PKG_VERSION").split('.').map(|part| part.parse().unwrap_or(0));
    let mut next = || parts.next().unwrap_or(0);
    Version { major: next(), minor: next(), patch: next() }
}
