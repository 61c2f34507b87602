//! A USB device with a bulk endpoint in each direction; the bytes on them are those of the serial wire.
//!
//! libusb's calls block, so reading and writing have a thread each (`gonio-usb-in`, `gonio-usb-out`) and meet the stage's thread in bounded
//! channels. One packet is read at a time: a read for more would wait for a short packet that need not come. Writes carry no
//! zero-length packet at their end, since the wire is a stream.

mod address;
mod devices;
mod endpoints;
mod lines;

pub use address::{AddressError, PRODUCT, UsbAddress, VENDOR};
pub use devices::{UsbDevice, list_usb};
pub use endpoints::{EndpointFacts, InterfaceFacts, NoPipes, Pipes, STAGE_CLASS, choose};

use super::{Transport, Waker};
use gonio_instrument::DeviceError;
use lines::{Arrival, Line};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// Packets that wait for the stage's thread.
const ARRIVALS: usize = 256;
/// Blocks that wait for the device; what comes after is lost, and sent again by the link.
const DEPARTURES: usize = 64;
/// Bytes given at once at most.
const BATCH: usize = 16 * 1024;

/// An open USB stage; its interface is claimed exclusively.
#[derive(Debug)]
pub struct UsbTransport {
    name: String,
    serial: String,
    arrivals: Receiver<Arrival>,
    departures: Option<SyncSender<Vec<u8>>>,
    waker: Waker,
    closing: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    ended: Option<DeviceError>,
}

/// Opens the device, see [`UsbTransport::open`].
///
/// # Errors
/// As there.
pub fn open(address: &UsbAddress) -> Result<UsbTransport, DeviceError> {
    UsbTransport::open(address)
}

impl UsbTransport {
    /// Finds the device, opens it, claims its interface and starts to listen.
    ///
    /// # Errors
    /// [`DeviceError::Absent`], [`DeviceError::Denied`] for one that is there and may not be opened, [`DeviceError::InUse`] if another program has its
    /// interface, [`DeviceError::Io`] for what is no stage or leaves open which one is meant.
    pub fn open(address: &UsbAddress) -> Result<UsbTransport, DeviceError> {
        let name = address.to_string();
        let (device, facts) = devices::find(address)?;
        let error = |e: rusb::Error| open_error(&name, e);
        let described = devices::interfaces(&device).map_err(error)?;
        let pipes = choose(&described)
            .map_err(|e| DeviceError::Io { device: name.clone(), reason: e.to_string() })?;
        let handle = device.open().map_err(error)?;
        // Where a kernel driver took the interface it gives it back; not every system knows this, nor needs it.
        let _ = handle.set_auto_detach_kernel_driver(true);
        handle.claim_interface(pipes.interface).map_err(error)?;
        if described.iter().any(|i| i.number == pipes.interface && i.setting != pipes.setting) {
            handle.set_alternate_setting(pipes.interface, pipes.setting).map_err(error)?;
        }
        let (arrived, arrivals) = sync_channel(ARRIVALS);
        let (departures, departing) = sync_channel::<Vec<u8>>(DEPARTURES);
        let closing = Arc::new(AtomicBool::new(false));
        let line = Line {
            name: name.clone(),
            handle: Arc::new(handle),
            pipes,
            arrived: arrived.clone(),
            closing: Arc::clone(&closing),
        };
        let (reader, writer) = (line.clone(), line);
        let io = |e: std::io::Error| DeviceError::Io { device: name.clone(), reason: e.to_string() };
        // A full channel means that there is something to return for already.
        let waker = Waker::new(move || drop(arrived.try_send(Arrival::Wake)));
        let mut transport = UsbTransport {
            name: name.clone(),
            serial: facts.serial,
            arrivals,
            departures: Some(departures),
            waker,
            closing,
            threads: Vec::new(),
            ended: None,
        };
        let spawn = |name: &str, job: Box<dyn FnOnce() + Send>| Builder::new().name(name.into()).spawn(job);
        transport.threads.push(spawn("gonio-usb-in", Box::new(move || reader.read())).map_err(io)?);
        transport
            .threads
            .push(spawn("gonio-usb-out", Box::new(move || writer.write(&departing))).map_err(io)?);
        Ok(transport)
    }

    /// Serial number of the device; empty if it has none.
    #[must_use]
    pub fn serial(&self) -> &str {
        &self.serial
    }

    fn end(&mut self, error: DeviceError) -> DeviceError {
        self.ended.get_or_insert(error).clone()
    }
}

impl Transport for UsbTransport {
    fn name(&self) -> &str {
        &self.name
    }

    fn waker(&self) -> Waker {
        self.waker.clone()
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        if let Some(error) = &self.ended {
            return Err(error.clone());
        }
        let mut bytes = match self.arrivals.recv_timeout(timeout) {
            Ok(Arrival::Packet(bytes)) => bytes,
            Ok(Arrival::Ended(error)) => return Err(self.end(error)),
            Ok(Arrival::Wake) => Vec::new(),
            Err(RecvTimeoutError::Timeout) => return Ok(Vec::new()),
            Err(RecvTimeoutError::Disconnected) => {
                let device = self.name.clone();
                return Err(self.end(DeviceError::Gone { device }));
            }
        };
        while bytes.len() < BATCH {
            match self.arrivals.try_recv() {
                Ok(Arrival::Packet(more)) => bytes.extend(more),
                Ok(Arrival::Wake) => {}
                // told at the next call, after these bytes
                Ok(Arrival::Ended(error)) => drop(self.end(error)),
                Err(_) => break,
            }
        }
        match &self.ended {
            Some(error) if bytes.is_empty() => Err(error.clone()),
            _ => Ok(bytes),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        if let Some(error) = &self.ended {
            return Err(error.clone());
        }
        let Some(departures) = &self.departures else { return Ok(()) };
        match departures.try_send(bytes.to_vec()) {
            Ok(()) | Err(TrySendError::Full(_)) => Ok(()),
            // the writer has told why; what came before is read first
            Err(TrySendError::Disconnected(_)) => Ok(()),
        }
    }
}

impl Drop for UsbTransport {
    fn drop(&mut self) {
        self.closing.store(true, Ordering::Relaxed);
        self.departures = None;
        // a reader that waits for room is let go
        let (_, nothing) = sync_channel(1);
        self.arrivals = nothing;
        for thread in self.threads.drain(..) {
            // A panic has been printed where it happened. The interface is free once both have ended.
            let _ = thread.join();
        }
    }
}

fn open_error(name: &str, error: rusb::Error) -> DeviceError {
    let device = name.to_owned();
    match error {
        rusb::Error::Access => DeviceError::Denied { device },
        rusb::Error::Busy => DeviceError::InUse { device },
        rusb::Error::NoDevice | rusb::Error::NotFound => DeviceError::Absent { device },
        other => DeviceError::Io { device, reason: format!("cannot be opened ({other})") },
    }
}
