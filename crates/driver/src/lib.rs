//! Transports, the stage client, camera back ends.
//!
//! All device I/O lives on named threads that are reached through bounded channels or callbacks, so nothing here blocks an async
//! runtime. [`transport`] carries bytes, [`stage`] speaks the protocol of `gonio-protocol` over them and implements
//! [`gonio_instrument::Stage`], [`camera`] implements [`gonio_instrument::Camera`], [`ports`] tells what is plugged in.
//!
//! What it leaves to others: what the protocol looks like (`gonio-protocol`), what is scanned and why (`gonio-acquisition`), where
//! bytes on the wire are kept (`gonio-recording`; see [`stage::Tap`]). It knows nothing of BRDFs or of the simulator.

pub mod camera;
mod dice;
pub mod ports;
pub mod stage;
pub mod transport;
