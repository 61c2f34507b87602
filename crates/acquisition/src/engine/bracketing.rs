//! The frames of a pose: take, read the lamp, keep; which comes next.

use std::time::Duration;

use gonio_instrument::ScanKind;

use super::{Action, Engine, Event, Frame, State};
use crate::bracket::Bracket;

/// Lamp monitor at and below which there is no light to speak of.
const LAMP_OUT: f64 = 0.01;

impl Engine {
    /// What follows the beginning of a pose.
    pub(super) fn begin_frames(&mut self) -> State {
        // a continued scan begins a bracket where the uninterrupted one would: by the pose before it in the plan
        let before = self.index().checked_sub(1).and_then(|i| self.setup.hints.get(&i));
        let guess = before.copied().unwrap_or(self.hint);
        self.bracket = Bracket::new(self.setup.exposure_s, self.setup.max_exposures, guess);
        if !self.setup.series.is_empty() {
            self.bracket = Bracket::series(&self.setup.series);
        }
        self.repeat = 0;
        self.tries = 0;
        let with_dark = self.setup.kind == ScanKind::Dark || self.index() == 0;
        if with_dark && !self.setup.dark_exposures.is_empty() {
            self.requested = self.setup.dark_exposures[0];
            return State::Dark { k: 0 };
        }
        self.expose_or_end()
    }

    fn expose_or_end(&mut self) -> State {
        if self.setup.kind == ScanKind::Dark {
            return State::EndPose;
        }
        self.tries = 0;
        match self.bracket.proposal() {
            Some(t) => {
                self.requested = t;
                State::Open
            }
            None => State::EndPose,
        }
    }

    pub(super) const fn frame_action(&self, light: bool) -> Action {
        match self.frame {
            Frame::Idle => Action::Capture { exposure: self.requested, light },
            Frame::Taken => Action::ReadSensors,
            Frame::Read(lamp_monitor) => {
                Action::Record { requested: self.requested, lamp_monitor, shutter_open: light }
            }
        }
    }

    /// One step of a frame; `true` when it has been kept.
    fn frame_step(&mut self, event: &Event) -> bool {
        self.frame = match (self.frame, event) {
            (Frame::Idle, Event::Frame(summary)) => {
                self.summary = *summary;
                Frame::Taken
            }
            (Frame::Taken, Event::Sensors(s)) => Frame::Read(s.lamp_monitor),
            (Frame::Read(_), _) => {
                self.frames += 1;
                self.tries = 0;
                self.frame = Frame::Idle;
                return true;
            }
            // an answer to something else: ask again
            (f, _) => f,
        };
        false
    }

    pub(super) fn dark_frame(&mut self, k: usize, event: &Event) {
        if !self.frame_step(event) {
            return;
        }
        self.state = match self.setup.dark_exposures.get(k + 1) {
            Some(t) => {
                self.requested = *t;
                State::Dark { k: k + 1 }
            }
            None => self.expose_or_end(),
        };
    }

    pub(super) fn light_frame(&mut self, event: &Event) {
        if let (Frame::Taken, Event::Sensors(s)) = (self.frame, event)
            && (s.lamp_monitor.is_nan() || s.lamp_monitor <= LAMP_OUT)
        {
            return self.relight_or_fail(s.lamp_monitor);
        }
        if let (Frame::Taken, Event::Sensors(s)) = (self.frame, event)
            && self.suspend_for_sensors(s)
        {
            return;
        }
        if let (Frame::Idle, Event::Frame(summary)) = (self.frame, event)
            && self.suspend_for_light(summary)
        {
            return;
        }
        if !self.frame_step(event) {
            return;
        }
        self.repeat += 1;
        if self.repeat < self.setup.repeats {
            return;
        }
        self.repeat = 0;
        let mut summary = self.summary;
        if summary.exposure_s <= 0.0 {
            summary.exposure_s = self.requested.as_secs_f64();
        }
        self.bracket.add(summary);
        let before = self.requested;
        match self.bracket.proposal() {
            Some(t) if t != before => self.requested = t,
            _ => self.state = State::Close,
        }
    }
}

/// Dark exposures of a scan: the shortest and the longest the camera can, four of each.
#[must_use]
pub fn dark_exposures(limits_s: [f64; 2]) -> Vec<Duration> {
    let [short, long] = limits_s.map(Duration::from_secs_f64);
    [[short; 4], [long; 4]].concat()
}
