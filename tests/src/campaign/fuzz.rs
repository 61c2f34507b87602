//! Mutated input into everything that reads bytes: no panic, no run-away memory, no endless loop.
//!
//! Inputs are valid ones, mutated by seed: bits and bytes, lengths and counts set to extremes, numbers in text replaced, pieces cut, doubled, moved
//! between inputs. Such mutators run on stable Rust in every test run and repeat by seed alone. Coverage guidance (`cargo fuzz`) would go deeper, but wants
//! a nightly compiler and sanitizers; `bolero` on stable draws as blindly as this and knows less of the formats.
//!
//! Readers of files are run from files through the functions the commands call. A panic is caught and counted, and its seed is printed.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use gonio_brdf::formats::{self, geometry_csv};
use gonio_instrument::{Certificate, Description, Misalignment, Plan, builtin};
use gonio_protocol::device::{Device, DeviceEvent, Identity};
use gonio_protocol::frame::Decoder;
use gonio_protocol::hello::{Serial, Version};
use gonio_protocol::host::Host;
use gonio_protocol::message::{Command, Outcome, Reply};
use gonio_sim::Truth;
use gonio_sim::firmware::Faults;

use super::dice::Dice;
use super::{Figure, Settings, damage, grouped};

/// Inputs of each reader for the promise.
const FULL: u64 = 2_000_000;

/// Reads bytes, in a folder that it may use.
type Reader = Box<dyn Fn(&[u8], &Path)>;

/// A reader and what it reads when all is well.
struct Target {
    name: &'static str,
    corpus: Vec<Vec<u8>>,
    read: Reader,
    /// Inputs of it for one of the cheapest.
    cost: u64,
}

/// Runs the campaign.
///
/// # Panics
/// Where the temporary folder cannot be written.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let folder = tempfile::tempdir().expect("a folder");
    // what is caught here is told once, with its seed; panics of other threads are none of this one's
    let (here, usual) = (std::thread::current().id(), std::panic::take_hook());
    std::panic::set_hook(Box::new(move |info| {
        if std::thread::current().id() != here {
            usual(info);
        }
    }));
    let targets = targets(folder.path(), settings.seed);
    let before = peak_kib();
    let (mut inputs, mut panics, mut slowest) = (0u64, 0u64, (Duration::ZERO, ""));
    let mut told = Vec::new();
    for target in &targets {
        let n = (settings.count(FULL, 6000) / target.cost).max(20);
        let mut bad = 0;
        for k in 0..n {
            let mut dice = Dice::new(settings.seed, k);
            let input = mutate(&mut dice, &target.corpus);
            let began = Instant::now();
            if catch_unwind(AssertUnwindSafe(|| (target.read)(&input, folder.path()))).is_err() {
                bad += 1;
                eprintln!("{}: panics at input {k} of seed {}", target.name, settings.seed);
            }
            let took = began.elapsed();
            if took > slowest.0 {
                slowest = (took, target.name);
            }
        }
        inputs += n;
        panics += bad;
        told.push(format!("{} {}", target.name, grouped(n)));
    }
    drop(std::panic::take_hook());
    let grown = peak_kib().saturating_sub(before) as f64 / 1024.0;
    let size = format!("{} inputs", grouped(inputs));
    vec![
        Figure::exactly("panics", panics, 0, &size),
        Figure::time(settings, "memory at its highest, above that before", grown, "MiB", 512.0, &size),
        Figure::time(
            settings,
            &format!("longest time over one input ({})", slowest.1),
            slowest.0.as_secs_f64(),
            "s",
            10.0,
            &size,
        ),
        Figure::told("inputs", told.join(", "), &size),
    ]
}

