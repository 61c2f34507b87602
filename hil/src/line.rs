//! The channel between guest and host, beside everything that is tested: one JSON object per line, over a virtio serial port.
//!
//! The guest asks for plugs to be pulled and tells its results; the host answers each request with one [`Reply`].

use serde::{Deserialize, Serialize};

/// Name of the port in the guest.
pub const PORT: &str = "gonio.control";

/// The devices that can be plugged in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Device {
    /// The stage behind QEMU's serial adapter.
    Serial,
    /// The stage as a USB device.
    Usb,
    /// The camera.
    Camera,
}

impl Device {
    /// All of them.
    pub const ALL: [Device; 3] = [Device::Serial, Device::Usb, Device::Camera];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Device::Serial => "serial",
            Device::Usb => "usb",
            Device::Camera => "camera",
        }
    }
}

/// What the guest says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FromGuest {
    /// Plug a device in, or pull it.
    Plug {
        /// Which.
        device: Device,
        /// In, or out.
        on: bool,
    },
    /// Halt the endpoint that gives data.
    Halt {
        /// Of which device.
        device: Device,
    },
    /// Refuse unless the last halt of a device was met and cleared.
    Healed {
        /// Which.
        device: Device,
    },
    /// Let a device answer no transfers, or answer again.
    Silence {
        /// Which.
        device: Device,
        /// Silent.
        on: bool,
    },
    /// Show the test chart with numbers from 0, or the instrument.
    Chart {
        /// The chart.
        on: bool,
    },
    /// Break off so many of the next frames half-way.
    Tear {
        /// How many.
        frames: u32,
    },
    /// Put a sample on the holder, by the name of the kind of scan.
    Sample {
        /// Kind of scan.
        kind: gonio_instrument::ScanKind,
    },
    /// A test has ended.
    Result {
        /// Which.
        name: String,
        /// How long it took by the guest's clock, s.
        seconds: f64,
        /// What is wrong; nothing if it passed.
        failure: Option<String>,
    },
    /// Something was measured.
    Figure(Figure),
    /// Words for whoever watches.
    Note(String),
}

/// A measured value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What.
    pub name: String,
    /// How much.
    pub value: f64,
    /// In what.
    pub unit: String,
    /// What it must not exceed, if anything.
    pub bound: Option<f64>,
    /// From how much it was gathered.
    pub from: String,
}

/// The host's answer to a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reply {
    /// It is done.
    Done,
    /// It cannot be done; why.
    Refused(String),
}
