//! Damaged frames into the decoder: none may come out as something that was never sent.
//!
//! Half of them are random bytes, half are real frames with a burst in them. Of the random ones, half are anything without a zero, which COBS
//! mostly refuses, and half are random packets in sound COBS, so that the CRC is what stands between them and the receiver. A burst begins at
//! a random bit of the encoded frame, terminator included, is 1 to 128 bits long, and flips its first and last bit and each between with even
//! chance. Every frame is followed by a zero, so that none hides in its neighbour.

use std::time::Instant;

use gonio_protocol::PROTOCOL_VERSION;
use gonio_protocol::frame::{
    Body, Decoder, Encoded, FrameError, HEADER_LEN, Header, Kind, MAX_BODY, MAX_ENCODED, Packet, encode,
    encode_hello,
};
use gonio_protocol::hello::{Hello, Role, Serial, Version};
use gonio_protocol::link::{Link, Received};
use gonio_protocol::message::{
    Axis, Command, Fault, Outcome, Position, Reason, Reply, SensorReadings, Status, Telemetry, ToDevice,
    ToHost, to_body,
};
use std::time::Duration;

use super::dice::Dice;
use super::{Figure, Settings, grouped};

/// Frames that were damaged for the promise.
const FULL: u64 = 1_000_000_000;
/// Real frames to damage.
const REAL: usize = 512;
/// Session of the real frames.
const SESSION: u32 = 0x600d_1dea;

/// Fate of damaged frames, by the check that stopped them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Tally {
    frames: u64,
    too_long: u64,
    cobs: u64,
    length: u64,
    crc: u64,
    version: u64,
    kind: u64,
    /// Passed the decoder although they are not what was sent.
    passed: u64,
    /// Of these, such as a receiver of the session under way would take.
    delivered: u64,
    /// Came out as they were sent: the damage lay outside of what counts.
    unharmed: u64,
}

impl Tally {
    fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        self.too_long += other.too_long;
        self.cobs += other.cobs;
        self.length += other.length;
        self.crc += other.crc;
        self.version += other.version;
        self.kind += other.kind;
        self.passed += other.passed;
        self.delivered += other.delivered;
        self.unharmed += other.unharmed;
    }

    fn take(&mut self, result: &Result<Packet, FrameError>, sent: Option<&Packet>) {
        match result {
            Err(FrameError::TooLong) => self.too_long += 1,
            Err(FrameError::Cobs) => self.cobs += 1,
            Err(FrameError::Length { .. }) => self.length += 1,
            Err(FrameError::Crc { .. }) => self.crc += 1,
            Err(FrameError::Version { .. }) => self.version += 1,
            Err(FrameError::Kind { .. }) => self.kind += 1,
            Ok(packet) if Some(packet) == sent => self.unharmed += 1,
            Ok(packet) => {
                self.passed += 1;
                self.delivered += u64::from(match packet {
                    Packet::Hello(_) => true,
                    Packet::Frame(header, _) => header.session == SESSION,
                });
            }
        }
    }
}

/// Runs the campaign.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let frames = settings.count(FULL, 10_000);
    let start = Instant::now();
    let tally = all(settings, frames);
    let seconds = start.elapsed().as_secs_f64();
    let foreign = foreign_sessions(settings, (frames / 100).max(1000));
    let size = format!("{} frames", grouped(tally.frames));
    let reached = tally.crc + tally.version + tally.kind + tally.passed + tally.unharmed;
    vec![
        Figure::exactly("damaged frames delivered changed", tally.delivered, 0, &size),
        Figure::exactly("damaged frames that pass the decoder changed", tally.passed, 0, &size),
        Figure::told(
            "stopped by length, by COBS, by the CRC",
            format!(
                "{}, {}, {}",
                grouped(tally.too_long + tally.length),
                grouped(tally.cobs),
                grouped(tally.crc)
            ),
            &size,
        ),
        Figure::told(
            "the CRC's share: of those that reached it, one in 2^32 may pass; expected here",
            format!("{:.3}", reached as f64 / 4_294_967_296.0),
            &format!("{} frames", grouped(reached)),
        ),
        Figure::exactly(
            "the session id's share: sound frames of other sessions, and with a forged CRC, taken",
            foreign.taken,
            0,
            &format!("{} frames", grouped(foreign.frames)),
        ),
        Figure::told(
            "of random packets with a forged CRC, stopped by version or kind",
            format!("{:.4} %", 100.0 * foreign.stopped_earlier as f64 / foreign.forged as f64),
            &format!("{} frames", grouped(foreign.forged)),
        ),
        Figure::told("damaged so that nothing changed", grouped(tally.unharmed), &size),
        Figure::told("rate", format!("{:.2} million frames/s", frames as f64 / seconds / 1e6), &size),
    ]
}

