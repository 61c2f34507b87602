//! What is said over usbredir, in both directions; [`super::codec`] has the bytes.

/// How a transfer ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// It went well.
    Success = 0,
    /// The guest had asked to cancel it.
    Cancelled = 1,
    /// It made no sense.
    Invalid = 2,
    /// The endpoint is halted.
    Stall = 4,
}

/// A control request: the eight bytes of a setup packet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Setup {
    /// Direction, kind and recipient.
    pub request_type: u8,
    /// Which request.
    pub request: u8,
    /// Its value.
    pub value: u16,
    /// Its index: interface or endpoint in the low byte.
    pub index: u16,
    /// Bytes that the host sends or will take.
    pub length: u16,
}

impl Setup {
    /// The device answers with data.
    #[must_use]
    pub fn is_in(&self) -> bool {
        self.request_type & 0x80 != 0
    }
}

/// What the guest's side says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FromGuest {
    /// First packet, with what it can.
    Hello {
        /// Bits of [`super::capability`].
        capabilities: u32,
    },
    /// The bus was reset.
    Reset,
    /// Choose a configuration.
    SetConfiguration {
        /// Packet.
        id: u64,
        /// Value.
        configuration: u8,
    },
    /// Which configuration is chosen?
    GetConfiguration {
        /// Packet.
        id: u64,
    },
    /// Choose an alternate setting.
    SetAltSetting {
        /// Packet.
        id: u64,
        /// Interface.
        interface: u8,
        /// Setting.
        alternate: u8,
    },
    /// Which alternate setting is chosen?
    GetAltSetting {
        /// Packet.
        id: u64,
        /// Interface.
        interface: u8,
    },
    /// Answer that packet with [`Status::Cancelled`] if it is not answered yet.
    Cancel {
        /// Packet.
        id: u64,
    },
    /// The disconnection was seen.
    DisconnectAck,
    /// A control transfer.
    Control {
        /// Packet.
        id: u64,
        /// Setup.
        setup: Setup,
        /// Data to the device.
        data: Vec<u8>,
    },
    /// A bulk transfer; from the device where bit 7 of the endpoint is set.
    Bulk {
        /// Packet.
        id: u64,
        /// Address of the endpoint.
        endpoint: u8,
        /// Bytes wanted at most, or sent.
        length: usize,
        /// Data to the device.
        data: Vec<u8>,
    },
    /// Something that no device here has.
    Other {
        /// Type of the packet.
        kind: u32,
    },
}

/// Endpoint as the guest's side is told of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// Address.
    pub address: u8,
    /// Interface it belongs to.
    pub interface: u8,
    /// Bytes per packet.
    pub max_packet: u16,
}

/// Interface as the guest's side is told of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interface {
    /// Number.
    pub number: u8,
    /// Class, subclass, protocol.
    pub class: [u8; 3],
}

/// What this side says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ToGuest<'a> {
    /// First packet.
    Hello,
    /// A device is here: speed is high, class triple, vendor, product, release.
    Connect {
        /// Class, subclass, protocol of the device.
        class: [u8; 3],
        /// Vendor.
        vendor: u16,
        /// Product.
        product: u16,
        /// Release, binary-coded decimal.
        release: u16,
    },
    /// The device is gone.
    Disconnect,
    /// The interfaces of the chosen configuration.
    Interfaces(&'a [Interface]),
    /// The bulk endpoints of the chosen configuration, besides endpoint 0.
    Endpoints(&'a [Endpoint]),
    /// Answer to configuration requests.
    Configuration {
        /// Packet answered.
        id: u64,
        /// Value.
        configuration: u8,
    },
    /// Answer to requests for alternate settings.
    AltSetting {
        /// Packet answered.
        id: u64,
        /// How it went.
        status: Status,
        /// Interface.
        interface: u8,
        /// Setting.
        alternate: u8,
    },
    /// Answer to a control transfer.
    Control {
        /// Packet answered.
        id: u64,
        /// How it went.
        status: Status,
        /// The request.
        setup: Setup,
        /// Data from the device.
        data: &'a [u8],
    },
    /// Answer to a bulk transfer.
    Bulk {
        /// Packet answered.
        id: u64,
        /// How it went.
        status: Status,
        /// Endpoint.
        endpoint: u8,
        /// Bytes moved.
        length: usize,
        /// Data from the device.
        data: &'a [u8],
    },
}
