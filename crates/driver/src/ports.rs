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
    /// Serial number of a USB adapter; empty if it has none.
    pub serial: String,
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
    let (usb_id, description, serial) = match port.port_type {
        SerialPortType::UsbPort(usb) => {
            let serial = usb.serial_number.unwrap_or_default();
            let words = [usb.manufacturer, usb.product, Some(serial.clone())];
            let words = words.into_iter().flatten().filter(|w| !w.is_empty()).collect::<Vec<_>>();
            (Some((usb.vid, usb.pid)), words.join(" "), serial)
        }
        SerialPortType::BluetoothPort => (None, "Bluetooth".to_owned(), String::new()),
        SerialPortType::PciPort => (None, "PCI".to_owned(), String::new()),
        SerialPortType::Unknown => (None, String::new(), String::new()),
    };
    PortInfo { path: port.port_name, usb_id, description, serial, permitted }
}

/// A USB adapter by what stays the same when it is plugged in anew; its port may be called otherwise then.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    usb_id: (u16, u16),
    serial: String,
}

impl Adapter {
    /// The adapter behind the port at `path`, which may be a link to it; `None` for a port that is no USB adapter's.
    #[must_use]
    pub fn at(path: &Path) -> Option<Adapter> {
        let real = path.canonicalize().ok()?;
        let port = list_ports().ok()?.into_iter().find(|p| Path::new(&p.path) == real)?;
        Some(Adapter { usb_id: port.usb_id?, serial: port.serial })
    }

    /// The path of its port now: `before` if it has that one still, else the only one that is its; `None` while it is away, or where several ports could be
    /// meant.
    #[must_use]
    pub fn path(&self, before: &Path) -> Option<String> {
        self.choose(&list_ports().ok()?, before)
    }

    fn choose(&self, ports: &[PortInfo], before: &Path) -> Option<String> {
        let own = |p: &&PortInfo| p.usb_id == Some(self.usb_id) && p.serial == self.serial;
        let own: Vec<&PortInfo> = ports.iter().filter(own).collect();
        let same = own.iter().find(|p| Path::new(&p.path) == before);
        match (same, own.as_slice()) {
            (Some(port), _) => Some(port.path.clone()),
            (None, [only]) => Some(only.path.clone()),
            (None, _) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(path: &str, usb_id: Option<(u16, u16)>, serial: &str) -> PortInfo {
        let (path, serial) = (path.to_owned(), serial.to_owned());
        PortInfo { path, usb_id, description: String::new(), serial, permitted: true }
    }

    #[test]
    fn an_adapter_is_known_again_under_another_name_and_never_guessed() {
        let adapter = Adapter { usb_id: (0x403, 0x6001), serial: "A7".into() };
        let before = Path::new("/dev/ttyUSB0");
        let found = |ports: &[PortInfo]| adapter.choose(ports, before);
        let (id, other) = (Some((0x403, 0x6001)), Some((0x403, 0x6010)));
        assert_eq!(
            found(&[port("/dev/ttyUSB0", other, "A7"), port("/dev/ttyUSB1", id, "A7")]),
            Some("/dev/ttyUSB1".into())
        );
        assert_eq!(
            found(&[port("/dev/ttyUSB0", id, "B8"), port("/dev/ttyS0", None, "")]),
            None,
            "another adapter"
        );
        let two = [port("/dev/ttyUSB2", id, "A7"), port("/dev/ttyUSB1", id, "A7")];
        assert_eq!(found(&two), None, "two ports of one adapter");
        let with_old = [two[0].clone(), port("/dev/ttyUSB0", id, "A7")];
        assert_eq!(found(&with_old), Some("/dev/ttyUSB0".into()), "the old name is still its");
        assert_eq!(Adapter::at(Path::new("/dev/null")), None);
    }

    #[test]
    fn listing_ports_never_panics() {
        for port in list_ports().expect("a list, perhaps empty") {
            assert!(!port.path.is_empty());
        }
    }
}