fn all(settings: &Settings, frames: u64) -> Tally {
    let threads = settings.threads.max(1) as u64;
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|n| {
                let share = frames / threads + u64::from(n < frames % threads);
                let mut dice = Dice::new(settings.seed, n);
                scope.spawn(move || damage(&mut dice, share))
            })
            .collect();
        let mut sum = Tally::default();
        for worker in workers {
            sum.add(&worker.join().expect("no frame makes the decoder panic"));
        }
        sum
    })
}

fn damage(dice: &mut Dice, frames: u64) -> Tally {
    let real: Vec<(Encoded, Packet)> = (0..REAL).map(|_| real_frame(dice)).collect();
    let mut decoder = Decoder::new();
    let mut tally = Tally { frames, ..Tally::default() };
    let mut bytes = [0u8; MAX_ENCODED + 1];
    for n in 0..frames {
        let (length, sent) = match n % 4 {
            0 => (random_bytes(dice, &mut bytes), None),
            1 => (random_packet(dice, &mut bytes), None),
            _ => {
                let (encoded, packet) = &real[dice.below(REAL)];
                (burst(dice, encoded.as_slice(), &mut bytes), Some(packet))
            }
        };
        for &byte in &bytes[..length] {
            if let Some(result) = decoder.push(byte) {
                tally.take(&result, sent);
            }
        }
        if let Some(result) = decoder.push(0) {
            tally.take(&result, sent);
        }
    }
    tally
}

/// Anything without a zero.
fn random_bytes(dice: &mut Dice, out: &mut [u8]) -> usize {
    let length = 1 + dice.below(MAX_ENCODED);
    let bytes = &mut out[..length];
    dice.fill(bytes);
    for byte in bytes {
        *byte = (*byte).max(1);
    }
    length
}

/// A random packet in sound COBS, without its zero.
fn random_packet(dice: &mut Dice, out: &mut [u8]) -> usize {
    let mut packet = [0u8; HEADER_LEN + MAX_BODY + 4];
    let length = 4 + dice.below(packet.len() - 3);
    dice.fill(&mut packet[..length]);
    stuff(&packet[..length], out)
}

/// A real frame with a burst in it, its zero included.
fn burst(dice: &mut Dice, frame: &[u8], out: &mut [u8]) -> usize {
    let length = frame.len();
    out[..length].copy_from_slice(frame);
    let bits = length * 8;
    let first = dice.below(bits);
    let last = (first + dice.below(128)).min(bits - 1);
    let (mut random, mut left) = (0u64, 0);
    for bit in first..=last {
        if left == 0 {
            (random, left) = (dice.next_u64(), 64);
        }
        if bit == first || bit == last || random & 1 == 1 {
            out[bit / 8] ^= 1 << (bit % 8);
        }
        random >>= 1;
        left -= 1;
    }
    length
}

/// COBS without the terminator, for packets that no encoder would make. At most 253 bytes.
fn stuff(packet: &[u8], out: &mut [u8]) -> usize {
    let (mut code_at, mut at, mut code) = (0, 1, 1u8);
    for &byte in packet {
        if byte == 0 {
            out[code_at] = code;
            (code_at, code) = (at, 1);
        } else {
            out[at] = byte;
            code += 1;
        }
        at += 1;
    }
    out[code_at] = code;
    at
}

