//! What happens by itself: motion goes on, leases run out, faults are noticed, the world is told.

use super::axis::Kinetics;
use super::{Firmware, Task, What};
use crate::world::AMBIENT_C;
use gonio_instrument::Pose;
use gonio_optics::Angle;
use gonio_protocol::message::{
    Axis, Fault, Motion, Outcome, Position, Reply, SensorReadings, Status, Telemetry, ToHost,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Duration;

/// What a draw is for; the same pose gives independent numbers for each.
#[derive(Clone, Copy)]
enum Draw {
    Repeatability = 1,
    Monitor = 2,
}

/// Temperature told while the housing is overheated from outside, °C.
const OVERHEATED_C: f64 = 97.0;

impl Firmware {
    /// Brings everything up to `now`.
    pub(super) fn advance(&mut self, now: Duration) {
        let t = self.instrument_time(now);
        self.begin_scheduled(now, t);
        self.tilt.advance(t);
        self.spin.advance(t);
        self.notice_jams(now);
        self.notice_environment(now, t);
        if self.motion_lease.is_expired(now) {
            self.trip(now, Fault::LeaseExpired);
        }
        if self.lamp_lease.is_expired(now) {
            self.lamp.switch(t, 0.0);
            self.lamp_lease.release();
        }
        if self.shutter.advance(t)
            && let Some(id) = self.shutter.id.take()
        {
            self.device.reply(id, Reply::Done(Outcome::Nothing));
        }
        self.finish_motion();
        if self.task == Task::Idle && self.shutter.is_closed() {
            self.motion_lease.release();
        }
        self.publish(t);
    }

    /// Makes the device safe and latches the fault, unless one is latched already.
    pub(super) fn trip(&mut self, now: Duration, fault: Fault) {
        let t = self.instrument_time(now);
        let kinetics = if fault == Fault::EmergencyStop { self.settings.fastest() } else { self.kinetics };
        self.brake(t, kinetics, Some(fault));
        self.close_shutter(t, Some(fault));
        if matches!(fault, Fault::InterlockOpen | Fault::OverTemperature { .. } | Fault::EmergencyStop) {
            self.lamp.switch(t, 0.0);
            self.lamp_lease.release();
        }
        if matches!(fault, Fault::Stall { .. }) {
            self.homed = false;
        }
        // Whatever it guarded is on its way to a stop; a fault must not be latched twice for it.
        self.motion_lease.release();
        if self.fault.is_none() {
            self.fault = Some(fault);
            self.device.tell(ToHost::Fault { fault, uptime_ms: self.uptime_ms(now) });
        }
    }

    /// Ends the move or homing under way, and decelerates.
    pub(super) fn brake(&mut self, t: f64, kinetics: Kinetics, fault: Option<Fault>) {
        if let Task::Homing { id } | Task::Moving { id } = self.task {
            self.device.reply(id, Reply::Aborted(fault));
            self.task = Task::Stopping;
        }
        if self.task == Task::Stopping {
            self.tilt.stop(t, kinetics.acceleration);
            self.spin.stop(t, kinetics.acceleration);
        }
    }

    /// Closes the shutter on the device's own account; a command that is opening it ends as aborted.
    pub(super) fn close_shutter(&mut self, t: f64, fault: Option<Fault>) {
        if self.shutter.is_opening_or_open()
            && let Some(id) = self.shutter.id.take()
        {
            self.device.reply(id, Reply::Aborted(fault));
        }
        self.shutter.set(t, false);
    }

    /// Another host program: what the old one had begun ends, and nobody is told.
    pub(super) fn change_client(&mut self, now: Duration) {
        let t = self.instrument_time(now);
        if self.task != Task::Idle {
            self.task = Task::Stopping;
            self.tilt.stop(t, self.kinetics.acceleration);
            self.spin.stop(t, self.kinetics.acceleration);
        }
        self.stops.clear();
        self.shutter.id = None;
        self.shutter.set(t, false);
    }

    pub(super) fn heartbeat(&mut self, now: Duration, counter: u32) {
        self.motion_lease.renew(now);
        self.lamp_lease.renew(now);
        let status = self.status(now);
        self.device.tell_now(ToHost::Telemetry(Telemetry { counter, status }));
    }

    pub(super) fn status(&self, now: Duration) -> Status {
        let t = self.instrument_time(now);
        Status {
            boot: self.boot,
            uptime_ms: self.uptime_ms(now),
            homed: self.homed,
            motion: match self.task {
                Task::Idle => Motion::Idle,
                Task::Homing { .. } => Motion::Homing,
                Task::Moving { .. } => Motion::Moving,
                Task::Stopping => Motion::Stopping,
            },
            position: self.position(),
            shutter_open: !self.shutter.is_closed(),
            lamp_on: self.lamp.is_on(),
            lamp_warm: self.lamp.is_warm(t),
            lamp_level_ppm: (self.lamp.level() * 1e6).round() as u32,
            interlock_closed: !self.interlock_open(t),
            fault: self.fault,
            triggers: self.triggers,
        }
    }

    pub(super) fn sensors(&self, now: Duration) -> SensorReadings {
        let t = self.instrument_time(now);
        let position = self.position();
        let noise = 1.0 + self.settings.monitor_noise * self.draw(Draw::Monitor, position);
        SensorReadings {
            lamp_monitor_ppm: (self.lamp.output(t) * noise * 1e6).round() as u32,
            lamp_mc: (self.lamp_temperature_c(t) * 1e3).round() as i32,
            ambient_mc: (AMBIENT_C * 1e3).round() as i32,
            sample_height_um: (self.settings.sample_height_mm * 1e3).round() as i32,
            interlock_closed: !self.interlock_open(t),
        }
    }

    pub(super) fn position(&self) -> Position {
        Position {
            tilt_udeg: self.tilt.readback_udeg().round() as i32,
            spin_udeg: self.spin.readback_udeg().round() as i32,
        }
    }

    pub(super) fn interlock_open(&self, t: f64) -> bool {
        self.world.state().switches.interlock_open || self.schedule.is_active(What::InterlockOpen, t)
    }

    pub(super) fn lamp_temperature_c(&self, t: f64) -> f64 {
        if self.world.state().switches.overheated || self.schedule.is_active(What::OverTemperature, t) {
            OVERHEATED_C
        } else {
            self.lamp.temperature_c(t)
        }
    }

    /// Tells the world what is the case.
    pub(super) fn publish(&mut self, t: f64) {
        let position = self.position();
        let key = (i64::from(position.tilt_udeg), i64::from(position.spin_udeg));
        if self.homed
            && let Some(place) = self.settings.place(key)
        {
            self.lamp.set_place(place);
        }
        let repeatability = self.settings.tilt_repeatability_deg * self.draw(Draw::Repeatability, position);
        let actual_tilt_deg = self.tilt.sample_udeg() * 1e-6 + self.settings.tilt_zero_deg + repeatability;
        let degrees = |udeg: i32| Angle::from_degrees(f64::from(udeg) / 1e6);
        let lamp_temperature_c = self.lamp_temperature_c(t);
        self.world.update(|state| {
            state.readback = Pose { tilt: degrees(position.tilt_udeg), spin: degrees(position.spin_udeg) };
            state.actual = Pose {
                tilt: Angle::from_degrees(actual_tilt_deg),
                spin: Angle::from_degrees(self.spin.sample_udeg() / 1e6),
            };
            state.moving = self.task != Task::Idle;
            state.shutter_open = self.shutter.lets_light_through();
            state.lamp = self.lamp.output(t);
            state.lamp_temperature_c = lamp_temperature_c;
            state.sample_height_mm = self.settings.sample_height_mm;
            state.triggers = self.triggers;
        });
    }

    fn finish_motion(&mut self) {
        if self.task == Task::Idle || self.tilt.is_moving() || self.spin.is_moving() {
            return;
        }
        let task = std::mem::replace(&mut self.task, Task::Idle);
        match task {
            Task::Homing { id } => {
                self.tilt.homed();
                self.spin.homed();
                self.homed = true;
                self.world.update(|state| state.homings = state.homings.wrapping_add(1));
                self.device.reply(id, Reply::Done(Outcome::At(self.position())));
            }
            Task::Moving { id } => self.device.reply(id, Reply::Done(Outcome::At(self.position()))),
            Task::Idle | Task::Stopping => {}
        }
        for id in std::mem::take(&mut self.stops) {
            self.device.reply(id, Reply::Done(Outcome::At(self.position())));
        }
    }

    fn begin_scheduled(&mut self, now: Duration, t: f64) {
        let half_way = matches!(self.task, Task::Moving { .. }) && self.is_half_way(t);
        for what in self.schedule.begin(t, self.moves, half_way) {
            match what {
                What::StallTilt => self.stall(now, Axis::Tilt),
                What::StallSpin => self.stall(now, Axis::Spin),
                What::Restart => self.restart(now),
                // These last, and are looked up where they matter.
                What::InterlockOpen | What::OverTemperature | What::Silent | What::HangUp => {}
            }
        }
    }

    fn is_half_way(&self, t: f64) -> bool {
        let end = [self.tilt.ends_at(), self.spin.ends_at()].into_iter().flatten().fold(t, f64::max);
        t >= 0.5 * (self.move_began + end)
    }

    fn notice_jams(&mut self, now: Duration) {
        let switches = self.world.state().switches;
        if switches.tilt_jammed && self.tilt.is_moving() {
            self.stall(now, Axis::Tilt);
        }
        if switches.spin_jammed && self.spin.is_moving() {
            self.stall(now, Axis::Spin);
        }
    }

    fn stall(&mut self, now: Duration, axis: Axis) {
        let t = self.instrument_time(now);
        match axis {
            Axis::Tilt => self.tilt.jam(t),
            Axis::Spin => self.spin.jam(t),
        }
        self.trip(now, Fault::Stall { axis });
    }

    fn notice_environment(&mut self, now: Duration, t: f64) {
        // Without a lamp or motion an open lid is how samples are changed, and nobody's fault.
        let at_work = self.lamp.is_on() || self.task != Task::Idle || !self.shutter.is_closed();
        if at_work && self.interlock_open(t) {
            self.trip(now, Fault::InterlockOpen);
        }
        let temperature_c = self.lamp_temperature_c(t);
        if temperature_c > self.settings.lamp_limit_c && (self.lamp.is_on() || !self.shutter.is_closed()) {
            let temperature_mc = (temperature_c * 1e3).round() as i32;
            self.trip(now, Fault::OverTemperature { temperature_mc });
        }
    }

    fn uptime_ms(&self, now: Duration) -> u32 {
        u32::try_from(now.saturating_sub(self.started).as_millis()).unwrap_or(u32::MAX)
    }

    /// A standard normal number that belongs to (seed, purpose, pose).
    fn draw(&self, draw: Draw, at: Position) -> f64 {
        let mut key = [0u8; 32];
        key[..8].copy_from_slice(&self.settings.seed.to_le_bytes());
        key[8..12].copy_from_slice(&at.tilt_udeg.to_le_bytes());
        key[12..16].copy_from_slice(&at.spin_udeg.to_le_bytes());
        key[16] = draw as u8;
        StandardNormal.sample(&mut ChaCha8Rng::from_seed(key))
    }
}
