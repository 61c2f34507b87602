//! Packets of the usbredir protocol, version 0.7, as the machine that *has* the device speaks it.
//!
//! Sans-I/O. All numbers little endian. A packet is a header and a body:
//!
//! ```text
//! type u32 | length of the body u32 | id u32, or u64 once both sides can
//! ```
//!
//! and the body is a fixed structure per type, then data. Written from `usb-redirection-protocol.md` of the usbredir project; what isochronous
//! and interrupt endpoints, streams and filters need is left out, because no device here has them. (The crate `usbredirparser` 0.4.1 binds the
//! C parser, but every callback in it ends in `unimplemented!()`.)

use super::packet::{Endpoint, FromGuest, Interface, Setup, Status, ToGuest};

/// Bits of the capabilities in a hello.
pub mod capability {
    /// The connect packet holds the device's release.
    pub const DEVICE_VERSION: u32 = 1 << 1;
    /// Disconnections are acknowledged.
    pub const DISCONNECT_ACK: u32 = 1 << 3;
    /// Endpoint tables hold packet sizes; without them the guest's side does not keep several reads under way.
    pub const PACKET_SIZES: u32 = 1 << 4;
    /// Packet ids have 64 bits.
    pub const LONG_IDS: u32 = 1 << 5;
    /// Bulk lengths have 32 bits.
    pub const LONG_BULK: u32 = 1 << 6;
    /// All that this side can.
    pub const OURS: u32 = DEVICE_VERSION | DISCONNECT_ACK | PACKET_SIZES | LONG_IDS | LONG_BULK;
}

mod kind {
    pub const HELLO: u32 = 0;
    pub const CONNECT: u32 = 1;
    pub const DISCONNECT: u32 = 2;
    pub const RESET: u32 = 3;
    pub const INTERFACES: u32 = 4;
    pub const ENDPOINTS: u32 = 5;
    pub const SET_CONFIGURATION: u32 = 6;
    pub const GET_CONFIGURATION: u32 = 7;
    pub const CONFIGURATION: u32 = 8;
    pub const SET_ALT: u32 = 9;
    pub const GET_ALT: u32 = 10;
    pub const ALT: u32 = 11;
    pub const CANCEL: u32 = 21;
    pub const DISCONNECT_ACK: u32 = 24;
    pub const CONTROL: u32 = 100;
    pub const BULK: u32 = 101;
}

/// Entries of the interface and endpoint tables.
const TABLE: usize = 32;
/// Bytes of the version text in a hello.
const VERSION_TEXT: usize = 64;
/// Largest body taken; QEMU's largest bulk transfer is far below.
const LONGEST: usize = 1 << 24;
/// Endpoint or interface that is not there.
const NONE: u8 = 255;
const SPEED_HIGH: u8 = 2;
const TYPE_CONTROL: u8 = 0;
const TYPE_BULK: u8 = 2;

/// Why bytes are no packets.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PacketError {
    /// A body longer than any.
    #[error(
        "a usbredir packet of type {kind} claims {length} bytes, more than any holds: the stream is out of step"
    )]
    TooLong {
        /// Type.
        kind: u32,
        /// Length claimed.
        length: usize,
    },
    /// A body shorter than its structure.
    #[error("a usbredir packet of type {kind} holds {found} bytes, its structure needs {expected}")]
    TooShort {
        /// Type.
        kind: u32,
        /// Found.
        found: usize,
        /// Expected at least.
        expected: usize,
    },
}

/// Takes bytes apart and puts packets together; knows how wide ids are by now.
#[derive(Debug, Default)]
pub struct Codec {
    input: Vec<u8>,
    long_ids: bool,
    long_bulk: bool,
}

impl Codec {
    /// Takes bytes from the guest's side.
    pub fn push(&mut self, bytes: &[u8]) {
        self.input.extend_from_slice(bytes);
    }

    /// The next whole packet, if there is one.
    ///
    /// # Errors
    /// [`PacketError`]: the connection is of no more use.
    pub fn next_packet(&mut self) -> Result<Option<FromGuest>, PacketError> {
        let header = if self.long_ids { 16 } else { 12 };
        if self.input.len() < header {
            return Ok(None);
        }
        let kind = u32_at(&self.input, 0);
        let length = u32_at(&self.input, 4) as usize;
        if length > LONGEST {
            return Err(PacketError::TooLong { kind, length });
        }
        if self.input.len() < header + length {
            return Ok(None);
        }
        let low = u64::from(u32_at(&self.input, 8));
        let id = if self.long_ids { low | u64::from(u32_at(&self.input, 12)) << 32 } else { low };
        let body: Vec<u8> = self.input.drain(..header + length).skip(header).collect();
        self.parse(kind, id, &body).map(Some)
    }

