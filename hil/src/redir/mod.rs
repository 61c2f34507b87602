//! The usbredir protocol: USB over a byte stream, as QEMU's `usb-redir` device speaks it.

pub mod codec;
pub mod packet;

pub use codec::{Codec, PacketError, capability};
pub use packet::{Endpoint, FromGuest, Interface, Setup, Status, ToGuest};
