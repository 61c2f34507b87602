//! Something that carries bytes to a device and back, and may do so badly.

pub mod fault;
pub mod memory;
pub mod serial;
pub mod usb;

pub use fault::{FaultyTransport, LineFaults};
pub use memory::{MemoryTransport, memory_pair};
pub use serial::SerialTransport;
pub use usb::{UsbAddress, UsbTransport};

use gonio_instrument::DeviceError;
use std::sync::Arc;
use std::time::Duration;

/// A duplex byte stream without guarantees. Owned by one device thread.
pub trait Transport: Send {
    /// The port as the user named it, for messages.
    fn name(&self) -> &str;

    /// Interrupts a waiting [`Transport::receive`] from another thread.
    fn waker(&self) -> Waker;

    /// Waits at most `timeout` for bytes and gives those that are there; none after the time-out or a wake.
    ///
    /// # Errors
    /// [`DeviceError::Gone`] once the other end has hung up; [`DeviceError::Io`].
    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, DeviceError>;

    /// Sends bytes without waiting. A transport that cannot take them now keeps a bounded number and loses the rest:
    /// acknowledgements tell what arrived.
    ///
    /// # Errors
    /// As [`Transport::receive`].
    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError>;
}

impl Transport for Box<dyn Transport> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn waker(&self) -> Waker {
        (**self).waker()
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        (**self).receive(timeout)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        (**self).send(bytes)
    }
}

/// Wakes a thread that waits in [`Transport::receive`].
#[derive(Clone)]
pub struct Waker(Arc<dyn Fn() + Send + Sync>);

impl Waker {
    /// A waker that calls `wake`, which must not block.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Waker {
        Waker(Arc::new(wake))
    }

    /// Wakes it.
    pub fn wake(&self) {
        (self.0)();
    }
}

impl std::fmt::Debug for Waker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Waker")
    }
}