    fn parse(&mut self, kind: u32, id: u64, body: &[u8]) -> Result<FromGuest, PacketError> {
        let need = |expected: usize| match body.len() {
            found if found < expected => Err(PacketError::TooShort { kind, found, expected }),
            _ => Ok(()),
        };
        Ok(match kind {
            kind::HELLO => {
                need(VERSION_TEXT)?;
                let capabilities =
                    if body.len() >= VERSION_TEXT + 4 { u32_at(body, VERSION_TEXT) } else { 0 };
                self.long_ids = capabilities & capability::LONG_IDS != 0;
                self.long_bulk = capabilities & capability::LONG_BULK != 0;
                FromGuest::Hello { capabilities }
            }
            kind::RESET => FromGuest::Reset,
            kind::SET_CONFIGURATION => {
                need(1)?;
                FromGuest::SetConfiguration { id, configuration: body[0] }
            }
            kind::GET_CONFIGURATION => FromGuest::GetConfiguration { id },
            kind::SET_ALT => {
                need(2)?;
                FromGuest::SetAltSetting { id, interface: body[0], alternate: body[1] }
            }
            kind::GET_ALT => {
                need(1)?;
                FromGuest::GetAltSetting { id, interface: body[0] }
            }
            kind::CANCEL => FromGuest::Cancel { id },
            kind::DISCONNECT_ACK => FromGuest::DisconnectAck,
            kind::CONTROL => {
                need(10)?;
                let setup = Setup {
                    request: body[1],
                    request_type: body[2],
                    value: u16_at(body, 4),
                    index: u16_at(body, 6),
                    length: u16_at(body, 8),
                };
                FromGuest::Control { id, setup, data: body[10..].to_vec() }
            }
            kind::BULK => {
                let structure = self.bulk_structure();
                need(structure)?;
                let high = if self.long_bulk { usize::from(u16_at(body, 8)) << 16 } else { 0 };
                FromGuest::Bulk {
                    id,
                    endpoint: body[0],
                    length: usize::from(u16_at(body, 2)) | high,
                    data: body[structure..].to_vec(),
                }
            }
            kind => FromGuest::Other { kind },
        })
    }

    fn bulk_structure(&self) -> usize {
        if self.long_bulk { 10 } else { 8 }
    }

    /// The bytes of a packet.
    #[must_use]
    pub fn encode(&self, packet: &ToGuest<'_>) -> Vec<u8> {
        match packet {
            ToGuest::Hello => {
                let mut body = vec![0; VERSION_TEXT];
                let name = b"gonio-hil";
                body[..name.len()].copy_from_slice(name);
                body.extend_from_slice(&capability::OURS.to_le_bytes());
                // the width of ids is agreed upon by this very packet
                frame(kind::HELLO, 0, false, &body)
            }
            ToGuest::Connect { class, vendor, product, release } => {
                let mut body = vec![SPEED_HIGH, class[0], class[1], class[2]];
                for number in [vendor, product, release] {
                    body.extend_from_slice(&number.to_le_bytes());
                }
                self.frame(kind::CONNECT, 0, &body)
            }
            ToGuest::Disconnect => self.frame(kind::DISCONNECT, 0, &[]),
            ToGuest::Interfaces(list) => self.frame(kind::INTERFACES, 0, &interface_table(list)),
            ToGuest::Endpoints(list) => self.frame(kind::ENDPOINTS, 0, &endpoint_table(list)),
            ToGuest::Configuration { id, configuration } => {
                self.frame(kind::CONFIGURATION, *id, &[Status::Success as u8, *configuration])
            }
            ToGuest::AltSetting { id, status, interface, alternate } => {
                self.frame(kind::ALT, *id, &[*status as u8, *interface, *alternate])
            }
            ToGuest::Control { id, status, setup, data } => {
                let mut body =
                    vec![setup.request_type & 0x80, setup.request, setup.request_type, *status as u8];
                let length = if setup.is_in() { data.len() as u16 } else { setup.length };
                for number in [setup.value, setup.index, length] {
                    body.extend_from_slice(&number.to_le_bytes());
                }
                body.extend_from_slice(data);
                self.frame(kind::CONTROL, *id, &body)
            }
            ToGuest::Bulk { id, status, endpoint, length, data } => {
                let mut body = vec![*endpoint, *status as u8];
                body.extend_from_slice(&(*length as u16).to_le_bytes());
                body.extend_from_slice(&0u32.to_le_bytes());
                if self.long_bulk {
                    body.extend_from_slice(&((*length >> 16) as u16).to_le_bytes());
                }
                body.extend_from_slice(data);
                self.frame(kind::BULK, *id, &body)
            }
        }
    }

    fn frame(&self, kind: u32, id: u64, body: &[u8]) -> Vec<u8> {
        frame(kind, id, self.long_ids, body)
    }
}

fn frame(kind: u32, id: u64, long_ids: bool, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(16 + body.len());
    bytes.extend_from_slice(&kind.to_le_bytes());
    bytes.extend_from_slice(&(body.len() as u32).to_le_bytes());
    if long_ids {
        bytes.extend_from_slice(&id.to_le_bytes());
    } else {
        bytes.extend_from_slice(&(id as u32).to_le_bytes());
    }
    bytes.extend_from_slice(body);
    bytes
}

