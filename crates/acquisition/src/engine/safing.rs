//! Leaving the device safe: whatever fails on the way, every step is tried.

use super::{Action, Event};

/// The steps that are left.
#[derive(Clone, Debug)]
pub(super) struct Safing {
    steps: Vec<Action>,
    emergency_done: bool,
}

impl Safing {
    /// Motion first, then light, then the journal; an emergency stop goes before all of it.
    pub(super) fn new(emergency: bool, pose_open: bool, lamp_on: bool) -> Self {
        let mut steps = Vec::new();
        if emergency {
            steps.push(Action::EmergencyStop);
        }
        steps.extend([Action::StopMotion, Action::Shutter(false)]);
        if pose_open {
            steps.push(Action::GiveUpPose);
        }
        if lamp_on {
            steps.push(Action::Lamp(0.0));
        }
        Self { steps, emergency_done: emergency }
    }

    pub(super) fn action(&self) -> Option<Action> {
        self.steps.first().cloned()
    }

    /// An emergency stop asked for while safing.
    pub(super) fn escalate(&mut self) {
        if !self.emergency_done {
            self.emergency_done = true;
            // the action under way stays first: it is the one that will be answered
            let at = usize::from(!self.steps.is_empty());
            self.steps.insert(at, Action::EmergencyStop);
        }
    }

    /// Goes on; motion or shutter that cannot be brought to rest in the ordinary way is stopped by force.
    pub(super) fn answer(&mut self, event: &Event) {
        if self.steps.is_empty() {
            return;
        }
        let done = self.steps.remove(0);
        let failed = matches!(event, Event::Failed(_));
        if failed && matches!(done, Action::StopMotion | Action::Shutter(false)) && !self.emergency_done {
            self.emergency_done = true;
            self.steps.insert(0, Action::EmergencyStop);
        }
    }
}
