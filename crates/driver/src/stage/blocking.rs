//! The stage as the scan sees it: calls that block until the thing is done, or a stop is asked for.

use super::{Client, Options, Pending};
use crate::transport::{SerialTransport, Transport, serial};
use gonio_instrument::{Cancel, DeviceError, LinkStatistics, Pose, Sensors, Stage, StageIdentity, Stopping};
use gonio_protocol::message::{Command, Fault, Outcome, Position, Status};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How often a stop request is looked at.
const GLANCE: Duration = Duration::from_millis(10);
/// Longest time any single command may take on a device that lives.
const PATIENCE: Duration = Duration::from_secs(600);
/// How often a command is tried when leases expire.
const ATTEMPTS: u32 = 4;
/// Longest time until an emergency stop shows in the status.
const CONFIRMATION: Duration = Duration::from_secs(2);
/// Longest warm-up of a lamp.
const WARM_UP: Duration = Duration::from_secs(3600);

/// Speed and acceleration of moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionRates {
    /// Degrees per second.
    pub speed_deg_s: f64,
    /// Degrees per second².
    pub acceleration_deg_s2: f64,
}

impl Default for MotionRates {
    fn default() -> Self {
        MotionRates { speed_deg_s: 60.0, acceleration_deg_s2: 200.0 }
    }
}

/// A stage behind a [`Client`].
///
/// A motion lease that expired because this host was late is re-armed, and the motion repeated, a few times; what was exposed meanwhile is not
/// lost in silence, because [`Stage::sensors`] fails while a fault is latched.
#[derive(Debug)]
pub struct SerialStage {
    client: Client,
    rates: MotionRates,
}

impl SerialStage {
    /// Opens a serial port (or pseudo-terminal) at the default speed and greets the device there. A port that hangs up is looked
    /// for under the same name, unless `options` say how else.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn open(path: &str, options: Options) -> Result<SerialStage, DeviceError> {
        let transport = SerialTransport::open(path, serial::DEFAULT_BAUD)?;
        let name = path.to_owned();
        let again = move || {
            SerialTransport::open(&name, serial::DEFAULT_BAUD).map(|t| Box::new(t) as Box<dyn Transport>)
        };
        let reopen = options.reopen.clone().or_else(|| Some(Arc::new(again)));
        SerialStage::connect(Box::new(transport), Options { reopen, ..options })
    }

    /// Greets the device behind any transport.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn connect(transport: Box<dyn Transport>, options: Options) -> Result<SerialStage, DeviceError> {
        Ok(SerialStage { client: Client::connect(transport, options)?, rates: MotionRates::default() })
    }

    /// The same with other speeds.
    #[must_use]
    pub fn with_rates(mut self, rates: MotionRates) -> SerialStage {
        self.rates = rates;
        self
    }

    /// The client below.
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// The device's state, asked for now.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn status(&self) -> Result<Status, DeviceError> {
        match self.finish(Command::Status)? {
            Outcome::Status(status) => Ok(status),
            other => Err(self.unexpected("its status", other)),
        }
    }

    /// Pulses the camera's trigger line; gives the number of pulses since the device's start.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn trigger(&self, exposure: Duration) -> Result<u32, DeviceError> {
        let exposure_us = u32::try_from(exposure.as_micros()).unwrap_or(u32::MAX);
        match self.finish(Command::CameraTrigger { exposure_us })? {
            Outcome::Triggered { count } => Ok(count),
            other => Err(self.unexpected("a camera trigger", other)),
        }
    }

    /// Executes a command that does not take long.
    fn finish(&self, command: Command) -> Result<Outcome, DeviceError> {
        self.finish_pending(&self.client.start(command)?, command)
    }

    fn finish_pending(&self, pending: &Pending, command: Command) -> Result<Outcome, DeviceError> {
        pending.wait(PATIENCE).unwrap_or_else(|| Err(self.too_long(command)))
    }

    /// Executes a motion, again if a lease expired: a host that lives and was only late may re-arm by itself. Every other fault is
    /// the user's to clear.
    fn finish_motion(&self, command: Command, cancel: &Cancel) -> Result<Position, DeviceError> {
        self.persist(|| self.finish_motion_once(command, cancel))
    }

    fn persist<T>(&self, attempt: impl Fn() -> Result<T, DeviceError>) -> Result<T, DeviceError> {
        for n in 1..ATTEMPTS {
            match attempt() {
                Err(error) if error == super::fault_error(Fault::LeaseExpired) => {
                    tracing::warn!(n, "a heartbeat was late; re-arming and trying again");
                    self.finish(Command::Rearm)?;
                }
                ended => return ended,
            }
        }
        attempt()
    }

    /// A stop request stops it, waits until it stands and closes the shutter.
    fn finish_motion_once(&self, command: Command, cancel: &Cancel) -> Result<Position, DeviceError> {
        self.check(cancel)?;
        let pending = self.client.start(command)?;
        let start = Instant::now();
        loop {
            if let Some(result) = pending.wait(GLANCE) {
                return match result? {
                    Outcome::At(position) => Ok(position),
                    other => Err(self.unexpected("a motion", other)),
                };
            }
            self.check(cancel)?;
            if start.elapsed() > PATIENCE {
                self.make_safe()?;
                return Err(self.too_long(command));
            }
        }
    }

    /// Makes the device safe and gives [`DeviceError::Cancelled`] if a stop is asked for.
    fn check(&self, cancel: &Cancel) -> Result<(), DeviceError> {
        match cancel.state() {
            Stopping::No => return Ok(()),
            Stopping::Controlled => self.make_safe()?,
            Stopping::Emergency => self.client.emergency_stop()?,
        }
        Err(DeviceError::Cancelled)
    }

    fn make_safe(&self) -> Result<(), DeviceError> {
        let stop = self.client.start(Command::Stop)?;
        let close = self.client.start(Command::Shutter { open: false })?;
        self.finish_pending(&stop, Command::Stop)?;
        self.finish_pending(&close, Command::Shutter { open: false })?;
        Ok(())
    }

    fn too_long(&self, command: Command) -> DeviceError {
        DeviceError::Timeout {
            device: self.client.name().to_owned(),
            what: super::outcome::describe_command(command),
            waited: PATIENCE,
        }
    }

    fn unexpected(&self, what: &str, found: Outcome) -> DeviceError {
        DeviceError::Io {
            device: self.client.name().to_owned(),
            reason: format!("{what} was answered with {found:?}, which its firmware must not do"),
        }
    }
}