fn targets(folder: &Path, seed: u64) -> Vec<Target> {
    let mut dice = Dice::new(seed, 90);
    let wire: Vec<Vec<u8>> = (0..24).map(|_| conversation(&mut dice)).collect();
    let session = folder.join("seed.mcap");
    damage::write(&session, seed);
    let session = vec![std::fs::read(&session).expect("just written")];
    let text = |t: &str| t.as_bytes().to_vec();
    let in_file = |name: &'static str| {
        move |bytes: &[u8], folder: &Path| {
            let path = folder.join(name);
            if std::fs::write(&path, bytes).is_ok() {
                read_file(&path);
            }
        }
    };
    let toml = |read: fn(&str)| move |bytes: &[u8], _: &Path| read(&String::from_utf8_lossy(bytes));
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    let plan = instrument.plan.to_toml().unwrap_or_default();
    let misalignment =
        builtin::misalignment().ok().and_then(|m| toml::to_string(&m).ok()).unwrap_or_default();
    vec![
        Target { name: "frame decoder", corpus: wire.clone(), cost: 1, read: Box::new(decode) },
        Target { name: "host machine", corpus: wire.clone(), cost: 2, read: Box::new(host) },
        Target { name: "device machine", corpus: wire, cost: 2, read: Box::new(device) },
        Target { name: "session", corpus: session, cost: 20, read: Box::new(read_session) },
        Target {
            name: "tables and models",
            corpus: tables(folder),
            cost: 10,
            read: Box::new(in_file("fuzzed.bin")),
        },
        Target {
            name: "geometries",
            corpus: vec![text("theta_i_deg,theta_o_deg,phi_deg\n45,30,180\n10,20,0\n")],
            cost: 2,
            read: Box::new(|bytes, _| {
                let _ = geometry_csv::read(bytes);
                let _ = geometry_csv::read_weighted(bytes);
            }),
        },
        Target {
            name: "instruments",
            corpus: vec![instrument.to_toml().map(String::into_bytes).unwrap_or_default()],
            cost: 10,
            read: Box::new(toml(|t| drop(Description::from_toml(t)))),
        },
        Target {
            name: "plans",
            corpus: vec![plan.into_bytes()],
            cost: 2,
            read: Box::new(toml(|t| drop(Plan::from_toml(t)))),
        },
        Target {
            name: "misalignments",
            corpus: vec![misalignment.into_bytes()],
            cost: 4,
            read: Box::new(toml(|t| drop(Misalignment::from_toml(t)))),
        },
        Target {
            name: "faults",
            corpus: vec![text(
                "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"hang-up\"\nat_s = 12.0\nfor_s = 2.0\n[link]\nloss = 0.01\n[camera]\ntorn = 0.1\n[file]\nfail = 0.1\n",
            )],
            cost: 4,
            read: Box::new(toml(|t| drop(Faults::from_toml(t)))),
        },
        Target {
            name: "certificates",
            corpus: vec![serde_json::to_vec(&Certificate::virtual_white()).unwrap_or_default()],
            cost: 2,
            read: Box::new(|bytes, _| drop(serde_json::from_slice::<Certificate>(bytes))),
        },
    ]
}

