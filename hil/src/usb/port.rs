//! A port of the bus: one device function, on a thread of its own, behind a socket to QEMU.
//!
//! Reads that the device has no bytes for wait here, as a device on a wire says NAK. Whoever produces bytes rings [`Ready`]. The port can be
//! unplugged, plugged in again, halted and silenced at any time from any thread.

use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::Function;
use super::worker::Worker;

/// How long QEMU may take to open its end.
const PATIENCE: Duration = Duration::from_secs(10);

/// What goes wrong on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The endpoint answers with a halt until the host clears it.
    Halt(u8),
    /// The device answers no transfer of data any more (control requests it does), or does again.
    Silent(bool),
}

/// Why a port cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// QEMU does not listen.
    #[error("QEMU does not listen at {path} ({source}); is it running?")]
    Connect {
        /// The socket.
        path: PathBuf,
        /// The system's words.
        source: io::Error,
    },
    /// No thread.
    #[error("the thread of a USB port cannot be started: {0}")]
    Thread(io::Error),
}

pub(super) enum Input {
    Bytes(Vec<u8>),
    Closed,
    Ready,
    Plugged(bool, Sender<()>),
    Fault(Fault),
    End,
}

/// Tells a port that its device has bytes for a read that may be waiting.
#[derive(Clone, Debug)]
pub struct Ready(Sender<Input>);

impl Ready {
    /// Tells it.
    pub fn ring(&self) {
        // a port that has ended has no use for it
        let _ = self.0.send(Input::Ready);
    }
}

/// The place for a port whose thread is not running yet: what its device is made with.
#[derive(Debug)]
pub struct Slot {
    inputs: Sender<Input>,
    inbox: Receiver<Input>,
}

impl Default for Slot {
    fn default() -> Self {
        let (inputs, inbox) = channel();
        Slot { inputs, inbox }
    }
}

impl Slot {
    /// What the producers of the device's bytes ring.
    #[must_use]
    pub fn ready(&self) -> Ready {
        Ready(self.inputs.clone())
    }

    /// Runs `function` behind the socket that QEMU listens at; unplugged at first.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn run(self, path: &Path, name: &str, function: Box<dyn Function>) -> Result<Port, PortError> {
        let stream = connect(path)?;
        let mut reading = stream.try_clone().map_err(PortError::Thread)?;
        let (inputs, inbox) = (self.inputs, self.inbox);
        let to_worker = inputs.clone();
        std::thread::Builder::new()
            .name(format!("hil-{name}-in"))
            .spawn(move || {
                let mut buffer = vec![0; 1 << 16];
                while let Ok(n @ 1..) = reading.read(&mut buffer) {
                    if to_worker.send(Input::Bytes(buffer[..n].to_vec())).is_err() {
                        return;
                    }
                }
                let _ = to_worker.send(Input::Closed);
            })
            .map_err(PortError::Thread)?;
        let healed = Arc::new(AtomicBool::new(false));
        let worker = Worker::new(stream, function, Arc::clone(&healed));
        let thread = std::thread::Builder::new()
            .name(format!("hil-{name}"))
            .spawn(move || worker.run(&inbox))
            .map_err(PortError::Thread)?;
        Ok(Port { inputs, healed, thread: Some(thread) })
    }
}

/// Opens a socket that QEMU is about to listen at.
///
/// # Errors
/// [`PortError::Connect`] if it does not in time.
pub fn connect(path: &Path) -> Result<UnixStream, PortError> {
    let start = Instant::now();
    loop {
        match UnixStream::connect(path) {
            Ok(stream) => return Ok(stream),
            Err(source) if start.elapsed() > PATIENCE => {
                return Err(PortError::Connect { path: path.to_path_buf(), source });
            }
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
}

/// A running port. Dropping it unplugs the device.
#[derive(Debug)]
pub struct Port {
    inputs: Sender<Input>,
    healed: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Port {
    /// Plugs the device in, or pulls it; done on return.
    pub fn plug(&self, plugged: bool) {
        let (done, wait) = channel();
        if self.inputs.send(Input::Plugged(plugged, done)).is_ok() {
            let _ = wait.recv();
        }
    }

    /// Lets something go wrong.
    pub fn fault(&self, fault: Fault) {
        if matches!(fault, Fault::Halt(_)) {
            self.healed.store(false, Ordering::SeqCst);
        }
        let _ = self.inputs.send(Input::Fault(fault));
    }

    /// The host has met the last halt and has cleared it.
    #[must_use]
    pub fn healed(&self) -> bool {
        self.healed.load(Ordering::SeqCst)
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        let _ = self.inputs.send(Input::End);
        if let Some(thread) = self.thread.take() {
            // a panic has been printed where it happened
            let _ = thread.join();
        }
    }
}
