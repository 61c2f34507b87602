//! How far a scan is, and how long it will still take.

use gonio_instrument::Pose;

use super::{Action, Engine, Event, Phase, Progress, State};

/// Least cosine, so that a grazing tilt does not promise an eternity.
const LEAST_COS: f64 = 0.05;

impl Engine {
    /// How far the scan is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let total = self.setup.poses.len() as u32;
        // of a scan that ends early, the plan ahead shrinks: what an earlier run did is counted by itself
        let earlier = self.setup.done.iter().filter(|i| **i < total).count() as u32;
        let run = self.todo.len() as u32;
        let each = if self.done > 0 { f64::from(self.frames) / f64::from(self.done) } else { 6.0 };
        let ahead = self.todo.get(self.at..).unwrap_or(&[]);
        let ahead: Vec<(Pose, f64)> = ahead
            .iter()
            .filter_map(|&i| Some((*self.setup.poses.get(i as usize)?, self.exposure_need(i))))
            .collect();
        let remaining = self.timing.remaining(&ahead);
        Progress {
            phase: self.phase(),
            poses_done: earlier + self.done,
            poses_total: total,
            exposures_done: self.frames,
            exposures_total: self.frames.max((each * f64::from(run)).round() as u32),
            remaining,
        }
    }

    /// What the darkest pixels of a pose need, relative to each other.
    fn exposure_need(&self, index: u32) -> f64 {
        let by_tilt = || {
            let cos = self.setup.poses.get(index as usize).map_or(1.0, |p| p.tilt.radians().cos());
            1.0 / cos.max(LEAST_COS)
        };
        self.setup.exposure_needs.get(index as usize).copied().unwrap_or_else(by_tilt)
    }

    /// How long the action took that this event answers.
    pub(super) fn learn(&mut self, event: &Event) {
        let Some((action, began)) = self.acting.take() else { return };
        let took = self.elapsed.saturating_sub(began);
        match (&action, event) {
            (Action::MoveTo { pose, .. }, Event::Moved(_)) => {
                let need = self.exposure_need(self.index());
                self.timing.moved(*pose, need, took);
            }
            (_, Event::Failed(_) | Event::JournalFailed(_)) => {}
            _ => self.timing.acted(&action, took),
        }
    }

    pub(super) fn phase(&self) -> Phase {
        match self.state {
            State::Ended => Phase::Ended,
            State::Safing => Phase::Safing,
            _ if self.paused && !self.in_flight => Phase::Paused,
            State::CheckJournal | State::CheckSensors | State::Shut => Phase::Preflight,
            State::Home => Phase::Homing,
            State::Shade | State::Suspended | State::Relight => Phase::Suspended,
            State::LampOn | State::LampOff => Phase::Lamp,
            State::Move | State::Begin | State::Halt => Phase::Moving,
            State::Dark { .. } => Phase::Dark,
            State::Open | State::Expose | State::Close | State::EndPose | State::GiveUp => Phase::Exposing,
        }
    }
}
