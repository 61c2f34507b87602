//! A port without QEMU: the guest's side of usbredir is played here, byte by byte, with 32-bit ids.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

use super::{Descriptors, Fault, Function, Port, Slot, Stalled};
use crate::redir::Setup;

const OUT: u8 = 0x02;
const IN: u8 = 0x83;
const STALL: u8 = 4;

/// Gives back what it gets.
struct Echo {
    descriptors: Descriptors,
    kept: Vec<u8>,
}

impl Function for Echo {
    fn descriptors(&self) -> &Descriptors {
        &self.descriptors
    }

    fn control(&mut self, _setup: Setup, _data: &[u8]) -> Result<Vec<u8>, Stalled> {
        Err(Stalled)
    }

    fn bulk_out(&mut self, _endpoint: u8, data: &[u8]) {
        self.kept.extend_from_slice(data);
    }

    fn bulk_in(&mut self, _endpoint: u8, length: usize) -> Option<Vec<u8>> {
        let n = self.kept.len().min(length);
        (n > 0).then(|| self.kept.drain(..n).collect())
    }

    fn halt_cleared(&mut self, _endpoint: u8) {}

    fn reset(&mut self) {
        self.kept.clear();
    }
}

struct Guest(UnixStream);

impl Guest {
    /// Type, id and body of the next packet.
    fn next(&mut self) -> (u32, u32, Vec<u8>) {
        let mut header = [0; 12];
        self.0.read_exact(&mut header).expect("a header");
        let number = |at: usize| u32::from_le_bytes(header[at..at + 4].try_into().expect("four bytes"));
        let mut body = vec![0; number(4) as usize];
        self.0.read_exact(&mut body).expect("a body");
        (number(0), number(8), body)
    }

    fn say(&mut self, kind: u32, id: u32, body: &[u8]) {
        let mut bytes = Vec::new();
        for number in [kind, body.len() as u32, id] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend_from_slice(body);
        self.0.write_all(&bytes).expect("taken");
    }

    fn write(&mut self, id: u32, data: &[u8]) {
        let mut body = vec![OUT, 0, data.len() as u8, 0, 0, 0, 0, 0];
        body.extend_from_slice(data);
        self.say(101, id, &body);
    }

    fn read(&mut self, id: u32) {
        self.say(101, id, &[IN, 0, 64, 0, 0, 0, 0, 0]);
    }
}

/// A plugged-in echo and the guest that has seen it come.
fn plugged() -> (Port, Guest, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s");
    let listener = UnixListener::bind(&path).expect("listens");
    let descriptors = Descriptors::new([0; 3], 9, ["m", "p", "s"]).interface(0, [255, 0, 0], &[], &[OUT, IN]);
    let port =
        Slot::default().run(&path, "echo", Box::new(Echo { descriptors, kept: vec![] })).expect("runs");
    let (stream, _) = listener.accept().expect("comes");
    stream.set_read_timeout(Some(Duration::from_secs(10))).expect("set");
    let mut guest = Guest(stream);
    assert_eq!(guest.next().0, 0, "a hello");
    guest.say(0, 0, &[0; 68]);
    port.plug(true);
    assert_eq!([guest.next().0, guest.next().0, guest.next().0], [4, 5, 1], "interfaces, endpoints, connect");
    (port, guest, folder)
}

#[test]
fn a_read_waits_for_bytes_and_a_cancelled_one_is_answered_as_such() {
    let (_port, mut guest, _folder) = plugged();
    guest.read(7);
    guest.read(8);
    guest.say(21, 7, &[]);
    let (kind, id, body) = guest.next();
    assert_eq!((kind, id, body[1]), (101, 7, 1), "cancelled");
    guest.write(9, b"abc");
    assert_eq!(guest.next().1, 9);
    let (_, id, body) = guest.next();
    assert_eq!((id, &body[8..]), (8, &b"abc"[..]));
}

#[test]
fn a_halt_holds_until_the_host_clears_it() {
    let (port, mut guest, _folder) = plugged();
    port.fault(Fault::Halt(IN));
    guest.read(1);
    let (_, id, body) = guest.next();
    assert_eq!((id, body[1]), (1, STALL));
    assert!(!port.healed());
    // CLEAR_FEATURE(ENDPOINT_HALT) of the endpoint
    guest.say(100, 2, &[0, 1, 2, 0, 0, 0, IN, 0, 0, 0]);
    assert_eq!(guest.next().1, 2);
    assert!(port.healed());
    guest.write(3, b"x");
    assert_eq!(guest.next().1, 3);
    guest.read(4);
    assert_eq!(guest.next().2[8..], *b"x");
}

#[test]
fn a_silent_device_takes_nothing_and_speaks_again() {
    let (port, mut guest, _folder) = plugged();
    guest.write(1, b"x");
    assert_eq!(guest.next().1, 1);
    port.fault(Fault::Silent(true));
    guest.read(2);
    guest.write(3, b"y");
    // control requests are answered all the same: GET_STATUS
    guest.say(100, 4, &[0x80, 0, 0x80, 0, 0, 0, 0, 0, 2, 0]);
    assert_eq!(guest.next().1, 4);
    port.fault(Fault::Silent(false));
    let (_, id, body) = guest.next();
    assert_eq!((id, &body[8..]), (2, &b"x"[..]));
    assert_eq!(guest.next().1, 3, "and the write is taken now");
}

#[test]
fn a_pulled_plug_forgets_what_was_under_way() {
    let (port, mut guest, _folder) = plugged();
    guest.write(1, b"x");
    assert_eq!(guest.next().1, 1);
    port.plug(false);
    assert_eq!(guest.next().0, 2, "disconnect");
    port.plug(true);
    assert_eq!([guest.next().0, guest.next().0, guest.next().0], [4, 5, 1]);
    guest.read(5);
    guest.write(6, b"z");
    assert_eq!(guest.next().1, 6);
    assert_eq!(guest.next().2[8..], *b"z", "not the byte from before");
}

#[test]
fn an_unknown_request_is_refused() {
    let (_port, mut guest, _folder) = plugged();
    guest.say(100, 1, &[0x80, 0x77, 0xc0, 0, 0, 0, 0, 0, 2, 0]);
    let (_, id, body) = guest.next();
    assert_eq!((id, body[3]), (1, STALL));
}
