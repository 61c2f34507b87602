//! A port of the bus: one device function, on a thread of its own, behind a socket to QEMU.
//!
//! Reads that the device has no bytes for wait here, as a device on a wire says NAK. Whoever produces bytes rings [`Ready`]. The port can be
//! unplugged, plugged in again, halted and silenced at any time from any thread.

use std::collections::{HashSet, VecDeque};
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::standard::{self, Standard};
use super::{Function, Stalled};
use crate::redir::{Codec, FromGuest, PacketError, Setup, Status, ToGuest};

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

enum Input {
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
        let worker = Worker {
            stream,
            codec: Codec::default(),
            function,
            plugged: false,
            greeted: false,
            configuration: 0,
            waiting: VecDeque::new(),
            halted: HashSet::new(),
            halt_seen: false,
            healed: Arc::clone(&healed),
            silent: false,
        };
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

/// Why the thread of a port ends.
enum End {
    Io,
    OutOfStep(PacketError),
}

impl From<io::Error> for End {
    fn from(_: io::Error) -> Self {
        End::Io
    }
}

/// A read of the guest that the device has no bytes for yet, or a write that it does not take.
struct Waiting {
    id: u64,
    endpoint: u8,
    length: usize,
    data: Vec<u8>,
}

struct Worker {
    stream: UnixStream,
    codec: Codec,
    function: Box<dyn Function>,
    plugged: bool,
    greeted: bool,
    configuration: u8,
    waiting: VecDeque<Waiting>,
    halted: HashSet<u8>,
    /// A transfer was answered with a halt.
    halt_seen: bool,
    healed: Arc<AtomicBool>,
    silent: bool,
}

impl Worker {
    fn run(mut self, inbox: &Receiver<Input>) {
        // QEMU going away ends the guest as well; that is told by whoever waits for it
        if let Err(End::OutOfStep(error)) = self.serve(inbox) {
            crate::log(&error.to_string());
        }
        self.function.reset();
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }

    fn serve(&mut self, inbox: &Receiver<Input>) -> Result<(), End> {
        self.send(&ToGuest::Hello)?;
        while let Ok(input) = inbox.recv() {
            match input {
                Input::Bytes(bytes) => {
                    self.codec.push(&bytes);
                    while let Some(packet) = self.codec.next_packet().map_err(End::OutOfStep)? {
                        self.packet(packet)?;
                    }
                }
                Input::Closed | Input::End => return Ok(()),
                Input::Ready => {}
                Input::Plugged(plugged, done) => {
                    self.plug(plugged)?;
                    let _ = done.send(());
                }
                Input::Fault(Fault::Halt(endpoint)) => {
                    self.halt_seen = false;
                    self.halted.insert(endpoint);
                }
                Input::Fault(Fault::Silent(silent)) => self.silent = silent,
            }
            self.answer_waiting()?;
        }
        Ok(())
    }

    fn plug(&mut self, plugged: bool) -> Result<(), End> {
        if plugged == self.plugged {
            return Ok(());
        }
        self.plugged = plugged;
        if plugged {
            if self.greeted {
                self.announce()?;
            }
        } else {
            self.forget();
            self.send(&ToGuest::Disconnect)?;
        }
        Ok(())
    }

    /// Everything as before it was plugged in.
    fn forget(&mut self) {
        self.waiting.clear();
        self.halted.clear();
        self.silent = false;
        self.configuration = 0;
        self.function.reset();
    }

    fn announce(&mut self) -> Result<(), End> {
        self.tables()?;
        let d = self.function.descriptors();
        let connect = ToGuest::Connect {
            class: d.class,
            vendor: super::descriptor::VENDOR,
            product: d.product,
            release: d.release,
        };
        let bytes = self.codec.encode(&connect);
        Ok(self.stream.write_all(&bytes)?)
    }

    fn tables(&mut self) -> Result<(), End> {
        let d = self.function.descriptors();
        let mut bytes = self.codec.encode(&ToGuest::Interfaces(&d.interfaces));
        bytes.extend(self.codec.encode(&ToGuest::Endpoints(&d.endpoints)));
        Ok(self.stream.write_all(&bytes)?)
    }

    fn send(&mut self, packet: &ToGuest<'_>) -> Result<(), End> {
        let bytes = self.codec.encode(packet);
        Ok(self.stream.write_all(&bytes)?)
    }

