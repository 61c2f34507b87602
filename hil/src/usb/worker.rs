//! The thread of a port: takes the guest's packets, asks the device function, answers.

use std::collections::{HashSet, VecDeque};
use std::io::{self, Write};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;

use super::port::{Fault, Input};
use super::standard::{self, Standard};
use super::{Function, Stalled};
use crate::redir::{Codec, FromGuest, PacketError, Setup, Status, ToGuest};

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

/// The thread's own.
pub(super) struct Worker {
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
    pub fn new(stream: UnixStream, function: Box<dyn Function>, healed: Arc<AtomicBool>) -> Worker {
        Worker {
            stream,
            codec: Codec::default(),
            function,
            plugged: false,
            greeted: false,
            configuration: 0,
            waiting: VecDeque::new(),
            halted: HashSet::new(),
            halt_seen: false,
            healed,
            silent: false,
        }
    }

    pub fn run(mut self, inbox: &Receiver<Input>) {
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
