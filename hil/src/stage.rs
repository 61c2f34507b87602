//! The motion controller as a USB device: a vendor interface with two bulk endpoints that carry the bytes of the serial wire.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::instrument::Wire;
use crate::redir::Setup;
use crate::usb::{Descriptors, Function, Ready, Stalled};

/// Product number.
pub const PRODUCT: u16 = 0x0001;
/// Serial number.
pub const SERIAL: &str = "GONIO-HIL-1";
/// Class, subclass, protocol of the interface.
pub const CLASS: [u8; 3] = [0xff, 0x47, 0x01];
/// Bulk endpoint to the controller. Deliberately not the first: hosts find it by its descriptor.
pub const OUT: u8 = 0x02;
/// Bulk endpoint from the controller.
pub const IN: u8 = 0x83;
/// Bytes kept for a host that does not read; what comes after is lost, as on a real line.
const BACKLOG: usize = 16 * 1024;

/// The device.
#[derive(Debug)]
pub struct StageDevice {
    descriptors: Descriptors,
    wire: Wire,
    said: Arc<Mutex<VecDeque<u8>>>,
}

impl StageDevice {
    /// A device on one port of the controller.
    #[must_use]
    pub fn new(wire: Wire, ready: Ready) -> StageDevice {
        let descriptors = Descriptors::new([0; 3], PRODUCT, ["gonio", "gonio virtual stage", SERIAL])
            .interface(0, CLASS, &[], &[OUT, IN]);
        let said = Arc::new(Mutex::new(VecDeque::new()));
        let heard = Arc::clone(&said);
        wire.listen(Some(Box::new(move |bytes| {
            let mut queue = heard.lock().unwrap_or_else(PoisonError::into_inner);
            if queue.len() + bytes.len() <= BACKLOG {
                queue.extend(bytes);
            }
            drop(queue);
            ready.ring();
        })));
        StageDevice { descriptors, wire, said }
    }
}

impl Drop for StageDevice {
    fn drop(&mut self) {
        self.wire.listen(None);
    }
}

impl Function for StageDevice {
    fn descriptors(&self) -> &Descriptors {
        &self.descriptors
    }

    fn control(&mut self, _setup: Setup, _data: &[u8]) -> Result<Vec<u8>, Stalled> {
        Err(Stalled)
    }

    fn bulk_out(&mut self, _endpoint: u8, data: &[u8]) {
        self.wire.send(data);
    }

    fn bulk_in(&mut self, _endpoint: u8, length: usize) -> Option<Vec<u8>> {
        let mut queue = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if queue.is_empty() {
            return None;
        }
        let n = queue.len().min(length);
        Some(queue.drain(..n).collect())
    }

    fn halt_cleared(&mut self, _endpoint: u8) {}

    fn reset(&mut self) {
        self.said.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
