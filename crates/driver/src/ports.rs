//! Which serial ports there are, and whether this user may open them.

use rustix::fs::{Access, access};
use serialport::SerialPortType;
use std::path::Path;

/// A serial port of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// What to give to `--device serial:`.
    pub path: String,
    /// Vendor and product id of a USB adapter.
    pub usb_id: Option<(u16, u16)>,
    /// What the adapter calls itself; empty if it says nothing.
    pub description: String,
    /// This user may read and write it.
    pub permitted: bool,
}

/// Lists serial ports without opening any: opening one may reset the device behind it.
///
/// # Errors
/// The system's words if the list cannot be had.
pub fn list_ports() -> Result<Vec<PortInfo>, serialport::Error> {
    // `available_ports` panics where this folder is missing, in containers for instance: no folder, no ports.
    if cfg!(target_os = "linux") && std::fs::read_dir("/sys/class/tty").is_err() {
        return Ok(Vec::new());
    }
    let ports = serialport::available_ports()?;
    Ok(ports.into_iter().map(describe).collect())
}

fn describe(port: serialport::SerialPortInfo) -> PortInfo {
    let permitted = access(Path::new(&port.port_name), Access::READ_OK | Access::WRITE_OK).is_ok();
    let (usb_id, description) = match port.port_type {
        SerialPortType::UsbPort(usb) => {
            let words = [usb.manufacturer, usb.product, usb.serial_number];
            (Some((usb.vid, usb.pid)), words.into_iter().flatten().collect::<Vec<_>>().join(" "))
        }
        SerialPortType::BluetoothPort => (None, "Bluetooth".to_owned()),
        SerialPortType::PciPort => (None, "PCI".to_owned()),
        SerialPortType::Unknown => (None, String::new()),
    };
    PortInfo { path: port.port_name, usb_id, description, permitted }
}

#[cfg(test)]
mod tests {
    #[test]
    fn listing_ports_never_panics() {
        for port in super::list_ports().expect("a list, perhaps empty") {
            assert!(!port.path.is_empty());
        }
    }
}
