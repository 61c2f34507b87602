//! Golden frames and the schema hash: what is on the wire may not change by accident.
//!
//! `GONIO_BLESS=1 cargo test -p gonio-protocol --test golden` writes the vectors anew; a change to them is a change of
//! the protocol and needs a new version.

use gonio_protocol::frame::{Decoder, FrameError, Header, Kind, MAX_BODY, Packet, encode, encode_hello};
use gonio_protocol::hello::{Hello, Role, Serial, Version};
use gonio_protocol::message::{
    Axis, Command, Fault, Motion, Outcome, Position, Reason, Reply, SensorReadings, Status, Telemetry,
    ToDevice, ToHost, from_body, to_body,
};
use gonio_protocol::{PROTOCOL_VERSION, SCHEMA_HASH};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn spec() -> String {
    std::fs::read_to_string(root().join("SPEC.md")).expect("SPEC.md stands beside the crate")
}

#[test]
fn the_schema_hash_is_that_of_the_block_in_the_spec() {
    let spec = spec();
    let (_, rest) = spec.split_once("```schema\n").expect("a schema block");
    let (block, _) = rest.split_once("```").expect("its end");
    let hash = block
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01B3));
    assert_eq!(SCHEMA_HASH, hash, "the block hashes to 0x{hash:016X}");
    assert!(spec.contains(&format!("0x{hash:016X}")), "SPEC.md must name 0x{hash:016X}");
}

struct Vector {
    name: &'static str,
    text: String,
    bytes: Vec<u8>,
}

const STATUS: Status = Status {
    boot: 7,
    uptime_ms: 123_456,
    homed: true,
    motion: Motion::Moving,
    position: Position { tilt_udeg: -1_999_999, spin_udeg: 2_147_483_647 },
    shutter_open: true,
    lamp_on: true,
    lamp_warm: false,
    lamp_level_ppm: 1_000_000,
    interlock_closed: true,
    fault: Some(Fault::OverTemperature { temperature_mc: -40 }),
    triggers: 4_294_967_295,
};

fn to_device() -> Vec<(&'static str, ToDevice)> {
    let command = |id, command| ToDevice::Command { id, command };
    vec![
        ("home", command(1, Command::Home)),
        (
            "move",
            command(
                300,
                Command::Move {
                    tilt_udeg: 45_000_000,
                    spin_udeg: -90_000_001,
                    speed_udeg_s: 20_000_000,
                    accel_udeg_s2: 40_000_000,
                },
            ),
        ),
        (
            "move-extreme",
            command(
                u32::MAX,
                Command::Move {
                    tilt_udeg: i32::MIN,
                    spin_udeg: i32::MAX,
                    speed_udeg_s: u32::MAX,
                    accel_udeg_s2: 0,
                },
            ),
        ),
        ("stop", command(2, Command::Stop)),
        ("shutter-open", command(3, Command::Shutter { open: true })),
        ("shutter-close", command(4, Command::Shutter { open: false })),
        ("lamp", command(5, Command::Lamp { on: true, level_ppm: 750_000 })),
        ("sensors", command(6, Command::Sensors)),
        ("camera-trigger", command(7, Command::CameraTrigger { exposure_us: 20_000 })),
        ("status", command(8, Command::Status)),
        ("rearm", command(9, Command::Rearm)),
        ("heartbeat", ToDevice::Heartbeat { counter: 128 }),
        ("emergency-stop", ToDevice::EmergencyStop { id: 1 }),
    ]
}

fn to_host() -> Vec<(&'static str, ToHost)> {
    let reply = |id, reply| ToHost::Reply { id, reply };
    let readings = SensorReadings {
        lamp_monitor_ppm: 999_983,
        lamp_mc: 41_500,
        ambient_mc: -250,
        sample_height_um: -12,
        interlock_closed: true,
    };
    let limits = Reason::OutsideLimits { axis: Axis::Tilt, min_udeg: -2_000_000, max_udeg: 87_000_000 };
    let rate = Reason::Rate { max_speed_udeg_s: 60_000_000, max_accel_udeg_s2: 200_000_000 };
    vec![
        ("accepted", reply(300, Reply::Accepted)),
        ("done-nothing", reply(3, Reply::Done(Outcome::Nothing))),
        (
            "done-at",
            reply(300, Reply::Done(Outcome::At(Position { tilt_udeg: 45_000_000, spin_udeg: -90_000_001 }))),
        ),
        ("done-sensors", reply(6, Reply::Done(Outcome::Sensors(readings)))),
        ("done-status", reply(8, Reply::Done(Outcome::Status(STATUS)))),
        ("done-triggered", reply(7, Reply::Done(Outcome::Triggered { count: 1 }))),
        (
            "rejected-fault",
            reply(1, Reply::Rejected(Reason::FaultLatched(Fault::Stall { axis: Axis::Spin }))),
        ),
        ("rejected-not-homed", reply(1, Reply::Rejected(Reason::NotHomed))),
        ("rejected-busy", reply(1, Reply::Rejected(Reason::Busy))),
        ("rejected-limits", reply(1, Reply::Rejected(limits))),
        ("rejected-rate", reply(1, Reply::Rejected(rate))),
        ("rejected-level", reply(1, Reply::Rejected(Reason::Level))),
        ("rejected-interlock", reply(1, Reply::Rejected(Reason::InterlockOpen))),
        ("rejected-forgotten", reply(1, Reply::Rejected(Reason::Forgotten))),
        ("rejected-persists", reply(1, Reply::Rejected(Reason::FaultPersists(Fault::InterlockOpen)))),
        ("aborted", reply(300, Reply::Aborted(None))),
        ("aborted-fault", reply(300, Reply::Aborted(Some(Fault::LeaseExpired)))),
        ("fault", ToHost::Fault { fault: Fault::EmergencyStop, uptime_ms: 1_000 }),
        ("telemetry", ToHost::Telemetry(Telemetry { counter: 128, status: Status::default() })),
        ("emergency-stopped", ToHost::EmergencyStopped { id: 1 }),
    ]
}

