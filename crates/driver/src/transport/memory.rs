//! A line in memory: two bounded channels of byte blocks.

use super::{Transport, Waker};
use gonio_instrument::DeviceError;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

/// Blocks that fit into a channel of [`memory_pair`].
const DEPTH: usize = 256;
/// A channel cannot be woken, so a wake is noticed after this long at the latest.
const SLICE: Duration = Duration::from_millis(1);

/// One end of a line in memory. An ended peer counts as hung up.
#[derive(Debug)]
pub struct MemoryTransport {
    name: String,
    output: SyncSender<Vec<u8>>,
    input: Receiver<Vec<u8>>,
    woken: Arc<AtomicBool>,
}

impl MemoryTransport {
    /// An end made of two channels; the other ends belong to whoever plays the device.
    pub fn new(name: &str, output: SyncSender<Vec<u8>>, input: Receiver<Vec<u8>>) -> MemoryTransport {
        MemoryTransport { name: name.to_owned(), output, input, woken: Arc::default() }
    }

    fn gone(&self) -> DeviceError {
        DeviceError::Gone { device: self.name.clone() }
    }
}

/// Both ends of a new line.
pub fn memory_pair(name: &str) -> (MemoryTransport, MemoryTransport) {
    let (to_b, from_a) = sync_channel(DEPTH);
    let (to_a, from_b) = sync_channel(DEPTH);
    (MemoryTransport::new(name, to_b, from_b), MemoryTransport::new(name, to_a, from_a))
}

impl Transport for MemoryTransport {
    fn name(&self) -> &str {
        &self.name
    }

    fn waker(&self) -> Waker {
        let woken = Arc::clone(&self.woken);
        Waker::new(move || woken.store(true, Ordering::Release))
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        let end = Instant::now() + timeout;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.input.recv_timeout(left.min(SLICE)) {
                Ok(bytes) => return Ok(bytes),
                Err(RecvTimeoutError::Disconnected) => return Err(self.gone()),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if self.woken.swap(false, Ordering::Acquire) || Instant::now() >= end {
                return Ok(Vec::new());
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        match self.output.try_send(bytes.to_vec()) {
            Ok(()) | Err(TrySendError::Full(_)) => Ok(()),
            Err(TrySendError::Disconnected(_)) => Err(self.gone()),
        }
    }
}