/// Tables and models in every format that can be written here; the real ones of `GONIO_DATA` besides, where they are small.
fn tables(folder: &Path) -> Vec<Vec<u8>> {
    let mut csv = "theta_i_deg,theta_o_deg,phi_deg,r,g,b,sigma_r,sigma_g,sigma_b,flag\n".to_owned();
    for i in [0, 30, 60] {
        for o in [0, 20, 40, 60, 80] {
            for phi in [0, 60, 120, 180] {
                csv += &format!("{i},{o},{phi},0.3,0.2,0.1,0.01,0.01,0.01,0\n");
            }
        }
    }
    let model = r#"{"model":"ggx","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.1,0.1,0.1],"alpha":0.2,"r0":0.04}],"coat":{"index":1.5}}"#;
    let mut mbsdf = b"NVIDIA ARC MBSDF V1\nMBSDF_DATA_REFLECTION=\n".to_vec();
    for number in [1u32, 3, 4] {
        mbsdf.extend(number.to_le_bytes());
    }
    mbsdf.extend((0..3 * 3 * 4 * 3).flat_map(|_| 0.25f32.to_le_bytes()));
    let cornell =
        b"# a sample\n3\n450 550 650\n0.1 0.0 0.2 3.14159 0.1 0.2 0.3\n0.5 0.0 0.4 0.0 0.1 0.2 0.3\n"
            .to_vec();
    let mut merl = Vec::new();
    for number in [90u32, 90, 180] {
        merl.extend(number.to_le_bytes());
    }
    merl.extend((0..600).flat_map(|_| 0.5f64.to_le_bytes()));
    let path = folder.join("seed.csv");
    std::fs::write(&path, &csv).expect("written");
    let mut corpus = vec![csv.into_bytes(), model.as_bytes().to_vec(), mbsdf, cornell, merl];
    if let Ok(loaded) = formats::open(&path)
        && let Ok(target) = formats::Target::from_path(&folder.join("seed.nc"))
        && formats::save(&folder.join("seed.nc"), &loaded, target, true).is_ok()
    {
        corpus.push(std::fs::read(folder.join("seed.nc")).expect("just written"));
    }
    let data = std::env::var_os(crate::VARIABLE).map(PathBuf::from);
    for folder in data.iter().flat_map(|d| ["rgl", "mbsdf", "nbrdf", "cornell", "klems"].map(|n| d.join(n))) {
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let small = files.filter(|f| f.metadata().is_ok_and(|m| m.is_file() && m.len() < 600_000));
        corpus.extend(small.filter_map(|f| std::fs::read(f.path()).ok()));
    }
    corpus
}

/// As a command does that is given a file of any kind.
fn read_file(path: &Path) {
    if let Ok(loaded) = formats::open(path) {
        let _ = loaded.describe();
    }
    if let Ok(bytes) = std::fs::read(path) {
        let _ = Truth::from_bytes(&bytes);
    }
}

fn read_session(bytes: &[u8], folder: &Path) {
    let (path, copy) = (folder.join("fuzzed.mcap"), folder.join("copy.mcap"));
    if std::fs::write(&path, bytes).is_err() {
        return;
    }
    if let Ok(session) = gonio_recording::Session::open(&path) {
        session.poses().for_each(drop);
        session.notes().for_each(drop);
        let _ = session.header();
    }
    let _ = gonio_recording::verify(&path);
    let _ = gonio_recording::progress(&path);
    let _ = gonio_recording::info(&path);
    let _ = gonio_recording::recover(&path, &copy, true);
}

fn decode(bytes: &[u8], _: &Path) {
    let mut decoder = Decoder::new();
    for &byte in bytes {
        let _ = decoder.push(byte);
    }
}

/// A host that is told anything: what it says stays finite.
fn host(bytes: &[u8], _: &Path) {
    let mut host = Host::new(7, 100, Version::default());
    let mut now = Duration::ZERO;
    for piece in bytes.chunks(37) {
        let mut input = piece;
        while host.receive(now, &mut input).is_some() {}
        let _ = host.command(now.as_millis() as u32, Command::Status);
        let said = (0..100).take_while(|_| host.poll_transmit(now).is_some()).count();
        assert!(said < 100, "a host that never stops talking");
        now += Duration::from_millis(7);
    }
}

fn device(bytes: &[u8], _: &Path) {
    let mut device = Device::new(Identity::new(Version::default(), 1, Serial::default()));
    let mut now = Duration::ZERO;
    let mut highest = 0;
    for piece in bytes.chunks(37) {
        let mut input = piece;
        while let Some(event) = device.receive(now, &mut input) {
            match event {
                DeviceEvent::Command { id, .. } => {
                    assert!(id > highest || highest == 0, "command {id} after {highest}");
                    highest = id;
                    device.reply(id, Reply::Done(Outcome::Nothing));
                }
                DeviceEvent::EmergencyStop { id } => device.emergency_stopped(id),
                DeviceEvent::Session { new_client: true } => highest = 0,
                DeviceEvent::Session { .. } | DeviceEvent::Heartbeat { .. } => {}
            }
        }
        let said = (0..100).take_while(|_| device.poll_transmit(now).is_some()).count();
        assert!(said < 100, "a device that never stops talking");
        now += Duration::from_millis(7);
    }
}

