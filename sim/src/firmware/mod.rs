//! What the motion controller does, without its motors: the virtual firmware behind the protocol of `gonio-protocol`.
//!
//! Sans-I/O: bytes and a clock in ([`Firmware::receive`], [`Firmware::poll`]), bytes out; [`serve`] runs it on a thread behind a
//! pseudo-terminal or between two channels. What it does to the instrument it writes into the shared [`World`].
//!
//! Two clocks: link, leases and heartbeats run in real time; motion, shutter, warm-up and scheduled faults in instrument time,
//! which is `time_scale` times faster. Nothing random depends on time: what is drawn is drawn from (seed, pose).

mod axis;
mod behaviour;
mod commands;
mod faults;
mod lamp;
mod schedule;
pub mod serve;
mod settings;
mod shutter;

pub use faults::{FaultEvent, Faults, FaultsError, FileFaults, LinkFaults, What};
pub use settings::Settings;

use crate::world::World;
use axis::{Axis, Kinetics};
use gonio_protocol::device::{Device, DeviceEvent, Identity};
use gonio_protocol::lease::Lease;
use gonio_protocol::link::Statistics;
use gonio_protocol::message::Fault;
use lamp::Lamp;
use schedule::Schedule;
use shutter::Shutter;
use std::time::Duration;

/// How often the state is brought up to date while something moves.
const STEP: Duration = Duration::from_millis(2);
/// How often switches thrown from outside are looked at while nothing moves.
const IDLE_STEP: Duration = Duration::from_millis(10);

/// What the axes are busy with, and for which command.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    Idle,
    Homing { id: u32 },
    Moving { id: u32 },
    Stopping,
}

/// The virtual motion controller.
#[derive(Debug)]
pub struct Firmware {
    settings: Settings,
    world: World,
    device: Device,
    boot: u32,
    /// Real time of the last start.
    started: Duration,
    tilt: Axis,
    spin: Axis,
    homed: bool,
    task: Task,
    /// Stop commands that wait until the axes stand.
    stops: Vec<u32>,
    /// Rate of the motion under way, for a stop.
    kinetics: Kinetics,
    /// Instrument time at which it began.
    move_began: f64,
    shutter: Shutter,
    lamp: Lamp,
    fault: Option<Fault>,
    motion_lease: Lease,
    lamp_lease: Lease,
    schedule: Schedule,
    /// Moves begun since the firmware was made, over restarts: what the schedule counts.
    moves: u32,
    triggers: u32,
}

impl Firmware {
    /// A controller that has just been switched on in `world`, with `faults` to come.
    pub fn new(settings: Settings, world: World, faults: Faults) -> Firmware {
        let boot = settings.boot;
        world.update(|state| state.time_scale = settings.time_scale);
        let mut firmware = Firmware {
            device: Device::new(identity(&settings, &faults, boot)),
            boot,
            started: Duration::ZERO,
            tilt: Axis::new(settings.power_on_udeg[0], settings.backlash_udeg),
            spin: Axis::new(settings.power_on_udeg[1], settings.backlash_udeg),
            homed: false,
            task: Task::Idle,
            stops: Vec::new(),
            kinetics: settings.fastest(),
            move_began: 0.0,
            shutter: Shutter::new(settings.shutter_travel_s),
            lamp: Lamp::new(&settings),
            fault: None,
            motion_lease: Lease::new(settings.motion_lease),
            lamp_lease: Lease::new(settings.lamp_lease),
            schedule: Schedule::new(faults),
            moves: 0,
            triggers: 0,
            settings,
            world,
        };
        firmware.publish(0.0);
        firmware
    }

    /// Takes bytes from the host.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        if self.is_silent(now) {
            return;
        }
        let mut input = bytes;
        while let Some(event) = self.device.receive(now, &mut input) {
            match event {
                DeviceEvent::Session { new_client: true } => self.change_client(now),
                DeviceEvent::Session { new_client: false } => {}
                DeviceEvent::Command { id, command } => self.command(now, id, command),
                DeviceEvent::Heartbeat { counter } => self.heartbeat(now, counter),
                DeviceEvent::EmergencyStop { id } => {
                    self.trip(now, Fault::EmergencyStop);
                    self.device.emergency_stopped(id);
                }
            }
        }
    }

    /// Brings everything up to `now` and appends what is to be sent to `out`.
    pub fn poll(&mut self, now: Duration, out: &mut Vec<u8>) {
        self.advance(now);
        if self.is_silent(now) {
            return;
        }
        while let Some(frame) = self.device.poll_transmit(now) {
            out.extend_from_slice(frame.as_slice());
        }
    }

    /// When [`Firmware::poll`] should be called next, unless bytes come before.
    pub fn next_timeout(&self, now: Duration) -> Duration {
        let busy = self.task != Task::Idle || self.shutter.is_travelling();
        let step = now + if busy { STEP } else { IDLE_STEP };
        let ends = [self.tilt.ends_at(), self.spin.ends_at(), self.shutter.ends_at()];
        let ends = ends.into_iter().flatten().map(|t| self.real_time(t));
        let link = if self.is_silent(now) { None } else { self.device.next_timeout() };
        let leases = [self.motion_lease.expires(), self.lamp_lease.expires(), link];
        ends.chain(leases.into_iter().flatten()).fold(step, Duration::min).max(now)
    }

    /// Switches the controller off and on again: positions void, lamp off, shutter closed by its spring, sessions and
    /// commands forgotten.
    pub fn restart(&mut self, now: Duration) {
        let t = self.instrument_time(now);
        self.boot = self.boot.wrapping_add(1);
        self.device = Device::new(identity(&self.settings, self.schedule.faults(), self.boot));
        self.started = now;
        self.tilt.power_on(t);
        self.spin.power_on(t);
        self.homed = false;
        self.task = Task::Idle;
        self.stops.clear();
        self.shutter = Shutter::new(self.settings.shutter_travel_s);
        self.lamp.switch(t, 0.0);
        self.fault = None;
        self.motion_lease.release();
        self.lamp_lease.release();
        self.triggers = 0;
        self.publish(t);
    }

    /// Counters of the device's end of the link.
    pub fn statistics(&self) -> Statistics {
        self.device.statistics()
    }

    /// The room this controller works in.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Instrument seconds since the firmware was made.
    fn instrument_time(&self, now: Duration) -> f64 {
        now.as_secs_f64() * self.settings.time_scale
    }

    fn real_time(&self, t: f64) -> Duration {
        // A hair later, so that a poll at that time finds it reached in spite of rounding.
        let at = Duration::try_from_secs_f64(t / self.settings.time_scale).unwrap_or(Duration::MAX);
        at.saturating_add(Duration::from_nanos(1))
    }

    /// The plug is pulled by a scheduled hang-up; whoever serves the firmware closes the port meanwhile.
    pub fn is_unplugged(&self, now: Duration) -> bool {
        self.schedule.is_active(What::HangUp, self.instrument_time(now))
    }

    fn is_silent(&self, now: Duration) -> bool {
        self.world.state().switches.silent || self.schedule.is_active(What::Silent, self.instrument_time(now))
    }
}

fn identity(settings: &Settings, faults: &Faults, boot: u32) -> Identity {
    let mut identity = Identity::new(settings.version, boot, settings.serial);
    if let Some(version) = faults.protocol_version {
        identity.protocol = version;
    }
    identity
}
