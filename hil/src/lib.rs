//! Hardware in the loop without hardware: the virtual instrument as USB devices, before the drivers of a real kernel.
//!
//! QEMU boots Debian's kernel; [`usb`] devices reach it over the protocol in [`redir`], a serial adapter over QEMU's own model ([`serial`]). The
//! [`stage`] and the [`camera`] are two faces of one virtual [`instrument`]. [`host`] runs the machine and pulls plugs when the guest asks for it
//! over the channel of [`line`]; [`guest`] is what runs in the machine and proves the driver against those kernel drivers.
//!
//! What it leaves to others: how the instrument behaves (`gonio-sim`), and everything that is tested (`gonio-driver`, `gonio`).

pub mod camera;
pub mod files;
pub mod guest;
pub mod host;
pub mod instrument;
pub mod line;
pub mod redir;
pub mod serial;
pub mod stage;
pub mod usb;

use std::io::Write;

/// A line for whoever watches the run.
pub fn log(text: &str) {
    // a closed terminal is no reason to end
    let _ = writeln!(std::io::stderr(), "hil: {text}");
}