/// What the two ends really say, with numbers of all sizes.
fn real_frame(dice: &mut Dice) -> (Encoded, Packet) {
    let n = dice.next_u64();
    let number = (n >> (n & 31)) as u32;
    let signed = (dice.next_u64() >> dice.below(40)) as i32;
    let position = Position { tilt_udeg: signed, spin_udeg: -signed };
    let status =
        Status { boot: number, uptime_ms: n as u32, position, homed: n & 1 == 1, ..Status::default() };
    let down = |message: ToDevice| to_body(&message).expect("fits");
    let up = |message: ToHost| to_body(&message).expect("fits");
    let reply = |reply| up(ToHost::Reply { id: number, reply });
    let (kind, body) = match dice.below(16) {
        0 => (Kind::Ack, Body::EMPTY),
        1 | 2 => (Kind::Datagram, down(ToDevice::Heartbeat { counter: number })),
        3 => (Kind::Datagram, down(ToDevice::EmergencyStop { id: number })),
        4 => (Kind::Data, down(ToDevice::Command { id: number, command: Command::Home })),
        5 | 6 => {
            let command = Command::Move {
                tilt_udeg: signed,
                spin_udeg: -signed,
                speed_udeg_s: number,
                accel_udeg_s2: number,
            };
            (Kind::Data, down(ToDevice::Command { id: number, command }))
        }
        7 => (
            Kind::Data,
            down(ToDevice::Command { id: number, command: Command::Shutter { open: n & 2 == 2 } }),
        ),
        8 => (Kind::Data, reply(Reply::Accepted)),
        9 => (Kind::Data, reply(Reply::Done(Outcome::At(position)))),
        10 => (Kind::Data, reply(Reply::Done(Outcome::Status(status)))),
        11 => (Kind::Data, reply(Reply::Rejected(Reason::FaultLatched(Fault::Stall { axis: Axis::Spin })))),
        12 => {
            let readings =
                SensorReadings { lamp_monitor_ppm: number, lamp_mc: signed, ..SensorReadings::default() };
            (Kind::Data, reply(Reply::Done(Outcome::Sensors(readings))))
        }
        13 => {
            let hello = Hello {
                role: Role::Answer,
                protocol: PROTOCOL_VERSION,
                window: 8,
                schema: n,
                version: Version { major: 1, minor: 2, patch: 3 },
                boot: number,
                session: SESSION,
                client: n as u32,
                serial: Serial::new("CAMPAIGN"),
            };
            return (encode_hello(&hello), Packet::Hello(hello));
        }
        _ => (Kind::Datagram, up(ToHost::Telemetry(Telemetry { counter: number, status }))),
    };
    let seq = if kind == Kind::Data { n as u16 } else { 0 };
    let header = Header { kind, session: SESSION, seq, ack: (n >> 16) as u16 };
    (encode(&header, &body), Packet::Frame(header, body))
}

/// What the session id keeps out.
struct Foreign {
    frames: u64,
    forged: u64,
    stopped_earlier: u64,
    taken: u64,
}

/// Frames whose CRC holds and that are not for this session: real ones of other sessions, and random packets with a CRC forged to fit.
fn foreign_sessions(settings: &Settings, frames: u64) -> Foreign {
    let mut dice = Dice::new(settings.seed, u64::MAX);
    let mut link = Link::new();
    link.open(SESSION, 8);
    let mut found = Foreign { frames: 0, forged: 0, stopped_earlier: 0, taken: 0 };
    for n in 0..frames {
        let mut packet = [0u8; HEADER_LEN + MAX_BODY + 4];
        let mut bytes = [0u8; MAX_ENCODED + 1];
        let length = if n % 2 == 0 {
            let length = HEADER_LEN + dice.below(MAX_BODY + 1);
            dice.fill(&mut packet[..length]);
            length
        } else {
            let session = (dice.next_u64() as u32 ^ SESSION).max(1) ^ SESSION;
            let (seq, ack) = (dice.next_u64() as u16, dice.next_u64() as u16);
            packet[..2].copy_from_slice(&[PROTOCOL_VERSION, (dice.next_u64() % 3) as u8]);
            packet[2..6].copy_from_slice(&session.to_le_bytes());
            packet[6..8].copy_from_slice(&seq.to_le_bytes());
            packet[8..10].copy_from_slice(&ack.to_le_bytes());
            HEADER_LEN
        };
        let crc = crc32(&packet[..length]);
        packet[length..length + 4].copy_from_slice(&crc.to_le_bytes());
        let end = stuff(&packet[..length + 4], &mut bytes);
        found.frames += 1;
        found.forged += u64::from(n % 2 == 0);
        let mut input = &bytes[..=end];
        bytes_into(&mut link, &mut input, n % 2 == 0, &mut found);
    }
    found
}

fn bytes_into(link: &mut Link, input: &mut &[u8], forged: bool, found: &mut Foreign) {
    while let Some(received) = link.receive(Duration::ZERO, input) {
        match received {
            Received::Data(_) | Received::Datagram(_) => found.taken += 1,
            Received::Damaged(_) if forged => found.stopped_earlier += 1,
            // a hello begins nothing by itself; a foreign frame is told as such
            Received::Hello(_) | Received::Foreign { .. } | Received::Damaged(_) => {}
        }
    }
}

/// CRC-32 of Ethernet, bit by bit: not the table of the code under test.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}