/// What goes over a wire while a host greets a device and gives it commands; both directions, one after the other.
fn conversation(dice: &mut Dice) -> Vec<u8> {
    let mut host = Host::new(7, 100, Version::default());
    let mut device = Device::new(Identity::new(Version::default(), 1, Serial::new("FUZZED")));
    let (mut now, mut id, mut said) = (Duration::ZERO, 0, Vec::new());
    for _ in 0..12 + dice.below(20) {
        if host.is_connected() && host.free() > 0 && dice.happens(0.5) {
            id += 1;
            let _ = host.command(id, Command::Shutter { open: id % 2 == 0 });
        }
        while let Some(frame) = host.poll_transmit(now) {
            said.extend_from_slice(frame.as_slice());
            let mut input = frame.as_slice();
            while let Some(event) = device.receive(now, &mut input) {
                if let DeviceEvent::Command { id, .. } = event {
                    device.reply(id, Reply::Accepted);
                    device.reply(id, Reply::Done(Outcome::Nothing));
                }
            }
        }
        while let Some(frame) = device.poll_transmit(now) {
            said.extend_from_slice(frame.as_slice());
            let mut input = frame.as_slice();
            while host.receive(now, &mut input).is_some() {}
        }
        now += Duration::from_millis(10);
    }
    said
}

/// An input of the corpus, mutated once or a few times.
fn mutate(dice: &mut Dice, corpus: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = corpus.get(dice.below(corpus.len())).cloned().unwrap_or_default();
    for _ in 0..1 + dice.below(4) {
        if bytes.is_empty() {
            bytes.push(0);
        }
        let at = dice.below(bytes.len());
        // heads hold what lengths depend on: half of the damage goes there
        let at = if dice.happens(0.5) { at % 512.min(bytes.len()) } else { at };
        let run = (1 + dice.below(64)).min(bytes.len() - at);
        match dice.below(9) {
            0 => bytes[at] ^= 1 << dice.below(8),
            1 => bytes[at] = dice.next_u64() as u8,
            2 => {
                let extreme =
                    [0u64, 1, 0x7f, 0xff, 0x7fff_ffff, 0xffff_ffff, 1 << 40, u64::MAX][dice.below(8)];
                let wide = [1, 2, 4, 8][dice.below(4)].min(bytes.len() - at);
                let ends = if dice.happens(0.5) { extreme.to_le_bytes() } else { extreme.to_be_bytes() };
                let from = if dice.happens(0.5) { 0 } else { 8 - wide };
                bytes[at..at + wide].copy_from_slice(&ends[from..from + wide]);
            }
            3 => drop(bytes.drain(at..at + run)),
            4 => {
                let piece = bytes[at..at + run].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => {
                let other = &corpus[dice.below(corpus.len())];
                let from = dice.below(other.len().max(1));
                let piece = other.get(from..(from + run).min(other.len())).unwrap_or(&[]).to_vec();
                bytes.splice(at..at, piece);
            }
            6 => bytes.truncate(at),
            7 => number(dice, &mut bytes, at),
            _ => {
                let mut junk = vec![0; run];
                dice.fill(&mut junk);
                bytes[at..at + run].copy_from_slice(&junk);
            }
        }
    }
    bytes
}

/// Replaces the number in the text at or after `at` by one that no file should hold.
fn number(dice: &mut Dice, bytes: &mut Vec<u8>, at: usize) {
    let Some(from) = bytes[at..].iter().position(u8::is_ascii_digit).map(|n| at + n) else { return };
    let to = bytes[from..]
        .iter()
        .position(|b| !(b.is_ascii_digit() || *b == b'.'))
        .map_or(bytes.len(), |n| from + n);
    let other = [
        "-1",
        "0",
        "1e308",
        "-1e308",
        "nan",
        "inf",
        "1e-320",
        "18446744073709551616",
        "4294967295",
        "1000000000",
    ];
    bytes.splice(from..to, other[dice.below(other.len())].bytes());
}

/// Highest resident memory of this process so far, KiB; 0 where the system does not tell.
fn peak_kib() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with("VmHWM:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|n| n.parse().ok()).unwrap_or(0)
}
