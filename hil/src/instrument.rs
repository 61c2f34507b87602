//! The instrument that stands behind all virtual devices: one firmware with two ports, and a world that the camera looks into.
//!
//! The firmware answers on the port that spoke last, as a controller with a serial and a USB socket does. Pulling a plug leaves it running.

use std::sync::mpsc::{RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use gonio_instrument::Description;
use gonio_sim::firmware::serve::{Line, Served, serve_memory};
use gonio_sim::firmware::{Faults, Firmware, Settings};
use gonio_sim::world::World;

/// Takes what the firmware says; must not block.
pub type Listener = Box<dyn FnMut(Vec<u8>) + Send>;

/// The ports of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Socket {
    /// The serial one.
    Serial = 0,
    /// The USB one.
    Usb = 1,
}

#[derive(Default)]
struct Sockets {
    spoke_last: usize,
    listeners: [Option<Listener>; 2],
}

/// A running instrument.
pub struct Instrument {
    world: World,
    to_firmware: SyncSender<Vec<u8>>,
    sockets: Arc<Mutex<Sockets>>,
    _firmware: Served,
}

/// The host's end of one port of the controller.
#[derive(Clone)]
pub struct Wire {
    socket: Socket,
    to_firmware: SyncSender<Vec<u8>>,
    sockets: Arc<Mutex<Sockets>>,
}

impl std::fmt::Debug for Wire {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wire").field("socket", &self.socket).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Instrument {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Instrument")
    }
}

impl Wire {
    /// Bytes to the firmware.
    pub fn send(&self, bytes: &[u8]) {
        lock(&self.sockets).spoke_last = self.socket as usize;
        // a firmware that is too slow loses bytes, as on a real line
        let _ = self.to_firmware.try_send(bytes.to_vec());
    }

    /// Who takes the firmware's bytes from now on; `None`: they are lost.
    pub fn listen(&self, listener: Option<Listener>) {
        lock(&self.sockets).listeners[self.socket as usize] = listener;
    }
}

impl Instrument {
    /// Switches an instrument on, in which time runs `time_scale` times too fast.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn start(description: &Description, seed: u64, time_scale: f64) -> std::io::Result<Instrument> {
        let world = World::new(time_scale);
        let settings = Settings::new(description, seed, time_scale);
        let firmware = Firmware::new(settings, world.clone(), Faults::default());
        let (Line { to_device, from_device }, served) = serve_memory(firmware)?;
        let sockets = Arc::new(Mutex::new(Sockets::default()));
        let shared = Arc::downgrade(&sockets);
        std::thread::Builder::new().name("hil-router".to_owned()).spawn(move || {
            loop {
                let bytes = match from_device.recv_timeout(Duration::from_millis(200)) {
                    Ok(bytes) => bytes,
                    Err(RecvTimeoutError::Timeout) => vec![],
                    Err(RecvTimeoutError::Disconnected) => return,
                };
                let Some(sockets) = shared.upgrade() else { return };
                let mut sockets = lock(&sockets);
                let place = sockets.spoke_last;
                if let Some(Some(listener)) = sockets.listeners.get_mut(place)
                    && !bytes.is_empty()
                {
                    listener(bytes);
                }
            }
        })?;
        Ok(Instrument { world, to_firmware: to_device, sockets, _firmware: served })
    }

    /// What is physically the case.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// One of the ports.
    #[must_use]
    pub fn wire(&self, socket: Socket) -> Wire {
        Wire { socket, to_firmware: self.to_firmware.clone(), sockets: Arc::clone(&self.sockets) }
    }
}

fn lock(sockets: &Mutex<Sockets>) -> std::sync::MutexGuard<'_, Sockets> {
    sockets.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;
    use gonio_protocol::hello::Version;
    use gonio_protocol::host::Host;
    use std::sync::mpsc::channel;

    #[test]
    fn the_firmware_answers_where_it_was_asked() {
        let tiny = builtin::description("tiny").expect("known").expect("readable");
        let instrument = Instrument::start(&tiny, 1, 1.0).expect("runs");
        let mut host = Host::new(7, 1, Version::default());
        let greeting = host.poll_transmit(Duration::ZERO).expect("a greeting").as_slice().to_vec();
        for socket in [Socket::Usb, Socket::Serial] {
            let (sender, heard) = channel();
            let wire = instrument.wire(socket);
            wire.listen(Some(Box::new(move |bytes| drop(sender.send(bytes)))));
            wire.send(&greeting);
            let answer = heard.recv_timeout(Duration::from_secs(5)).expect("an answer to the greeting");
            assert!(!answer.is_empty());
            wire.listen(None);
        }
    }
}
