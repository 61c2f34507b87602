//! A host that falls silent, and an emergency stop: how soon the device is safe.
//!
//! In virtual time the firmware loses its host at a random instant of a move, with the shutter open, at life speed: from the last heartbeat to
//! standstill and closed shutter at most the lease of 150 ms, the deceleration (speed over acceleration) and the shutter's travel may pass. In real time a host process
//! that scans through a pseudo-terminal is stopped (SIGSTOP) or killed (SIGKILL). The emergency stop is timed from the call to the
//! device's answer, through the pseudo-terminal, every second one behind a queue of other commands.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use gonio_driver::camera::{CameraFaults, CameraServer};
use gonio_driver::stage::StageEvent;
use gonio_instrument::{Stage as _, builtin};
use gonio_protocol::hello::Version;
use gonio_protocol::host::{Host, HostEvent};
use gonio_protocol::message::{Command, Reply};
use gonio_sim::firmware::{Faults, Firmware, Settings as Controller};
use gonio_sim::world::World;

use super::dice::Dice;
use super::instrument::{Events, Tiny};
use super::{Figure, Settings, grouped};

const SPEED_UDEG_S: u32 = 40_000_000;
const ACCEL_UDEG_S2: u32 = 200_000_000;
const LEASE_MS: f64 = 150.0;

/// Runs the campaign.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let silences = settings.count(2000, 20);
    let mut worst = (0.0f64, 0.0f64);
    let mut dice = Dice::new(settings.seed, 30);
    for _ in 0..silences {
        let (still, closed) = silence(&mut dice);
        worst = (worst.0.max(still), worst.1.max(closed));
    }
    let deceleration = f64::from(SPEED_UDEG_S) / f64::from(ACCEL_UDEG_S2) * 1e3;
    let size = format!("{} silences, virtual time", grouped(silences));
    let mut figures = vec![
        Figure::at_most(
            "last heartbeat to standstill, longest",
            worst.0,
            "ms",
            LEASE_MS + deceleration + 2.0,
            &size,
        ),
        Figure::at_most("last heartbeat to shutter closing, longest", worst.1, "ms", LEASE_MS + 2.0, &size),
    ];
    figures.extend(host_gone(settings));
    figures.extend(emergency_stops(settings));
    figures
}

/// One move whose host falls silent; ms from the last heartbeat the firmware heard to standstill, and to the shutter no longer open.
fn silence(dice: &mut Dice) -> (f64, f64) {
    let instrument = builtin::description("reference").expect("built in").expect("readable");
    let world = World::new(1.0);
    let mut firmware = Firmware::new(Controller::new(&instrument, 1, 1.0), world.clone(), Faults::default());
    let mut host = Host::new(1, 1, Version::default());
    let far = Command::Move {
        tilt_udeg: 85_000_000,
        spin_udeg: 0,
        speed_udeg_s: SPEED_UDEG_S,
        accel_udeg_s2: ACCEL_UDEG_S2,
    };
    let steps = [Command::Home, Command::Shutter { open: true }, far];
    let (mut next, mut busy, mut now, mut out) = (0, false, Duration::ZERO, Vec::new());
    let mut falls_silent: Option<Duration> = None;
    let (mut last_heard, mut heartbeats) = (Duration::ZERO, 0);
    let (mut still, mut closed) = (None, None);
    while now < Duration::from_secs(60) {
        let silent = falls_silent.is_some_and(|at| now >= at);
        if !silent {
            if host.is_connected() && !busy && next < steps.len() {
                next += 1;
                busy = host.command(next as u32, steps[next - 1]).is_ok();
                if next == steps.len() {
                    // the move takes 2.1 s: well within its even part
                    falls_silent = Some(now + Duration::from_secs_f64(0.4 + 1.2 * dice.fraction()));
                }
            }
            while let Some(frame) = host.poll_transmit(now) {
                firmware.receive(now, frame.as_slice());
                if host.statistics().heartbeats > heartbeats {
                    (heartbeats, last_heard) = (host.statistics().heartbeats, now);
                }
            }
        }
        out.clear();
        firmware.poll(now, &mut out);
        let mut input = out.as_slice();
        while !silent && let Some(event) = host.receive(now, &mut input) {
            if let HostEvent::Reply { reply: Reply::Done(_), .. } = event {
                busy = false;
            }
        }
        if silent {
            let state = world.state();
            if !state.shutter_open {
                closed.get_or_insert(now);
            }
            if !state.moving {
                still.get_or_insert(now);
            }
            if still.is_some() && closed.is_some() {
                break;
            }
        }
        let host_next = if silent { None } else { host.next_timeout() };
        let due = firmware.next_timeout(now).min(host_next.unwrap_or(Duration::MAX));
        let due = falls_silent.filter(|at| *at > now).map_or(due, |at| due.min(at));
        now = due.max(now + Duration::from_micros(100));
    }
    let ms = |at: Option<Duration>| at.map_or(f64::INFINITY, |at| (at - last_heard).as_secs_f64() * 1e3);
    (ms(still), ms(closed))
}

