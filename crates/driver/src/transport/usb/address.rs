//! How a USB stage is named: `VID:PID` or `VID:PID:SERIAL`.

use gonio_instrument::DeviceError;
use std::fmt;
use std::str::FromStr;

/// Vendor id of the prototype boards (pid.codes).
pub const VENDOR: u16 = 0x1209;
/// Product id of the prototype stage.
pub const PRODUCT: u16 = 0x0001;

/// A USB device by its ids, and by its serial number where there are several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbAddress {
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Serial number, exactly as the device tells it.
    pub serial: Option<String>,
}

impl UsbAddress {
    /// The same device by its serial number, to be found again wherever it is plugged in.
    #[must_use]
    pub fn with_serial(&self, serial: &str) -> UsbAddress {
        let serial = Some(serial.to_owned()).filter(|s| !s.is_empty());
        UsbAddress { serial: serial.or_else(|| self.serial.clone()), ..self.clone() }
    }
}

impl fmt::Display for UsbAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "usb:{:04x}:{:04x}", self.vendor, self.product)?;
        self.serial.iter().try_for_each(|serial| write!(f, ":{serial}"))
    }
}

/// Why a text names no USB device.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "usb:{found}: expected usb:VID:PID or usb:VID:PID:SERIAL with two numbers of up to four hexadecimal digits, for instance usb:1209:0001"
)]
pub struct AddressError {
    /// What was found, without `usb:`.
    pub found: String,
}

impl From<AddressError> for DeviceError {
    fn from(error: AddressError) -> Self {
        DeviceError::Io { device: format!("usb:{}", error.found), reason: error.to_string() }
    }
}

impl FromStr for UsbAddress {
    type Err = AddressError;

    /// Reads `VID:PID[:SERIAL]`, without the leading `usb:`. A serial number may hold colons.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = || AddressError { found: text.to_owned() };
        let id = |part: Option<&str>| {
            let digits =
                part.filter(|p| (1..=4).contains(&p.len()) && p.bytes().all(|b| b.is_ascii_hexdigit()))?;
            u16::from_str_radix(digits, 16).ok()
        };
        let mut parts = text.splitn(3, ':');
        let vendor = id(parts.next()).ok_or_else(wrong)?;
        let product = id(parts.next()).ok_or_else(wrong)?;
        let serial = parts.next().map(str::to_owned);
        if serial.as_deref() == Some("") {
            return Err(wrong());
        }
        Ok(UsbAddress { vendor, product, serial })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_written_alike() {
        for (text, serial) in
            [("1209:0001", None), ("1209:0001:G-7", Some("G-7")), ("1209:0001:a:b", Some("a:b"))]
        {
            let address: UsbAddress = text.parse().expect(text);
            assert_eq!((address.vendor, address.product), (0x1209, 1));
            assert_eq!(address.serial.as_deref(), serial);
            assert_eq!(address.to_string(), format!("usb:{text}"));
        }
        assert_eq!("4D8:a".parse(), Ok(UsbAddress { vendor: 0x4d8, product: 10, serial: None }));
    }

    #[test]
    fn what_names_no_device_is_refused_with_an_example() {
        for text in
            ["", "1209", "1209:", ":1", "12090:1", "1209:0001:", "+209:1", "0x1209:1", "12 9:1", "é9:1"]
        {
            let error = text.parse::<UsbAddress>().expect_err(text).to_string();
            assert!(error.contains("usb:1209:0001") && error.contains(text), "{error}");
        }
    }

    #[test]
    fn a_serial_number_once_seen_is_kept() {
        let any: UsbAddress = "1209:1".parse().expect("an address");
        assert_eq!(any.with_serial("X").serial.as_deref(), Some("X"));
        assert_eq!(any.with_serial("X").with_serial("").serial.as_deref(), Some("X"));
    }
}
