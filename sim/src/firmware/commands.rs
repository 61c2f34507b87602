//! What each command does.

use super::axis::Kinetics;
use super::{Firmware, Task};
use gonio_protocol::message::{Axis, Command, Fault, Outcome, Reason, Reply};
use std::time::Duration;

impl Firmware {
    /// Executes a command that has not been executed before, and answers it now or later.
    pub(super) fn command(&mut self, now: Duration, id: u32, command: Command) {
        // The state may be older than the command.
        self.advance(now);
        match self.execute(now, id, command) {
            Ok(Some(outcome)) => self.device.reply(id, Reply::Done(outcome)),
            Ok(None) => {}
            Err(reason) => self.device.reply(id, Reply::Rejected(reason)),
        }
        self.publish(self.instrument_time(now));
    }

    /// `Ok(None)`: the answer follows, or was given.
    fn execute(&mut self, now: Duration, id: u32, command: Command) -> Result<Option<Outcome>, Reason> {
        let t = self.instrument_time(now);
        match command {
            Command::Home => {
                self.check_ready(t)?;
                self.check_idle()?;
                self.kinetics = Kinetics {
                    speed: f64::from(self.settings.home_speed_udeg_s),
                    acceleration: f64::from(self.settings.max_accel_udeg_s2),
                };
                self.homed = false;
                self.tilt.home(t, self.kinetics);
                self.spin.home(t, self.kinetics);
                self.begin_motion(now, Task::Homing { id });
                self.device.reply(id, Reply::Accepted);
                Ok(None)
            }
            Command::Move { tilt_udeg, spin_udeg, speed_udeg_s, accel_udeg_s2 } => {
                self.check_ready(t)?;
                self.check_idle()?;
                if !self.homed {
                    return Err(Reason::NotHomed);
                }
                check_limits(Axis::Tilt, tilt_udeg, self.settings.tilt_limits_udeg)?;
                check_limits(Axis::Spin, spin_udeg, self.settings.spin_limits_udeg)?;
                self.kinetics = self.check_rate(speed_udeg_s, accel_udeg_s2)?;
                self.tilt.go(t, f64::from(tilt_udeg), self.kinetics);
                self.spin.go(t, f64::from(spin_udeg), self.kinetics);
                self.moves += 1;
                self.begin_motion(now, Task::Moving { id });
                self.device.reply(id, Reply::Accepted);
                Ok(None)
            }
            Command::Stop => {
                self.brake(t, self.kinetics, None);
                if self.task == Task::Idle {
                    return Ok(Some(Outcome::At(self.position())));
                }
                self.stops.push(id);
                Ok(None)
            }
            Command::Shutter { open } => {
                if open {
                    self.check_ready(t)?;
                    self.motion_lease.take(now);
                }
                if let Some(waiting) = self.shutter.id.take() {
                    self.device.reply(waiting, Reply::Aborted(None));
                }
                if open && self.shutter.is_closed() {
                    self.world.update(|state| state.openings = state.openings.wrapping_add(1));
                }
                self.shutter.set(t, open);
                if !self.shutter.is_travelling() {
                    return Ok(Some(Outcome::Nothing));
                }
                self.shutter.id = Some(id);
                self.device.reply(id, Reply::Accepted);
                Ok(None)
            }
            Command::Lamp { on, level_ppm } => {
                if level_ppm > 1_000_000 {
                    return Err(Reason::Level);
                }
                let burns = on && level_ppm > 0;
                if burns {
                    self.check_ready(t)?;
                    self.lamp_lease.take(now);
                } else {
                    self.lamp_lease.release();
                }
                self.lamp.switch(t, if burns { f64::from(level_ppm) / 1e6 } else { 0.0 });
                Ok(Some(Outcome::Nothing))
            }
            Command::Sensors => Ok(Some(Outcome::Sensors(self.sensors(now)))),
            Command::CameraTrigger { .. } => {
                self.check_fault()?;
                self.triggers = self.triggers.wrapping_add(1);
                Ok(Some(Outcome::Triggered { count: self.triggers }))
            }
            Command::Status => Ok(Some(Outcome::Status(self.status(now)))),
            Command::Rearm => {
                if let Some(fault) = self.fault
                    && self.persists(t, fault)
                {
                    return Err(Reason::FaultPersists(fault));
                }
                self.fault = None;
                Ok(Some(Outcome::Nothing))
            }
        }
    }

    fn begin_motion(&mut self, now: Duration, task: Task) {
        self.task = task;
        self.move_began = self.instrument_time(now);
        self.motion_lease.take(now);
    }

    fn check_fault(&self) -> Result<(), Reason> {
        self.fault.map_or(Ok(()), |fault| Err(Reason::FaultLatched(fault)))
    }

    fn check_ready(&self, t: f64) -> Result<(), Reason> {
        self.check_fault()?;
        if self.interlock_open(t) { Err(Reason::InterlockOpen) } else { Ok(()) }
    }

    fn check_idle(&self) -> Result<(), Reason> {
        if self.task == Task::Idle { Ok(()) } else { Err(Reason::Busy) }
    }

    fn check_rate(&self, speed: u32, acceleration: u32) -> Result<Kinetics, Reason> {
        let (max_speed, max_accel) = (self.settings.max_speed_udeg_s, self.settings.max_accel_udeg_s2);
        if (1..=max_speed).contains(&speed) && (1..=max_accel).contains(&acceleration) {
            Ok(Kinetics { speed: f64::from(speed), acceleration: f64::from(acceleration) })
        } else {
            Err(Reason::Rate { max_speed_udeg_s: max_speed, max_accel_udeg_s2: max_accel })
        }
    }

    fn persists(&self, t: f64, fault: Fault) -> bool {
        match fault {
            Fault::InterlockOpen => self.interlock_open(t),
            Fault::OverTemperature { .. } => self.lamp_temperature_c(t) > self.settings.lamp_limit_c,
            Fault::LeaseExpired | Fault::Stall { .. } | Fault::EmergencyStop => false,
        }
    }
}

fn check_limits(axis: Axis, target: i32, [min_udeg, max_udeg]: [i32; 2]) -> Result<(), Reason> {
    if (min_udeg..=max_udeg).contains(&target) {
        Ok(())
    } else {
        Err(Reason::OutsideLimits { axis, min_udeg, max_udeg })
    }
}
