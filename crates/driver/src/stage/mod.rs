//! The client of a motion controller.
//!
//! [`Client::connect`] puts a transport on a thread of its own (`gonio-stage`), greets the device, checks its version, and keeps the session alive: heartbeats,
//! retransmission, a new session after a silence, commands sent again with their old ids. [`Client::execute`] is for async code,
//! [`Client::start`] and [`Pending::wait`] for blocking code; [`SerialStage`] is the [`gonio_instrument::Stage`] over it.
//!
//! Dropping the client stops motion and closes the shutter before the port is closed. If the program dies instead, the device's leases do
//! the same.

mod blocking;
mod outcome;
mod returning;
mod worker;

pub use blocking::{MotionRates, SerialStage};
pub use outcome::{describe_fault, fault_error};

use crate::transport::{Transport, Waker};
use gonio_instrument::{DeviceError, LinkStatistics, StageIdentity};
use gonio_protocol::message::{Command, Fault, Outcome, Position, Telemetry};
use std::fmt;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use worker::{Request, Worker};

/// Requests that wait for the device thread.
const REQUESTS: usize = 64;

/// Which way bytes went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the host to the device.
    ToDevice,
    /// From the device to the host.
    FromDevice,
}

/// Sees every byte on the wire, as it is sent or has been received, with its time. Called on the device thread: it must not block.
pub type Tap = Arc<dyn Fn(Direction, Instant, &[u8]) + Send + Sync>;

/// Sees what happens to the session. Called on the device thread: it must not block.
pub type EventSink = Arc<dyn Fn(&StageEvent) + Send + Sync>;

/// What happens to the session besides replies.
#[derive(Clone, Debug, PartialEq)]
pub enum StageEvent {
    /// A session has begun.
    Connected(StageIdentity),
    /// The device has latched a fault.
    Fault {
        /// Which.
        fault: Fault,
        /// By the device's clock since its start.
        uptime: Duration,
    },
    /// The device has restarted; positions are void.
    Restarted {
        /// New boot counter.
        boot: u32,
    },
    /// Nothing has come from the device for this long; everything under way has failed.
    Silent {
        /// How long.
        waited: Duration,
    },
    /// The device has answered an emergency stop.
    EmergencyStopped {
        /// Number of the stop.
        id: u32,
    },
    /// The port hung up; it is looked for, and what was asked for waits.
    HungUp(DeviceError),
    /// The port is back, the device is the same and stands where it stood.
    Returned {
        /// Since the hang-up was noticed.
        away: Duration,
        /// Where it stands, micro-degrees.
        position: Position,
    },
    /// The port is back, and the positions are void.
    Shifted {
        /// What was found.
        why: String,
    },
    /// The port is gone; the client is of no more use.
    Gone(DeviceError),
}

/// Opens the port again after it hung up. Called on the device thread, some fifty times a second.
pub type Reopen = Arc<dyn Fn() -> Result<Box<dyn Transport>, DeviceError> + Send + Sync>;

/// How to connect.
#[derive(Clone)]
pub struct Options {
    /// How long to wait for the device's greeting.
    pub connect_timeout: Duration,
    /// After this long without a sound byte commands under way fail with [`DeviceError::Timeout`].
    pub silence_timeout: Duration,
    /// Sees every byte.
    pub tap: Option<Tap>,
    /// Sees every event.
    pub events: Option<EventSink>,
    /// How a port that hung up is opened again; without it a hang-up is the end.
    pub reopen: Option<Reopen>,
    /// How long a port that hung up is looked for.
    pub patience: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            connect_timeout: Duration::from_secs(3),
            silence_timeout: Duration::from_secs(2),
            tap: None,
            events: None,
            reopen: None,
            patience: Duration::from_secs(30),
        }
    }
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options")
            .field("connect_timeout", &self.connect_timeout)
            .field("silence_timeout", &self.silence_timeout)
            .finish_non_exhaustive()
    }
}

/// What the device thread last knew.
#[derive(Clone, Debug, Default)]
struct Snapshot {
    identity: StageIdentity,
    statistics: LinkStatistics,
    heard: Option<Instant>,
    telemetry: Option<Telemetry>,
}

impl Snapshot {
    fn statistics(&self) -> LinkStatistics {
        let silent_for = self.heard.map_or(Duration::ZERO, |at| at.elapsed());
        LinkStatistics { silent_for, ..self.statistics }
    }
}

/// Tells how a link is doing; see [`Client::watch`].
#[derive(Clone, Debug)]
pub struct LinkWatch(Arc<Mutex<Snapshot>>);

impl LinkWatch {
    /// Counters now.
    #[must_use]
    pub fn statistics(&self) -> LinkStatistics {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).statistics()
    }
}

/// A connection to a motion controller. Shared by reference; all methods take `&self`.
#[derive(Debug)]
pub struct Client {
    name: String,
    requests: SyncSender<Request>,
    waker: Waker,
    snapshot: Arc<Mutex<Snapshot>>,
    thread: Option<JoinHandle<()>>,
}

