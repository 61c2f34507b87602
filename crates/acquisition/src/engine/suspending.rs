//! Waiting for what passes: an open lid, a hot lamp, a lamp off its level, stray light. The pose under way stays open, the shutter is closed,
//! and once it has passed the scan goes on with the frame it was at.

use std::time::Duration;

use gonio_instrument::{DeviceError, Sensors};

use super::{Action, Engine, Event, Frame, ScanError, State};
use crate::bracket::FrameSummary;

/// How often is looked whether it has passed.
const LOOK: Duration = Duration::from_secs(1);
/// Share of the pixels saturated at the shortest exposure from which on it is stray light, and no sample.
const FLOODED: f64 = 0.5;

/// What suspends a scan, besides faults of the device that pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspenders {
    /// Largest relative departure of the lamp monitor from its value at the scan's first frame.
    pub lamp: f64,
    /// Highest temperature of the lamp's housing, °C.
    pub temperature_c: f64,
    /// How long anything is waited for before the scan ends.
    pub patience: Duration,
}

impl Default for Suspenders {
    fn default() -> Self {
        Self { lamp: 0.1, temperature_c: 80.0, patience: Duration::from_secs(600) }
    }
}

/// Who says when it has passed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Until {
    /// The device lets itself be re-armed.
    Rearmed,
    /// The sensors read well.
    SensorsAreWell,
    /// Some time has gone: the next frame tells.
    Later,
}

/// A wait.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Suspension {
    until: Until,
    why: DeviceError,
    since: Duration,
    looked: Duration,
    back: State,
}

impl Engine {
    /// Why the scan waits, in words; `None` while it goes on.
    #[must_use]
    pub fn suspended(&self) -> Option<String> {
        self.suspension.as_ref().map(|s| s.why.to_string())
    }

    /// A fault of the device that passes: everything is done again from where it stands.
    pub(super) fn suspend_for_device(&mut self, error: DeviceError) {
        let back = match self.state {
            State::Open | State::Expose => State::Open,
            State::Begin | State::Move => State::Move,
            State::Shade | State::Suspended | State::Relight => {
                self.suspension.as_ref().map_or(State::Shut, |s| s.back)
            }
            other => other,
        };
        self.suspend(Until::Rearmed, error, back);
    }

    /// The sensors beside a lit frame: whether the scan can go on with them.
    pub(super) fn suspend_for_sensors(&mut self, sensors: &Sensors) -> bool {
        let Some(error) = self.unwell(sensors) else {
            self.lamp_reference.get_or_insert(sensors.lamp_monitor);
            self.relit = false;
            return false;
        };
        self.suspend(Until::SensorsAreWell, error, State::Open);
        true
    }

    /// A lamp that gives no light. A device puts its lamp out when it has not heard of its host for a minute, as after a sleep: it is lit once more, and the frame
    /// taken again. A lamp that stays dark then is out.
    pub(super) fn relight_or_fail(&mut self, monitor: f64) {
        let found = format!("a lamp monitor of {monitor}");
        if std::mem::replace(&mut self.relit, true) {
            let advice = "the lamp is out; replace it and continue with --resume".to_owned();
            return self.fail(ScanError::Device(DeviceError::Fault { fault: found, advice }));
        }
        self.suspend(Until::Rearmed, fault(found, "it is lit again"), State::Open);
    }

    /// A frame that is all light at the shortest exposure.
    pub(super) fn suspend_for_light(&mut self, summary: &FrameSummary) -> bool {
        let shortest = summary.exposure_s <= self.setup.exposure_s[0] * 1.01;
        if !(shortest && summary.saturated_share >= FLOODED) {
            return false;
        }
        let error = fault(
            format!(
                "{:.0} % of the pixels saturated at the shortest exposure",
                summary.saturated_share * 100.0
            ),
            "keep other light out, or dim the lamp",
        );
        self.suspend(Until::Later, error, State::Open);
        true
    }

    fn unwell(&self, sensors: &Sensors) -> Option<DeviceError> {
        let limits = &self.setup.suspenders;
        let reference = self.lamp_reference.unwrap_or(sensors.lamp_monitor);
        if (sensors.lamp_monitor / reference - 1.0).abs() > limits.lamp {
            let found = format!("a lamp monitor of {:.3} where it was {reference:.3}", sensors.lamp_monitor);
            return Some(fault(found, "let the lamp settle, or replace it"));
        }
        if sensors.temperature_c > limits.temperature_c {
            let found = format!("a lamp housing of {:.1} °C", sensors.temperature_c);
            return Some(fault(found, "let the lamp cool and see to its fan"));
        }
        if !sensors.interlock_closed {
            return Some(fault("an open interlock".to_owned(), "close the lid"));
        }
        None
    }

    fn suspend(&mut self, until: Until, why: DeviceError, back: State) {
        self.frame = Frame::Idle;
        // a wait that comes back at once is the same wait
        let since = match &self.suspension {
            Some(s) => s.since,
            None => match self.resumed_at {
                Some((at, since)) if self.elapsed.saturating_sub(at) < 2 * LOOK => since,
                _ => self.elapsed,
            },
        };
        if self.suspension.is_none() {
            self.note(true, format!("suspended: {why}"));
        }
        self.suspension = Some(Suspension { until, why, since, looked: self.elapsed, back });
        self.state = State::Shade;
    }

    /// Nothing to do but wait.
    pub(super) fn is_waiting(&self) -> bool {
        self.state == State::Suspended
            && self.suspension.as_ref().is_some_and(|s| self.elapsed.saturating_sub(s.looked) < LOOK)
    }

    pub(super) fn look(&self) -> Action {
        match self.suspension.as_ref().map(|s| s.until) {
            Some(Until::Rearmed) => Action::Rearm,
            _ => Action::ReadSensors,
        }
    }

    /// What looking has shown.
    pub(super) fn looked(&mut self, event: &Event) {
        let Some(s) = &self.suspension else {
            self.state = State::Shut;
            return;
        };
        let passed = match (s.until, event) {
            (Until::Rearmed, Event::Done) => {
                self.state = if self.lamp_on { State::Relight } else { s.back };
                if !self.lamp_on {
                    self.go_on();
                }
                return;
            }
            (Until::SensorsAreWell, Event::Sensors(sensors)) => self.unwell(sensors).is_none(),
            (Until::Later, Event::Sensors(_)) => true,
            _ => false,
        };
        if passed {
            self.go_on();
        } else {
            self.wait_on();
        }
    }

    /// It has not passed.
    pub(super) fn wait_on(&mut self) {
        let Some(s) = &mut self.suspension else { return };
        s.looked = self.elapsed;
        self.state = State::Suspended;
        if self.elapsed.saturating_sub(s.since) > self.setup.suspenders.patience {
            let why = s.why.clone();
            self.suspension = None;
            self.fail(ScanError::Device(why));
        }
    }

    /// It has passed.
    pub(super) fn go_on(&mut self) {
        let Some(s) = self.suspension.take() else { return };
        self.state = s.back;
        self.resumed_at = Some((self.elapsed, s.since));
        let waited = self.elapsed.saturating_sub(s.since).as_secs_f64();
        self.note(false, format!("goes on after {waited:.1} s"));
    }
}

fn fault(fault: String, advice: &str) -> DeviceError {
    DeviceError::Suspended { fault, advice: advice.to_owned() }
}