impl Stage for SerialStage {
    fn identity(&self) -> StageIdentity {
        self.client.identity()
    }

    fn home(&mut self, cancel: &Cancel) -> Result<(), DeviceError> {
        self.finish_motion(Command::Home, cancel).map(drop)
    }

    fn move_to(&mut self, pose: Pose, cancel: &Cancel) -> Result<Pose, DeviceError> {
        let command = Command::Move {
            tilt_udeg: micro("tilt", pose.tilt.degrees())?,
            spin_udeg: micro("spin", pose.spin.degrees())?,
            speed_udeg_s: micro("speed", self.rates.speed_deg_s)?.unsigned_abs(),
            accel_udeg_s2: micro("acceleration", self.rates.acceleration_deg_s2)?.unsigned_abs(),
        };
        let position = self.finish_motion(command, cancel)?;
        Ok(Pose::from_degrees(f64::from(position.tilt_udeg) / 1e6, f64::from(position.spin_udeg) / 1e6))
    }

    fn set_shutter(&mut self, open: bool) -> Result<(), DeviceError> {
        self.persist(|| self.finish(Command::Shutter { open }).map(drop))
    }

    fn set_lamp(&mut self, level: f64, cancel: &Cancel) -> Result<(), DeviceError> {
        self.check(cancel)?;
        if !(0.0..=1.0).contains(&level) {
            return Err(DeviceError::Refused {
                command: format!("the lamp level {level}"),
                reason: "the level must be 0 to 1".to_owned(),
            });
        }
        let level_ppm = (level * 1e6).round() as u32;
        self.persist(|| self.finish(Command::Lamp { on: level_ppm > 0, level_ppm }))?;
        if level_ppm == 0 {
            return Ok(());
        }
        let start = Instant::now();
        loop {
            let status = self.status()?;
            if status.lamp_warm {
                return Ok(());
            }
            if let Some(fault) = status.fault {
                return Err(super::fault_error(fault));
            }
            if !status.lamp_on || start.elapsed() > WARM_UP {
                return Err(DeviceError::Timeout {
                    device: self.client.name().to_owned(),
                    what: "that its lamp is warm".to_owned(),
                    waited: start.elapsed(),
                });
            }
            self.check(cancel)?;
            std::thread::sleep(GLANCE);
        }
    }

    fn sensors(&mut self) -> Result<Sensors, DeviceError> {
        // Asked together: a fault since the last command, with the shutter closed by it, must not pass for a dark sample.
        let status = self.client.start(Command::Status)?;
        let sensors = self.client.start(Command::Sensors)?;
        if let Outcome::Status(Status { fault: Some(fault), .. }) =
            self.finish_pending(&status, Command::Status)?
        {
            if fault == Fault::LeaseExpired {
                // told once, so that what was under way is done again; the host lives and may re-arm by itself
                self.finish(Command::Rearm)?;
            }
            return Err(super::fault_error(fault));
        }
        match self.finish_pending(&sensors, Command::Sensors)? {
            Outcome::Sensors(readings) => Ok(Sensors {
                lamp_monitor: f64::from(readings.lamp_monitor_ppm) / 1e6,
                temperature_c: f64::from(readings.lamp_mc) / 1e3,
                sample_height_mm: f64::from(readings.sample_height_um) / 1e3,
                interlock_closed: readings.interlock_closed,
            }),
            other => Err(self.unexpected("reading the sensors", other)),
        }
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.finish(Command::Stop).map(drop)
    }

    fn emergency_stop(&mut self) -> Result<(), DeviceError> {
        self.client.emergency_stop()?;
        // The datagram may be lost and repeated: only the latched fault shows that the device has heard it.
        let start = Instant::now();
        while self.status()?.fault.is_none() {
            if start.elapsed() > CONFIRMATION {
                return Err(DeviceError::Timeout {
                    device: self.client.name().to_owned(),
                    what: "an emergency stop".to_owned(),
                    waited: CONFIRMATION,
                });
            }
            std::thread::sleep(GLANCE);
        }
        Ok(())
    }

    fn rearm(&mut self) -> Result<(), DeviceError> {
        self.finish(Command::Rearm).map(drop)
    }

    fn statistics(&self) -> LinkStatistics {
        self.client.statistics()
    }
}

/// Degrees to whole micro-degrees; refused beyond ±2147°, where the wire ends.
fn micro(what: &str, degrees: f64) -> Result<i32, DeviceError> {
    let udeg = (degrees * 1e6).round();
    if udeg.is_finite() && udeg.abs() <= f64::from(i32::MAX) {
        Ok(udeg as i32)
    } else {
        Err(DeviceError::Refused {
            command: format!("{what} {degrees}°"),
            reason: "positions and rates must lie within ±2147°".to_owned(),
        })
    }
}
