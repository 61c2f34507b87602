//! The motion controller behind QEMU's `usb-serial` adapter, which the guest's FTDI driver takes for real.
//!
//! QEMU plugs the adapter into the bus when somebody opens its socket and pulls it when the socket closes, so opening and closing is all
//! there is to do here.

use std::io::{Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

use crate::instrument::Wire;
use crate::usb::{PortError, port};

/// A guest that takes no bytes for this long has lost them.
const PATIENCE: Duration = Duration::from_millis(200);

/// The cable between adapter and controller, and the adapter's plug.
#[derive(Debug)]
pub struct SerialPlug {
    path: PathBuf,
    wire: Wire,
    open: Option<UnixStream>,
}

impl SerialPlug {
    /// Unplugged at first. QEMU listens at `path`.
    #[must_use]
    pub fn new(path: PathBuf, wire: Wire) -> SerialPlug {
        SerialPlug { path, wire, open: None }
    }

    /// Plugs the adapter in, or pulls it.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn plug(&mut self, plugged: bool) -> Result<(), PortError> {
        if !plugged {
            self.wire.listen(None);
            if let Some(stream) = self.open.take() {
                let _ = stream.shutdown(Shutdown::Both);
            }
            return Ok(());
        }
        if self.open.is_some() {
            return Ok(());
        }
        let stream = port::connect(&self.path)?;
        let clone = || stream.try_clone().map_err(PortError::Thread);
        let (mut reading, mut writing) = (clone()?, clone()?);
        writing.set_write_timeout(Some(PATIENCE)).map_err(PortError::Thread)?;
        let wire = self.wire.clone();
        std::thread::Builder::new()
            .name("hil-serial".to_owned())
            .spawn(move || {
                let mut buffer = [0; 4096];
                while let Ok(n @ 1..) = reading.read(&mut buffer) {
                    wire.send(&buffer[..n]);
                }
            })
            .map_err(PortError::Thread)?;
        // lost where it cannot be written, as on a real line
        self.wire.listen(Some(Box::new(move |bytes| drop(writing.write_all(&bytes)))));
        self.open = Some(stream);
        Ok(())
    }
}

impl Drop for SerialPlug {
    fn drop(&mut self) {
        let _ = self.plug(false);
    }
}
