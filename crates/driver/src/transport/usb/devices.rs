//! Which USB devices are plugged in, and the one that an address means.
//!
//! Listing opens nothing: ids come from descriptors, words and serial numbers from sysfs, which everybody may read. So a device that may not be opened
//! is still found, and is told as denied, not as absent.
//!
//! Each look makes a libusb context of its own. A context that lives on is told of plugged devices by kernel events, which do not
//! reach every container; a fresh one reads sysfs.

use super::address::UsbAddress;
use super::endpoints::{EndpointFacts, InterfaceFacts, STAGE_CLASS, choose};
use gonio_instrument::DeviceError;
use rusb::{Context, Device, UsbContext as _};
use rustix::fs::{Access, access};
use std::path::{Path, PathBuf};

/// A USB device of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbDevice {
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Serial number; empty if it has none.
    pub serial: String,
    /// What it calls itself; empty if it says nothing.
    pub description: String,
    /// Its device file.
    pub node: PathBuf,
    /// This user may read and write it.
    pub permitted: bool,
    /// It has the interface of a stage.
    pub stage: bool,
}

/// Lists the USB devices without opening any.
///
/// # Errors
/// [`DeviceError::Io`] where the machine has no USB or does not tell.
pub fn list_usb() -> Result<Vec<UsbDevice>, DeviceError> {
    let context = context()?;
    let devices = context.devices().map_err(|e| unlisted(&e))?;
    Ok(devices.iter().filter_map(|device| describe(&device)).collect())
}

/// The one device that an address means.
pub(super) fn find(address: &UsbAddress) -> Result<(Device<Context>, UsbDevice), DeviceError> {
    let device = address.to_string();
    let absent = || DeviceError::Absent { device: device.clone() };
    if !may_be_there(address) {
        return Err(absent());
    }
    let context = context()?;
    let devices = context.devices().map_err(|e| unlisted(&e))?;
    let mut found: Vec<_> = devices
        .iter()
        .filter_map(|d| describe(&d).map(|facts| (d, facts)))
        .filter(|(_, facts)| (facts.vendor, facts.product) == (address.vendor, address.product))
        .collect();
    if let Some(serial) = &address.serial {
        found.retain(|(_, facts)| facts.serial == *serial);
    }
    match found.len() {
        0 => Err(absent()),
        1 => found.pop().ok_or_else(absent),
        n => {
            let serials: Vec<&str> = found.iter().map(|(_, facts)| facts.serial.as_str()).collect();
            let reason = format!(
                "{n} devices have these ids, with serial numbers {}; say which one is meant: {device}:SERIAL",
                serials.join(", ")
            );
            Err(DeviceError::Io { device: device.clone(), reason })
        }
    }
}

/// A look at sysfs that costs little: a lost device is looked for many times a second.
fn may_be_there(address: &UsbAddress) -> bool {
    let Ok(entries) = std::fs::read_dir(SYSFS) else { return true };
    let wanted = [format!("{:04x}", address.vendor), format!("{:04x}", address.product)];
    entries.flatten().any(|entry| {
        let read = |name: &str| std::fs::read_to_string(entry.path().join(name)).unwrap_or_default();
        read("idVendor").trim() == wanted[0] && read("idProduct").trim() == wanted[1]
    })
}

const SYSFS: &str = "/sys/bus/usb/devices";

fn context() -> Result<Context, DeviceError> {
    // `rusb::devices()` would panic where the machine has no USB.
    Context::new().map_err(|error| {
        let reason = if Path::new(SYSFS).exists() {
            format!("libusb cannot be started ({error}); look at `dmesg`")
        } else {
            format!("this machine shows no USB ({SYSFS} is missing; {error}); in a container, pass /dev/bus/usb and /sys through")
        };
        DeviceError::Io { device: "USB".to_owned(), reason }
    })
}

fn unlisted(error: &rusb::Error) -> DeviceError {
    DeviceError::Io { device: "USB".to_owned(), reason: format!("devices cannot be listed ({error})") }
}

fn describe(device: &Device<Context>) -> Option<UsbDevice> {
    let ids = device.device_descriptor().ok()?;
    let node = PathBuf::from(format!("/dev/bus/usb/{:03}/{:03}", device.bus_number(), device.address()));
    let words = |name| sysfs_text(device, name);
    let description = [words("manufacturer"), words("product")].into_iter().flatten().collect::<Vec<_>>();
    Some(UsbDevice {
        vendor: ids.vendor_id(),
        product: ids.product_id(),
        serial: words("serial").unwrap_or_default(),
        description: description.join(" "),
        permitted: access(&node, Access::READ_OK | Access::WRITE_OK).is_ok(),
        node,
        stage: interfaces(device)
            .is_ok_and(|i| i.iter().any(|i| i.class == STAGE_CLASS) && choose(&i).is_ok()),
    })
}

/// A line of the kernel about a device, which needs no permission.
fn sysfs_text(device: &Device<Context>, name: &str) -> Option<String> {
    let ports = device.port_numbers().ok()?;
    let bus = device.bus_number();
    let folder = if ports.is_empty() {
        format!("usb{bus}")
    } else {
        let ports: Vec<String> = ports.iter().map(u8::to_string).collect();
        format!("{bus}-{}", ports.join("."))
    };
    let text = std::fs::read(Path::new(SYSFS).join(folder).join(name)).ok()?;
    Some(String::from_utf8_lossy(&text).trim().to_owned()).filter(|t| !t.is_empty())
}

/// The interfaces of the configuration under way, each in all its settings.
pub(super) fn interfaces(device: &Device<Context>) -> Result<Vec<InterfaceFacts>, rusb::Error> {
    let configuration = device.active_config_descriptor()?;
    let settings = configuration.interfaces().flat_map(|i| i.descriptors().collect::<Vec<_>>());
    let facts = settings.map(|s| InterfaceFacts {
        number: s.interface_number(),
        setting: s.setting_number(),
        class: (s.class_code(), s.sub_class_code(), s.protocol_code()),
        endpoints: s
            .endpoint_descriptors()
            .map(|e| EndpointFacts {
                address: e.address(),
                bulk: e.transfer_type() == rusb::TransferType::Bulk,
                packet: e.max_packet_size(),
            })
            .collect(),
    });
    Ok(facts.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_never_panics_and_what_is_not_there_is_absent_or_told() {
        match list_usb() {
            Ok(devices) => assert!(devices.iter().all(|d| d.node.starts_with("/dev/bus/usb"))),
            Err(error) => assert!(error.to_string().starts_with("USB: "), "{error}"),
        }
        let nobody: UsbAddress = "1209:ffff:nobody has this".parse().expect("an address");
        match find(&nobody) {
            Err(DeviceError::Absent { device }) => assert_eq!(device, nobody.to_string()),
            Err(DeviceError::Io { reason, .. }) => assert!(reason.contains("USB"), "{reason}"),
            other => panic!("{other:?}"),
        }
    }
}
