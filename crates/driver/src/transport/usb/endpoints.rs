//! Which endpoints of a device carry the wire, found by its descriptors and by nothing else.
//!
//! The stage's interface has class 0xFF (vendor), subclass 0x47, protocol 0x01, with one bulk endpoint in each direction; numbers of interface,
//! alternate setting and endpoints are the firmware's choice, and other interfaces may lie beside it.

use std::fmt;

/// Class, subclass and protocol of the stage's interface.
pub const STAGE_CLASS: (u8, u8, u8) = (0xFF, 0x47, 0x01);

/// Bit of an endpoint address that says "to the host".
const IN: u8 = 0x80;

/// What a descriptor says of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EndpointFacts {
    /// Address, direction in the top bit.
    pub address: u8,
    /// Bulk transfers.
    pub bulk: bool,
    /// Largest packet, bytes.
    pub packet: u16,
}

/// What a descriptor says of an interface in one of its alternate settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InterfaceFacts {
    /// Number of the interface.
    pub number: u8,
    /// Alternate setting.
    pub setting: u8,
    /// Class, subclass and protocol.
    pub class: (u8, u8, u8),
    /// Its endpoints.
    pub endpoints: Vec<EndpointFacts>,
}

/// Where the wire goes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pipes {
    /// Interface to claim.
    pub interface: u8,
    /// Alternate setting to choose.
    pub setting: u8,
    /// Endpoint to read.
    pub input: EndpointFacts,
    /// Endpoint to write.
    pub output: EndpointFacts,
}

/// Why a device is no stage.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPipes {
    /// No interface of the right class.
    #[error("it has no interface of class ff/47/01 (found {}); is it another device, or are ids and firmware wrong?", Classes(.found))]
    Class {
        /// Classes of its interfaces.
        found: Vec<(u8, u8, u8)>,
    },
    /// The interface lacks a bulk endpoint.
    #[error(
        "its interface {interface} has {inputs} bulk endpoints to the host and {outputs} from it, expected one of each; the firmware's descriptors are wrong"
    )]
    Endpoints {
        /// Number of the interface.
        interface: u8,
        /// Bulk endpoints to the host.
        inputs: usize,
        /// Bulk endpoints from the host.
        outputs: usize,
    },
}

struct Classes<'a>(&'a [(u8, u8, u8)]);

impl fmt::Display for Classes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("none");
        }
        let words: Vec<String> = self.0.iter().map(|(c, s, p)| format!("{c:02x}/{s:02x}/{p:02x}")).collect();
        f.write_str(&words.join(", "))
    }
}

/// Chooses the stage's interface and its endpoints: the first setting that has exactly one bulk endpoint in each direction.
///
/// # Errors
/// [`NoPipes`] with what was found instead.
pub fn choose(interfaces: &[InterfaceFacts]) -> Result<Pipes, NoPipes> {
    let mut wrong = None;
    for interface in interfaces.iter().filter(|i| i.class == STAGE_CLASS) {
        let bulk = |to_host: bool| {
            let fits = move |e: &&EndpointFacts| e.bulk && e.packet > 0 && (e.address & IN != 0) == to_host;
            interface.endpoints.iter().filter(fits).copied().collect::<Vec<_>>()
        };
        match (bulk(true).as_slice(), bulk(false).as_slice()) {
            (&[input], &[output]) => {
                return Ok(Pipes { interface: interface.number, setting: interface.setting, input, output });
            }
            (inputs, outputs) => {
                wrong.get_or_insert(NoPipes::Endpoints {
                    interface: interface.number,
                    inputs: inputs.len(),
                    outputs: outputs.len(),
                });
            }
        }
    }
    Err(wrong.unwrap_or_else(|| NoPipes::Class { found: interfaces.iter().map(|i| i.class).collect() }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn endpoint(address: u8, bulk: bool) -> EndpointFacts {
        EndpointFacts { address, bulk, packet: 512 }
    }

    fn interface(
        number: u8,
        setting: u8,
        class: (u8, u8, u8),
        endpoints: &[EndpointFacts],
    ) -> InterfaceFacts {
        InterfaceFacts { number, setting, class, endpoints: endpoints.to_vec() }
    }

    #[test]
    fn the_stage_is_found_beside_other_interfaces_whatever_its_numbers() {
        let found = choose(&[
            interface(0, 0, (0x03, 1, 1), &[endpoint(0x81, false)]),
            interface(1, 0, (0xFF, 0x47, 0x02), &[endpoint(0x82, true), endpoint(0x02, true)]),
            interface(2, 0, STAGE_CLASS, &[]),
            interface(
                2,
                1,
                STAGE_CLASS,
                &[endpoint(0x05, true), endpoint(0x84, false), endpoint(0x8a, true)],
            ),
        ])
        .expect("a stage");
        assert_eq!((found.interface, found.setting), (2, 1));
        assert_eq!((found.input.address, found.output.address), (0x8a, 0x05));
    }

    #[test]
    fn what_is_no_stage_is_told_with_what_was_found() {
        let error = choose(&[interface(0, 0, (0x0e, 1, 0), &[])]).expect_err("a camera").to_string();
        assert!(error.contains("ff/47/01") && error.contains("0e/01/00"), "{error}");
        assert!(choose(&[]).expect_err("nothing").to_string().contains("none"));
        let one_way = [endpoint(0x81, true), endpoint(0x82, true), endpoint(0x03, false)];
        let error = choose(&[interface(4, 0, STAGE_CLASS, &one_way)]).expect_err("one way only");
        assert_eq!(error, NoPipes::Endpoints { interface: 4, inputs: 2, outputs: 0 });
        let empty = EndpointFacts { packet: 0, ..endpoint(0x81, true) };
        assert!(choose(&[interface(0, 0, STAGE_CLASS, &[empty, endpoint(1, true)])]).is_err());
    }
}