fn framed<T: Serialize + std::fmt::Debug>(
    name: &'static str,
    seq: u16,
    datagram: bool,
    message: &T,
) -> Vector {
    let kind = if datagram { Kind::Datagram } else { Kind::Data };
    let header = Header { kind, session: 0x1234_5600, seq: if datagram { 0 } else { seq }, ack: 0xfffe };
    let body = to_body(message).expect("every message fits");
    Vector {
        name,
        text: format!("{} {message:?}", head_text(&header)),
        bytes: encode(&header, &body).as_slice().to_vec(),
    }
}

fn head_text(header: &Header) -> String {
    format!("{:?} session={} seq={} ack={}", header.kind, header.session, header.seq, header.ack)
}

fn hello_text(h: &Hello) -> String {
    format!(
        "{:?} protocol={} window={} schema={:016x} version={} boot={} session={} client={} serial={}",
        h.role,
        h.protocol,
        h.window,
        h.schema,
        h.version,
        h.boot,
        h.session,
        h.client,
        h.serial.as_str()
    )
}

fn vectors() -> Vec<Vector> {
    let hello = |role, boot, session, client, serial| Hello {
        role,
        protocol: PROTOCOL_VERSION,
        window: 8,
        schema: SCHEMA_HASH,
        version: Version { major: 1, minor: 2, patch: 300 },
        boot,
        session,
        client,
        serial: Serial::new(serial),
    };
    let mut out: Vec<Vector> = [
        ("hello-ask", hello(Role::Ask, 0, 0x1234_5600, 0xdead_beef, "")),
        ("hello-answer", hello(Role::Answer, 7, 0x1234_5600, 0xdead_beef, "GONIO-0001")),
        ("hello-announce", hello(Role::Announce, 8, 0, 0, "SIXTEEN-LETTERS!")),
    ]
    .into_iter()
    .map(|(name, h)| Vector { name, text: hello_text(&h), bytes: encode_hello(&h).as_slice().to_vec() })
    .collect();
    let ack = Header { kind: Kind::Ack, session: 1, seq: 0, ack: 5 };
    out.push(Vector {
        name: "ack",
        text: head_text(&ack),
        bytes: encode(&ack, &gonio_protocol::frame::Body::EMPTY).as_slice().to_vec(),
    });
    for (seq, (name, message)) in (0u16..).zip(to_device()) {
        out.push(framed(name, seq, !matches!(message, ToDevice::Command { .. }), &message));
    }
    for (seq, (name, message)) in (250u16..).zip(to_host()) {
        let datagram = matches!(message, ToHost::Telemetry(_) | ToHost::EmergencyStopped { .. });
        out.push(framed(name, seq, datagram, &message));
    }
    out
}

/// `name`, what it says, and the bytes in hexadecimal; one line each, a blank line between vectors. Frames to the
/// device and to the host are told apart by a prefix, because bodies do not say it.
fn written(vectors: &[Vector]) -> String {
    let devices: Vec<&str> = to_device().iter().map(|(name, _)| *name).collect();
    let mut out = String::new();
    for v in vectors {
        let way = if devices.contains(&v.name) || v.name == "hello-ask" { "device" } else { "host" };
        let hex: String = v.bytes.iter().fold(String::new(), |mut hex, b| {
            let _ = write!(hex, "{b:02x}");
            hex
        });
        let _ = writeln!(out, "name {}\nto {way}\nsays {}\nbytes {hex}\n", v.name, v.text);
    }
    out
}

fn vector_file() -> PathBuf {
    root().join("vectors/frames.txt")
}