    fn packet(&mut self, packet: FromGuest) -> Result<(), End> {
        match packet {
            FromGuest::Hello { .. } => {
                self.greeted = true;
                if self.plugged {
                    self.announce()?;
                }
            }
            FromGuest::Reset => {
                self.waiting.clear();
                self.halted.clear();
                self.configuration = 0;
                self.function.reset();
            }
            FromGuest::SetConfiguration { id, configuration } => {
                self.configuration = configuration;
                self.tables()?;
                self.send(&ToGuest::Configuration { id, configuration })?;
            }
            FromGuest::GetConfiguration { id } => {
                let configuration = self.configuration;
                self.send(&ToGuest::Configuration { id, configuration })?;
            }
            FromGuest::SetAltSetting { id, interface, alternate } => {
                let status = if alternate == 0 { Status::Success } else { Status::Stall };
                self.tables()?;
                self.send(&ToGuest::AltSetting { id, status, interface, alternate: 0 })?;
            }
            FromGuest::GetAltSetting { id, interface } => {
                let status = Status::Success;
                self.send(&ToGuest::AltSetting { id, status, interface, alternate: 0 })?;
            }
            FromGuest::Cancel { id } => self.cancel(id)?,
            FromGuest::Control { id, setup, data } => self.control(id, setup, &data)?,
            FromGuest::Bulk { id, endpoint, length, data } => self.bulk(id, endpoint, length, &data)?,
            FromGuest::DisconnectAck | FromGuest::Other { .. } => {}
        }
        Ok(())
    }

    fn cancel(&mut self, id: u64) -> Result<(), End> {
        let Some(place) = self.waiting.iter().position(|w| w.id == id) else { return Ok(()) };
        let Some(Waiting { endpoint, .. }) = self.waiting.remove(place) else { return Ok(()) };
        self.send(&ToGuest::Bulk { id, status: Status::Cancelled, endpoint, length: 0, data: &[] })
    }

    fn control(&mut self, id: u64, setup: Setup, data: &[u8]) -> Result<(), End> {
        let answer = match standard::handle(self.function.descriptors(), setup) {
            Some(Ok(Standard::Answer(bytes))) => Ok(bytes),
            Some(Ok(Standard::ClearHalt(endpoint))) => {
                if self.halted.remove(&endpoint) && self.halt_seen {
                    self.healed.store(true, Ordering::SeqCst);
                }
                self.function.halt_cleared(endpoint);
                Ok(vec![])
            }
            Some(Ok(Standard::IsHalted(endpoint))) => Ok(vec![u8::from(self.halted.contains(&endpoint)), 0]),
            Some(Err(Stalled)) => Err(Stalled),
            None => self.function.control(setup, data),
        };
        let (status, mut data) = match answer {
            Ok(data) => (Status::Success, data),
            Err(Stalled) => (Status::Stall, vec![]),
        };
        data.truncate(usize::from(setup.length));
        self.send(&ToGuest::Control { id, status, setup, data: &data })
    }

    fn bulk(&mut self, id: u64, endpoint: u8, length: usize, data: &[u8]) -> Result<(), End> {
        if self.function.descriptors().endpoints.iter().all(|e| e.address != endpoint) {
            return self.send(&ToGuest::Bulk { id, status: Status::Invalid, endpoint, length: 0, data: &[] });
        }
        if endpoint & 0x80 != 0 {
            self.waiting.push_back(Waiting { id, endpoint, length, data: vec![] });
            return Ok(());
        }
        if self.halted.contains(&endpoint) {
            return self.send(&ToGuest::Bulk { id, status: Status::Stall, endpoint, length: 0, data: &[] });
        }
        if self.silent {
            self.waiting.push_back(Waiting { id, endpoint, length, data: data.to_vec() });
            return Ok(());
        }
        self.function.bulk_out(endpoint, data);
        self.send(&ToGuest::Bulk { id, status: Status::Success, endpoint, length: data.len(), data: &[] })
    }

    /// Answers waiting reads in their order, as far as there are bytes.
    fn answer_waiting(&mut self) -> Result<(), End> {
        let mut empty = HashSet::new();
        let mut place = 0;
        while let Some(&Waiting { id, endpoint, length, .. }) = self.waiting.get(place) {
            let reads = endpoint & 0x80 != 0;
            if reads && self.halted.contains(&endpoint) {
                self.halt_seen = true;
                self.waiting.remove(place);
                self.send(&ToGuest::Bulk { id, status: Status::Stall, endpoint, length: 0, data: &[] })?;
                continue;
            }
            if self.silent || empty.contains(&endpoint) {
                place += 1;
                continue;
            }
            if !reads {
                if let Some(Waiting { data, .. }) = self.waiting.remove(place) {
                    self.bulk(id, endpoint, length, &data)?;
                }
                continue;
            }
            match self.function.bulk_in(endpoint, length) {
                Some(data) => {
                    self.waiting.remove(place);
                    let length = data.len();
                    self.send(&ToGuest::Bulk { id, status: Status::Success, endpoint, length, data: &data })?;
                }
                None => {
                    empty.insert(endpoint);
                    place += 1;
                }
            }
        }
        Ok(())
    }
}
