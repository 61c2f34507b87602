//! The device thread: the only place that touches transport and protocol.

use super::outcome::{describe_command, restarted_error, result_of};
use super::{Direction, Options, Snapshot, StageEvent};
use crate::transport::Transport;
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
}

impl Worker {
    pub fn new(
        transport: Box<dyn Transport>,
        options: Options,
        inbox: Receiver<Request>,
        snapshot: Arc<Mutex<Snapshot>>,
        ready: SyncSender<Result<(), DeviceError>>,
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
            self.step(LONGEST_WAIT)?;
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

    fn send_commands(&mut self) {
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
                self.update(|snapshot| snapshot.telemetry = Some(telemetry));
            }
            HostEvent::EmergencyStopped { .. } => {}
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

    fn update(&self, change: impl FnOnce(&mut Snapshot)) {
        change(&mut self.snapshot.lock().unwrap_or_else(PoisonError::into_inner));
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
            };
        });
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }
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