#[test]
fn golden_frames_are_written_byte_for_byte() {
    let now = written(&vectors());
    if std::env::var_os("GONIO_BLESS").is_some() {
        std::fs::write(vector_file(), &now).expect("vectors can be written");
    }
    let golden = std::fs::read_to_string(vector_file()).expect("vectors/frames.txt");
    assert_eq!(golden, now);
}

#[test]
fn golden_frames_are_read_back_to_what_they_say() {
    for v in vectors() {
        let mut decoder = Decoder::new();
        let packets: Vec<_> = v.bytes.iter().filter_map(|&b| decoder.push(b)).collect();
        let [Ok(packet)] = packets.as_slice() else { panic!("{}: {packets:?}", v.name) };
        let text = match packet {
            Packet::Hello(h) => hello_text(h),
            Packet::Frame(header, _) if header.kind == Kind::Ack => head_text(header),
            Packet::Frame(header, body) => {
                let down = to_device().iter().any(|(name, _)| *name == v.name);
                let message = if down {
                    from_body::<ToDevice>(body).map(|m| format!("{m:?}"))
                } else {
                    from_body::<ToHost>(body).map(|m| format!("{m:?}"))
                };
                format!("{} {}", head_text(header), message.expect("a message"))
            }
        };
        assert_eq!(text, v.text, "{}", v.name);
    }
}

#[test]
fn the_longest_message_fits_in_a_body() {
    let status = Status {
        boot: u32::MAX,
        uptime_ms: u32::MAX,
        position: Position { tilt_udeg: i32::MIN, spin_udeg: i32::MIN },
        lamp_level_ppm: u32::MAX,
        fault: Some(Fault::OverTemperature { temperature_mc: i32::MIN }),
        triggers: u32::MAX,
        ..Status::default()
    };
    let longest = ToHost::Reply { id: u32::MAX, reply: Reply::Done(Outcome::Status(status)) };
    assert!(to_body(&longest).expect("fits").as_slice().len() <= MAX_BODY / 2, "room to grow");
}

/// The C decoder was written from SPEC.md alone; it must read every golden frame as this crate does, and refuse
/// every frame with one bit flipped.
#[test]
fn a_c_decoder_reads_the_golden_frames() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let program = folder.join("gonio_wire_print");
    let built = Process::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-o"])
        .arg(&program)
        .args([root().join("c/gonio_wire.c"), root().join("c/print.c")])
        .output()
        .expect("a C compiler called cc (package build-essential)");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let print = |lines: &str| -> Vec<String> {
        use std::io::Write as _;
        let mut child = Process::new(&program)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut stdin = child.stdin.take().expect("piped");
        let lines = lines.to_owned();
        let writer = std::thread::spawn(move || stdin.write_all(lines.as_bytes()));
        let out = child.wait_with_output().expect("it ends");
        writer.join().expect("no panic").expect("it reads");
        assert!(out.status.success());
        String::from_utf8(out.stdout).expect("text").lines().map(str::to_owned).collect()
    };
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let devices: Vec<&str> = to_device().iter().map(|(name, _)| *name).collect();
    let all = vectors();
    let mut sound = String::new();
    let mut flipped = String::new();
    for v in &all {
        let way = if devices.contains(&v.name) || v.name == "hello-ask" { "device" } else { "host" };
        let _ = writeln!(sound, "{way} {}", hex(&v.bytes));
        for bit in 0..v.bytes.len() * 8 {
            let mut bytes = v.bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let _ = writeln!(flipped, "{way} {}", hex(&bytes));
        }
    }
    let want: Vec<String> = all.iter().map(|v| v.text.clone()).collect();
    assert_eq!(print(&sound), want);
    let refused = print(&flipped);
    assert!(refused.len() > 1000);
    for line in refused {
        assert!(line.starts_with("refused"), "{line}");
    }
}

#[test]
fn frames_of_another_version_and_kind_are_refused_by_name() {
    let v = framed("x", 0, false, &ToDevice::Heartbeat { counter: 1 });
    let mut decoder = Decoder::new();
    // Undo COBS by hand where the first code byte covers version and kind, change them, and seal again with a right CRC.
    for (version, kind, want) in
        [(2, 0, FrameError::Version { found: 2 }), (PROTOCOL_VERSION, 9, FrameError::Kind { found: 9 })]
    {
        let mut packet = [0u8; 256];
        let len = cobs::decode(&v.bytes[..v.bytes.len() - 1], &mut packet).expect("sound").frame_size();
        packet[0] = version;
        packet[1] = kind;
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&packet[..len - 4]);
        packet[len - 4..len].copy_from_slice(&crc.to_le_bytes());
        let mut coded = [0u8; 300];
        let coded_len = cobs::encode(&packet[..len], &mut coded);
        let got: Vec<_> = coded[..=coded_len].iter().filter_map(|&b| decoder.push(b)).collect();
        assert_eq!(got, [Err(want)]);
    }
}
