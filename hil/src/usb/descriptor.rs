//! Descriptors as bytes, put together from what they describe.

use crate::redir::{Endpoint, Interface};

/// Vendor of both devices: pid.codes, whose first products are for tests.
pub const VENDOR: u16 = 0x1209;
/// Largest bulk packet at high speed.
pub const BULK_PACKET: u16 = 512;

const DEVICE: u8 = 1;
const CONFIGURATION: u8 = 2;
const INTERFACE: u8 = 4;
const ENDPOINT: u8 = 5;
const QUALIFIER: u8 = 6;
const BULK: u8 = 2;
const CONTROL_PACKET: u8 = 64;
/// Bus powered, as bit 7 must be.
const BUS_POWERED: u8 = 0x80;
/// In units of 2 mA.
const HALF_AN_AMPERE: u8 = 250;
const MANUFACTURER_TEXT: u8 = 1;
const PRODUCT_TEXT: u8 = 2;
const SERIAL_TEXT: u8 = 3;
/// US English.
const LANGUAGE: [u8; 4] = [4, 3, 9, 4];

/// What a device says that it is. One configuration, number 1; every interface has the alternate setting 0 alone.
#[derive(Clone, Debug)]
pub struct Descriptors {
    /// Class, subclass, protocol of the device.
    pub class: [u8; 3],
    /// Product number.
    pub product: u16,
    /// Release, binary-coded decimal.
    pub release: u16,
    /// Manufacturer, product and serial number.
    pub texts: [String; 3],
    /// Interfaces.
    pub interfaces: Vec<Interface>,
    /// Bulk endpoints.
    pub endpoints: Vec<Endpoint>,
    /// The configuration with all that belongs to it.
    pub configuration: Vec<u8>,
}

impl Descriptors {
    /// A device without interfaces yet.
    #[must_use]
    pub fn new(class: [u8; 3], product: u16, texts: [&str; 3]) -> Descriptors {
        let configuration = vec![9, CONFIGURATION, 0, 0, 0, 1, 0, BUS_POWERED, HALF_AN_AMPERE];
        let texts = texts.map(str::to_owned);
        Descriptors {
            class,
            product,
            release: 0x0100,
            texts,
            interfaces: vec![],
            endpoints: vec![],
            configuration,
        }
    }

    /// Adds an interface with the class-specific descriptors behind it and its bulk endpoints.
    #[must_use]
    pub fn interface(mut self, number: u8, class: [u8; 3], specific: &[u8], endpoints: &[u8]) -> Descriptors {
        let [main, sub, protocol] = class;
        self.raw(&[9, INTERFACE, number, 0, endpoints.len() as u8, main, sub, protocol, 0]);
        self.raw(specific);
        for &address in endpoints {
            let [low, high] = BULK_PACKET.to_le_bytes();
            self.raw(&[7, ENDPOINT, address, BULK, low, high, 0]);
            self.endpoints.push(Endpoint { address, interface: number, max_packet: BULK_PACKET });
        }
        self.interfaces.push(Interface { number, class });
        self.configuration[4] = self.interfaces.len() as u8;
        self
    }

    /// Adds descriptors that belong to no single interface.
    #[must_use]
    pub fn with(mut self, bytes: &[u8]) -> Descriptors {
        self.raw(bytes);
        self
    }

    fn raw(&mut self, bytes: &[u8]) {
        self.configuration.extend_from_slice(bytes);
        let [low, high] = (self.configuration.len() as u16).to_le_bytes();
        self.configuration[2] = low;
        self.configuration[3] = high;
    }

    /// The descriptor that a GET_DESCRIPTOR asks for; `None` for what there is not.
    #[must_use]
    pub fn find(&self, value: u16) -> Option<Vec<u8>> {
        let [index, kind] = value.to_le_bytes();
        match (kind, index) {
            (DEVICE, 0) => {
                let mut bytes = vec![18, DEVICE, 0, 2];
                bytes.extend(self.class);
                bytes.push(CONTROL_PACKET);
                for number in [VENDOR, self.product, self.release] {
                    bytes.extend(number.to_le_bytes());
                }
                bytes.extend([MANUFACTURER_TEXT, PRODUCT_TEXT, SERIAL_TEXT, 1]);
                Some(bytes)
            }
            (CONFIGURATION, 0) => Some(self.configuration.clone()),
            (QUALIFIER, 0) => {
                let [main, sub, protocol] = self.class;
                Some(vec![10, QUALIFIER, 0, 2, main, sub, protocol, CONTROL_PACKET, 1, 0])
            }
            (3, 0) => Some(LANGUAGE.to_vec()),
            (3, MANUFACTURER_TEXT..=SERIAL_TEXT) => self.texts.get(usize::from(index) - 1).map(|t| text(t)),
            _ => None,
        }
    }
}

/// A string descriptor: UTF-16, at most 126 units.
fn text(words: &str) -> Vec<u8> {
    let mut bytes = vec![0, 3];
    bytes.extend(words.encode_utf16().take(126).flat_map(u16::to_le_bytes));
    bytes[0] = bytes.len() as u8;
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_add_up() {
        let d =
            Descriptors::new([0; 3], 1, ["m", "p", "s"]).interface(0, [255, 0x47, 1], &[3, 9, 9], &[2, 0x83]);
        let c = d.find(0x0200).expect("a configuration");
        assert_eq!(usize::from(u16::from_le_bytes([c[2], c[3]])), c.len());
        assert_eq!(c[4], 1);
        // walks from descriptor to descriptor and ends at the end
        let mut at = 0;
        let mut kinds = vec![];
        while at < c.len() {
            kinds.push(c[at + 1]);
            at += usize::from(c[at]);
        }
        assert_eq!((at, kinds), (c.len(), vec![2, 4, 9, 5, 5]));
        assert_eq!(d.find(0x0100).map(|b| b.len()), Some(18));
        assert_eq!(d.find(0x0303), Some(vec![4, 3, b's', 0]));
        assert_eq!(d.find(0x0304), None);
    }
}
