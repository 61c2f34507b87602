//! Laws of the byte layer: whatever is encoded comes back, one flipped bit never passes, and no bytes whatever make a
//! receiver panic or allocate.

use gonio_protocol::device::{Device, Identity};
use gonio_protocol::frame::{Body, Decoder, FrameError, Header, Kind, MAX_BODY, Packet, encode};
use gonio_protocol::hello::{HELLO_LEN, Hello, MAGIC, Serial, Version};
use gonio_protocol::host::Host;
use gonio_protocol::message::{MessageError, ToDevice, ToHost, from_body, to_body};
use proptest::collection::vec;
use proptest::prelude::*;
use std::time::Duration;

fn header() -> impl Strategy<Value = Header> {
    let kind = prop_oneof![Just(Kind::Data), Just(Kind::Ack), Just(Kind::Datagram)];
    (kind, any::<u32>(), any::<u16>(), any::<u16>()).prop_map(|(kind, session, seq, ack)| Header {
        kind,
        session,
        seq,
        ack,
    })
}

/// Bodies rich in zeros and 0xff, where COBS has its edges.
fn body() -> impl Strategy<Value = Body> {
    let byte = prop_oneof![Just(0u8), Just(0xffu8), any::<u8>()];
    vec(byte, 0..=MAX_BODY).prop_map(|bytes| Body::new(&bytes).expect("not too long"))
}

fn decode(bytes: &[u8]) -> Vec<Result<Packet, FrameError>> {
    let mut decoder = Decoder::new();
    bytes.iter().filter_map(|&byte| decoder.push(byte)).collect()
}

proptest! {
    #[test]
    fn what_is_encoded_comes_back(header in header(), body in body()) {
        let encoded = encode(&header, &body);
        prop_assert_eq!(encoded.as_slice().iter().filter(|&&b| b == 0).count(), 1);
        prop_assert_eq!(decode(encoded.as_slice()), vec![Ok(Packet::Frame(header, body))]);
    }

    #[test]
    fn one_flipped_bit_never_passes(header in header(), body in body()) {
        let encoded = encode(&header, &body);
        for bit in 0..encoded.as_slice().len() * 8 {
            let mut bytes = encoded.as_slice().to_vec();
            bytes[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(decode(&bytes).iter().all(Result::is_err), "bit {}", bit);
        }
    }

    #[test]
    fn a_frame_after_rubbish_and_a_zero_is_read(rubbish in vec(any::<u8>(), 0..400), header in header(), body in body()) {
        let mut bytes = rubbish;
        bytes.push(0);
        bytes.extend_from_slice(encode(&header, &body).as_slice());
        prop_assert_eq!(decode(&bytes).pop(), Some(Ok(Packet::Frame(header, body))));
    }

    #[test]
    fn no_bytes_whatever_make_a_receiver_panic(soup in vec(prop_oneof![Just(0u8), any::<u8>()], 0..2000)) {
        let identity = Identity::new(Version::default(), 1, Serial::default());
        let (mut host, mut device) = (Host::new(1, 1, Version::default()), Device::new(identity));
        let mut input = soup.as_slice();
        prop_assert!(host.receive(Duration::ZERO, &mut input).is_none());
        let mut input = soup.as_slice();
        prop_assert!(device.receive(Duration::ZERO, &mut input).is_none());
    }

    #[test]
    fn any_body_is_a_message_or_an_error(body in body()) {
        // Whatever decodes must encode to something that decodes to the same.
        if let Ok(message) = from_body::<ToDevice>(&body) {
            prop_assert_eq!(from_body(&to_body(&message).expect("fits")), Ok(message));
        }
        if let Ok(message) = from_body::<ToHost>(&body) {
            prop_assert_eq!(from_body(&to_body(&message).expect("fits")), Ok(message));
        }
    }

    #[test]
    fn a_hello_survives_its_bytes(mut bytes in vec(any::<u8>(), HELLO_LEN)) {
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4] %= 3;
        let bytes: [u8; HELLO_LEN] = bytes.try_into().expect("fifty");
        prop_assert_eq!(Hello::from_bytes(&bytes).expect("a hello").to_bytes(), bytes);
    }
}

#[test]
fn bytes_after_a_message_are_refused() {
    let body = to_body(&ToDevice::Heartbeat { counter: 1 }).expect("fits");
    let mut bytes = body.as_slice().to_vec();
    bytes.push(0);
    let long = Body::new(&bytes).expect("fits");
    assert_eq!(from_body::<ToDevice>(&long), Err(MessageError::Trailing { bytes: 1 }));
}

#[test]
fn a_stream_without_end_is_cut_and_the_next_frame_read() {
    let mut bytes = vec![1u8; 100_000];
    bytes.push(0);
    let header = Header { kind: Kind::Ack, session: 1, seq: 0, ack: 0 };
    bytes.extend_from_slice(encode(&header, &Body::EMPTY).as_slice());
    assert_eq!(decode(&bytes), [Err(FrameError::TooLong), Ok(Packet::Frame(header, Body::EMPTY))]);
}

#[test]
fn silence_makes_a_host_ask_again_and_never_more_often_than_it_says() {
    let mut host = Host::new(1, 5, Version::default());
    let asked = (0..1000).filter(|ms| host.poll_transmit(Duration::from_millis(*ms)).is_some()).count();
    assert_eq!(asked, 10);
}
