//! The two threads of a USB stage: one reads, one writes, and both say how it ended.

use super::endpoints::Pipes;
use gonio_instrument::DeviceError;
use rusb::{Context, DeviceHandle, Error};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::Duration;

/// Longest transfer; after it a thread looks whether it shall end.
const SLICE: Duration = Duration::from_millis(50);
/// A stalled endpoint is cleared; one that stalls so often without a packet between is broken.
const STALLS: u32 = 8;
/// Transfers that fail electrically one after the other before the cable counts as pulled; the kernel says "no device" only when the hub has.
const FAILURES: u32 = 3;
/// Pause after a failed transfer.
const PAUSE: Duration = Duration::from_millis(5);

/// What reaches the stage's thread.
#[derive(Debug)]
pub(super) enum Arrival {
    /// Bytes of one packet.
    Packet(Vec<u8>),
    /// Somebody wants the thread to look at its requests.
    Wake,
    /// No more will come.
    Ended(DeviceError),
}

/// An open device, shared by its two threads.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub name: String,
    pub handle: Arc<DeviceHandle<Context>>,
    pub pipes: Pipes,
    pub arrived: SyncSender<Arrival>,
    pub closing: Arc<AtomicBool>,
}

impl Line {
    /// Gives every packet to the stage's thread until the device or that thread is gone.
    pub fn read(&self) {
        let mut packet = vec![0; usize::from(self.pipes.input.packet)];
        let mut trouble = Trouble::default();
        while !self.closing() {
            match self.handle.read_bulk(self.pipes.input.address, &mut packet, SLICE) {
                Ok(n) => {
                    trouble = Trouble::default();
                    let bytes = packet.get(..n).unwrap_or(&packet).to_vec();
                    if n > 0 && self.arrived.send(Arrival::Packet(bytes)).is_err() {
                        return;
                    }
                }
                Err(error) => {
                    if let Some(end) = self.mend(error, self.pipes.input.address, &mut trouble) {
                        let _ = self.arrived.send(Arrival::Ended(end));
                        return;
                    }
                }
            }
        }
    }

    /// Writes blocks until there are no more or the device is gone.
    pub fn write(&self, departing: &Receiver<Vec<u8>>) {
        let mut trouble = Trouble::default();
        while let Ok(block) = departing.recv() {
            let mut rest = block.as_slice();
            while !rest.is_empty() && !self.closing() {
                match self.handle.write_bulk(self.pipes.output.address, rest, SLICE) {
                    Ok(n) => {
                        trouble = Trouble::default();
                        rest = rest.get(n..).unwrap_or_default();
                    }
                    Err(error) => {
                        if let Some(end) = self.mend(error, self.pipes.output.address, &mut trouble) {
                            let _ = self.arrived.send(Arrival::Ended(end));
                            return;
                        }
                    }
                }
            }
        }
    }

    fn closing(&self) -> bool {
        self.closing.load(Ordering::Relaxed)
    }

    /// Goes on after what passes; gives the end for what does not.
    fn mend(&self, error: Error, endpoint: u8, trouble: &mut Trouble) -> Option<DeviceError> {
        match trouble.judge(error) {
            Step::GoOn => None,
            Step::Again => {
                std::thread::sleep(PAUSE);
                None
            }
            Step::Unstall => {
                tracing::warn!(device = %self.name, "endpoint {endpoint:#04x} has stalled and is cleared");
                match self.handle.clear_halt(endpoint) {
                    Ok(()) | Err(Error::Timeout | Error::Interrupted) => None,
                    Err(Error::NoDevice | Error::NotFound | Error::Io) => Some(self.gone()),
                    Err(other) => {
                        Some(self.io(format!("endpoint {endpoint:#04x} cannot be cleared ({other})")))
                    }
                }
            }
            Step::Gone => Some(self.gone()),
            Step::Broken => Some(self.io(match error {
                Error::Pipe => format!("endpoint {endpoint:#04x} stays stalled; restart the device"),
                other => format!("a transfer on endpoint {endpoint:#04x} failed ({other})"),
            })),
        }
    }

    fn gone(&self) -> DeviceError {
        DeviceError::Gone { device: self.name.clone() }
    }

    fn io(&self, reason: String) -> DeviceError {
        DeviceError::Io { device: self.name.clone(), reason }
    }
}

/// What to do after a failed transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Nothing came, nothing is wrong.
    GoOn,
    /// Try again after a pause.
    Again,
    /// Clear the endpoint, then try again.
    Unstall,
    /// The device was unplugged.
    Gone,
    /// It cannot go on.
    Broken,
}

/// Failures since the last transfer that went well.
#[derive(Clone, Copy, Debug, Default)]
struct Trouble {
    stalls: u32,
    failures: u32,
}

impl Trouble {
    fn judge(&mut self, error: Error) -> Step {
        match error {
            Error::Timeout | Error::Interrupted => Step::GoOn,
            Error::NoDevice | Error::NotFound => Step::Gone,
            Error::Pipe if self.stalls < STALLS => {
                self.stalls += 1;
                Step::Unstall
            }
            Error::Io | Error::Other if self.failures < FAILURES => {
                self.failures += 1;
                Step::Again
            }
            Error::Io | Error::Other => Step::Gone,
            _ => Step::Broken,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_outs_pass_stalls_are_cleared_and_a_pulled_cable_is_gone() {
        let mut trouble = Trouble::default();
        assert!((0..1000).all(|_| trouble.judge(Error::Timeout) == Step::GoOn));
        assert!((0..STALLS).all(|_| trouble.judge(Error::Pipe) == Step::Unstall));
        assert_eq!(trouble.judge(Error::Pipe), Step::Broken, "an endpoint that stays stalled is told");
        assert!((0..FAILURES).all(|_| trouble.judge(Error::Io) == Step::Again));
        assert_eq!(trouble.judge(Error::Io), Step::Gone);
        assert_eq!(Trouble::default().judge(Error::NoDevice), Step::Gone);
        assert_eq!(Trouble::default().judge(Error::Overflow), Step::Broken);
        assert!(PAUSE * FAILURES < Duration::from_millis(50), "a pulled cable is noticed in time");
    }
}
