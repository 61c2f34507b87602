//! The usbredir protocol: USB over a byte stream, as QEMU's `usb-redir` device speaks it.

pub mod packet;

pub use packet::{Codec, Endpoint, FromGuest, Interface, PacketError, Setup, Status, ToGuest};
