//! A USB device in software: what it is ([`descriptor`]) and what it does ([`Function`]), before a port on the bus ([`port`]).

pub mod descriptor;
pub mod port;
pub mod standard;
mod worker;

#[cfg(test)]
mod tests;

pub use descriptor::Descriptors;
pub use port::{Fault, Port, PortError, Ready, Slot};

use crate::redir::Setup;

/// The device answers a control request with a halt: it does not know it, or not now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stalled;

/// What a device does besides the standard requests. Called on the thread of its port; must not block.
pub trait Function: Send {
    /// What it is.
    fn descriptors(&self) -> &Descriptors;

    /// A class or vendor request; gives the data for those that read.
    ///
    /// # Errors
    /// [`Stalled`].
    fn control(&mut self, setup: Setup, data: &[u8]) -> Result<Vec<u8>, Stalled>;

    /// Bytes to a bulk endpoint.
    fn bulk_out(&mut self, endpoint: u8, data: &[u8]);

    /// Bytes of a bulk endpoint for one read of at most `length`; `None` while there are none.
    fn bulk_in(&mut self, endpoint: u8, length: usize) -> Option<Vec<u8>>;

    /// The host has cleared the halt of an endpoint.
    fn halt_cleared(&mut self, endpoint: u8);

    /// Bus reset, unplugged, or another configuration: everything as after power-on.
    fn reset(&mut self);
}