impl Client {
    /// Greets the device behind `transport` and waits until a session has begun.
    ///
    /// # Errors
    /// [`DeviceError::Timeout`] without an answer, [`DeviceError::Version`] with a wrong one, and what the transport says.
    pub fn connect(transport: Box<dyn Transport>, options: Options) -> Result<Client, DeviceError> {
        let name = transport.name().to_owned();
        let current = Arc::new(Mutex::new(transport.waker()));
        let under_way = Arc::clone(&current);
        let waker = Waker::new(move || under_way.lock().unwrap_or_else(PoisonError::into_inner).wake());
        let snapshot = Arc::new(Mutex::new(Snapshot::default()));
        let (requests, inbox) = sync_channel(REQUESTS);
        let (ready, connected) = sync_channel(1);
        let worker = Worker::new(transport, options, inbox, Arc::clone(&snapshot), ready, current);
        let thread = std::thread::Builder::new()
            .name("gonio-stage".into())
            .spawn(move || worker.run())
            .map_err(|e| DeviceError::Io { device: name.clone(), reason: e.to_string() })?;
        let client = Client { name, requests, waker, snapshot, thread: Some(thread) };
        // The thread answers within the time-out, or ends and drops its sender.
        connected.recv().unwrap_or_else(|_| Err(client.gone()))?;
        Ok(client)
    }

    /// Starts a command; its end is waited for with [`Pending::wait`].
    ///
    /// # Errors
    /// [`DeviceError::Gone`] if the port is gone.
    pub fn start(&self, command: Command) -> Result<Pending, DeviceError> {
        let (sender, receiver) = sync_channel(1);
        // The receiver may have lost interest.
        self.request(command, Box::new(move |result| drop(sender.try_send(result))))?;
        Ok(Pending { receiver, name: self.name.clone() })
    }

    /// Executes a command and waits for its end without blocking the runtime. Dropping the future leaves the command running.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub async fn execute(&self, command: Command) -> Result<Outcome, DeviceError> {
        let (sender, receiver) = tokio::sync::oneshot::channel();
        self.request(command, Box::new(move |result| drop(sender.send(result))))?;
        receiver.await.unwrap_or_else(|_| Err(self.gone()))
    }

    /// Sends an emergency stop past everything else; it is repeated until the device has answered.
    ///
    /// # Errors
    /// [`DeviceError::Gone`] if the port is gone.
    pub fn emergency_stop(&self) -> Result<(), DeviceError> {
        let result = self.post(Request::EmergencyStop);
        self.waker.wake();
        result
    }

    /// Who answers.
    pub fn identity(&self) -> StageIdentity {
        self.snapshot().identity.clone()
    }

    /// State that came with the latest heartbeat; at most a few tens of milliseconds old while the link is well.
    pub fn telemetry(&self) -> Option<Telemetry> {
        self.snapshot().telemetry
    }

    /// How the link has been doing.
    pub fn statistics(&self) -> LinkStatistics {
        self.snapshot().statistics()
    }

    /// The same for those who watch while somebody else uses the client.
    #[must_use]
    pub fn watch(&self) -> LinkWatch {
        LinkWatch(Arc::clone(&self.snapshot))
    }

    /// The port as the user named it.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn snapshot(&self) -> MutexGuard<'_, Snapshot> {
        self.snapshot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn gone(&self) -> DeviceError {
        DeviceError::Gone { device: self.name.clone() }
    }

    fn request(&self, command: Command, done: worker::Done) -> Result<(), DeviceError> {
        self.post(Request::Command { command, done })?;
        self.waker.wake();
        Ok(())
    }

    /// Never blocks: an async caller may be behind it.
    fn post(&self, request: Request) -> Result<(), DeviceError> {
        self.requests.try_send(request).map_err(|error| match error {
            TrySendError::Disconnected(_) => self.gone(),
            TrySendError::Full(_) => DeviceError::Refused {
                command: "another command".into(),
                reason: format!("{REQUESTS} wait already; wait for some of them to end"),
            },
        })
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let (closed, _) = sync_channel(0);
        // Closing the channel tells the thread to make the device safe and to end.
        self.requests = closed;
        self.waker.wake();
        if let Some(thread) = self.thread.take() {
            // A panic has been printed where it happened.
            let _ = thread.join();
        }
    }
}

/// A command under way.
#[derive(Debug)]
pub struct Pending {
    receiver: Receiver<Result<Outcome, DeviceError>>,
    name: String,
}

impl Pending {
    /// Waits at most `timeout` for the end; `None` if it has not come.
    pub fn wait(&self, timeout: Duration) -> Option<Result<Outcome, DeviceError>> {
        match self.receiver.recv_timeout(timeout) {
            Ok(result) => Some(result),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Err(DeviceError::Gone { device: self.name.clone() })),
        }
    }
}
