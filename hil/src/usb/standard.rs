//! The standard requests of chapter 9 that reach a device behind usbredir.
//!
//! Choosing configuration and alternate settings travel as packets of their own; SET_ADDRESS stays with the host controller.

use super::{Descriptors, Stalled};
use crate::redir::Setup;

const GET_STATUS: u8 = 0;
const CLEAR_FEATURE: u8 = 1;
const SET_FEATURE: u8 = 3;
const GET_DESCRIPTOR: u8 = 6;
const ENDPOINT_HALT: u16 = 0;

/// What a standard request asks of the port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Standard {
    /// Answer with this.
    Answer(Vec<u8>),
    /// Clear the halt of this endpoint.
    ClearHalt(u8),
    /// Say whether this endpoint is halted.
    IsHalted(u8),
}

/// The answer to a standard request; `None` if it is a class's or vendor's.
pub fn handle(d: &Descriptors, setup: Setup) -> Option<Result<Standard, Stalled>> {
    if setup.request_type & 0x60 != 0 {
        return None;
    }
    let recipient = setup.request_type & 0x1f;
    Some(match (setup.request, recipient) {
        (GET_DESCRIPTOR, 0) => match d.find(setup.value) {
            Some(mut bytes) => {
                bytes.truncate(usize::from(setup.length));
                Ok(Standard::Answer(bytes))
            }
            None => Err(Stalled),
        },
        (GET_STATUS, 2) => Ok(Standard::IsHalted(setup.index as u8)),
        (GET_STATUS, _) => Ok(Standard::Answer(vec![0, 0])),
        (CLEAR_FEATURE, 2) if setup.value == ENDPOINT_HALT => Ok(Standard::ClearHalt(setup.index as u8)),
        (CLEAR_FEATURE | SET_FEATURE, 0) => Ok(Standard::Answer(vec![])),
        _ => Err(Stalled),
    })
}