/// A host process is stopped or killed in mid-scan.
fn host_gone(settings: &Settings) -> Vec<Figure> {
    let rounds = settings.count(40, 2);
    let mut dice = Dice::new(settings.seed, 31);
    let folder = tempfile::tempdir().expect("a folder");
    // slow enough that most instants are moves or exposures
    let tiny = Tiny::new(None, 2.0, Faults::default());
    let socket = folder.path().join("cam");
    let (camera, _) = tiny.camera(CameraFaults::default(), 1);
    let _server = CameraServer::serve(Box::new(camera), &socket).expect("a socket");
    let mut took = Vec::new();
    for round in 0..rounds {
        let mut host = Guard(start(settings, &tiny, folder.path(), &socket));
        let begun = Instant::now();
        while !(tiny.world.state().moving || tiny.world.state().shutter_open)
            && begun.elapsed() < Duration::from_secs(60)
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        // homing comes first, then the lamp warms up: a short look need not wait for that
        let within_s = if settings.timed { 2.0 } else { 0.3 };
        std::thread::sleep(Duration::from_secs_f64(within_s * dice.fraction()));
        while !(tiny.world.state().moving || tiny.world.state().shutter_open)
            && begun.elapsed() < Duration::from_secs(60)
        {
            std::thread::sleep(Duration::from_micros(200));
        }
        let signal =
            if round % 2 == 0 { rustix::process::Signal::STOP } else { rustix::process::Signal::KILL };
        host.signal(signal);
        let gone = Instant::now();
        while tiny.world.state().moving || tiny.world.state().shutter_open {
            std::thread::sleep(Duration::from_micros(200));
            if gone.elapsed() > Duration::from_secs(10) {
                break;
            }
        }
        took.push(gone.elapsed().as_secs_f64() * 1e3);
        host.signal(rustix::process::Signal::KILL);
        // the next host finds a device that is left alone
        std::thread::sleep(Duration::from_millis(200));
    }
    took.sort_by(f64::total_cmp);
    let size = format!("{} hosts stopped or killed, real time", grouped(rounds));
    // speed over acceleration of the driver's moves, at twice life speed
    let deceleration = 60.0 / 200.0 * 1e3 / 2.0;
    let longest = took.last().copied().unwrap_or(f64::INFINITY);
    vec![
        Figure::time(
            settings,
            "host gone to standstill and closed shutter, longest",
            longest,
            "ms",
            LEASE_MS + deceleration + 20.0,
            &size,
        ),
        Figure::told("the same, half of them within", format!("{:.1} ms", took[took.len() / 2]), &size),
    ]
}

fn start(settings: &Settings, tiny: &Tiny, folder: &std::path::Path, socket: &std::path::Path) -> Child {
    let port = tiny.pty.name().path().expect("plugged in");
    let mut command = settings.command();
    command
        .args(["scan", "--instrument", "tiny", "--force", "-o", "s.mcap", "--device"])
        .arg(format!("serial:{}", port.display()))
        .arg("--camera")
        .arg(format!("sim:{}", socket.display()))
        .current_dir(folder)
        .env("GONIO_RUNTIME_DIR", folder.join("run"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.spawn().expect("the program starts")
}

/// A child that does not outlive the campaign.
struct Guard(Child);

impl Guard {
    fn signal(&mut self, signal: rustix::process::Signal) {
        let pid = rustix::process::Pid::from_child(&self.0);
        let _ = rustix::process::kill_process(pid, signal);
        if signal == rustix::process::Signal::KILL {
            let _ = self.0.wait();
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// From the call to the device's answer.
fn emergency_stops(settings: &Settings) -> Vec<Figure> {
    let stops = settings.count(5000, 50);
    let tiny = Tiny::new(None, 20.0, Faults::default());
    let events = Events::default();
    let mut stage = tiny.stage(None, Some(&events)).expect("a session");
    let mut took = Vec::new();
    for n in 0..stops {
        events.lock().expect("not poisoned").clear();
        let pending: Vec<_> = (0..if n % 2 == 0 { 0 } else { 12 })
            .filter_map(|_| stage.client().start(Command::Status).ok())
            .collect();
        let called = Instant::now();
        stage.client().emergency_stop().expect("a client");
        let answered = loop {
            let found = events
                .lock()
                .expect("not poisoned")
                .iter()
                .find(|(_, e)| matches!(e, StageEvent::EmergencyStopped { .. }))
                .map(|(at, _)| *at);
            if let Some(at) = found {
                break at;
            }
            if called.elapsed() > Duration::from_secs(10) {
                break Instant::now();
            }
            std::thread::sleep(Duration::from_micros(100));
        };
        took.push((answered - called).as_secs_f64() * 1e3);
        for p in pending {
            let _ = p.wait(Duration::from_secs(10));
        }
        stage.rearm().expect("re-armed");
    }
    took.sort_by(f64::total_cmp);
    let at = |share: f64| took[((took.len() as f64 * share) as usize).min(took.len() - 1)];
    let size = format!("{} emergency stops through the pseudo-terminal", grouped(stops));
    vec![
        Figure::time(settings, "emergency stop, call to answer, p99.9", at(0.999), "ms", 20.0, &size),
        Figure::told(
            "the same, p50 / p99 / longest",
            format!("{:.2} / {:.2} / {:.2} ms", at(0.5), at(0.99), at(1.0)),
            &size,
        ),
    ]
}