fn interface_table(list: &[Interface]) -> Vec<u8> {
    let mut body = (list.len() as u32).to_le_bytes().to_vec();
    let mut columns = [[0u8; TABLE]; 4];
    for (place, interface) in list.iter().take(TABLE).enumerate() {
        columns[0][place] = interface.number;
        for (column, value) in columns[1..].iter_mut().zip(interface.class) {
            column[place] = value;
        }
    }
    body.extend(columns.as_flattened());
    body
}

/// The place of an endpoint is its number, 16 more for those from the device.
fn endpoint_table(list: &[Endpoint]) -> Vec<u8> {
    let mut kinds = [NONE; TABLE];
    let mut interfaces = [NONE; TABLE];
    let mut sizes = [0u16; TABLE];
    for place in [0, 16] {
        kinds[place] = TYPE_CONTROL;
        interfaces[place] = 0;
        sizes[place] = 64;
    }
    for endpoint in list {
        let place = usize::from(endpoint.address & 0x0f) + usize::from(endpoint.address >> 7) * 16;
        kinds[place] = TYPE_BULK;
        interfaces[place] = endpoint.interface;
        sizes[place] = endpoint.max_packet;
    }
    // types, intervals, interfaces, packet sizes
    let mut body = kinds.to_vec();
    body.extend([0; TABLE]);
    body.extend(interfaces);
    body.extend(sizes.iter().flat_map(|s| s.to_le_bytes()));
    body
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..at + 2).and_then(|b| b.try_into().ok()).map_or(0, u16::from_le_bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hello(capabilities: u32) -> Vec<u8> {
        let mut bytes = vec![0; 4];
        bytes.extend(68u32.to_le_bytes());
        bytes.extend([0; 4 + VERSION_TEXT]);
        bytes.extend(capabilities.to_le_bytes());
        bytes
    }

    #[test]
    fn ids_and_lengths_widen_once_both_sides_can() {
        let mut codec = Codec::default();
        codec.push(&hello(capability::LONG_IDS | capability::LONG_BULK));
        // a bulk read of 0x20004 bytes from endpoint 0x83, id 2^40 + 7, byte by byte
        let mut bulk = vec![101, 0, 0, 0, 10, 0, 0, 0, 7, 0, 0, 0, 0, 1, 0, 0];
        bulk.extend([0x83, 0, 4, 0, 0, 0, 0, 0, 2, 0]);
        assert_eq!(
            codec.next_packet(),
            Ok(Some(FromGuest::Hello { capabilities: capability::LONG_IDS | capability::LONG_BULK }))
        );
        for byte in &bulk[..bulk.len() - 1] {
            codec.push(&[*byte]);
            assert_eq!(codec.next_packet(), Ok(None));
        }
        codec.push(&bulk[bulk.len() - 1..]);
        assert_eq!(
            codec.next_packet(),
            Ok(Some(FromGuest::Bulk { id: (1 << 40) + 7, endpoint: 0x83, length: 0x20004, data: vec![] }))
        );
        let reply =
            ToGuest::Bulk { id: 1 << 40, status: Status::Stall, endpoint: 0x83, length: 0, data: &[] };
        assert_eq!(codec.encode(&reply).len(), 26);
        assert_eq!(codec.encode(&reply)[17], 4);
    }

    #[test]
    fn an_old_peer_gets_short_ids() {
        let mut codec = Codec::default();
        codec.push(&hello(0));
        assert_eq!(codec.next_packet(), Ok(Some(FromGuest::Hello { capabilities: 0 })));
        assert_eq!(codec.encode(&ToGuest::Disconnect), [2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn the_tables_have_the_sizes_of_the_specification() {
        let endpoint = Endpoint { address: 0x83, interface: 0, max_packet: 512 };
        let table = endpoint_table(&[endpoint]);
        assert_eq!(table.len(), 32 * 3 + 64);
        assert_eq!((table[19], table[64 + 19], table[3]), (TYPE_BULK, 0, NONE));
        assert_eq!(u16_at(&table, 96 + 38), 512);
        assert_eq!(interface_table(&[Interface { number: 0, class: [255, 0x47, 1] }]).len(), 132);
    }

    #[test]
    fn nonsense_is_refused_and_not_waited_for() {
        let mut codec = Codec::default();
        codec.push(&[100, 0, 0, 0, 255, 255, 255, 255, 0, 0, 0, 0]);
        assert!(matches!(codec.next_packet(), Err(PacketError::TooLong { kind: 100, .. })));
        let mut codec = Codec::default();
        codec.push(&[100, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 2]);
        assert_eq!(codec.next_packet(), Err(PacketError::TooShort { kind: 100, found: 2, expected: 10 }));
    }
}
