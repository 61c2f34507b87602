//! What happened in words, for the journal and the log: every change of state is one.

use gonio_instrument::DeviceError;

use super::{Engine, Phase};

/// One thing that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Something went wrong.
    pub serious: bool,
    /// What happened.
    pub text: String,
}

impl Engine {
    /// What happened since the last call, oldest first.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    pub(super) fn note(&mut self, serious: bool, text: String) {
        self.notes.push(Note { serious, text });
    }

    /// Notes a change of phase or pose.
    pub(super) fn note_phase(&mut self) {
        let now = (self.phase(), self.at);
        if self.noted == Some(now) {
            return;
        }
        self.noted = Some(now);
        let text = match now.0 {
            Phase::Preflight => "preflight".to_owned(),
            Phase::Homing => "homing".to_owned(),
            Phase::Lamp => "lamp".to_owned(),
            Phase::Moving => format!("moving to pose {} ({})", self.index(), self.pose()),
            Phase::Dark => format!("dark frames at pose {}", self.index()),
            Phase::Exposing => format!("exposing pose {}", self.index()),
            Phase::Paused => "paused".to_owned(),
            Phase::Suspended => "waiting".to_owned(),
            Phase::Safing => "making the device safe".to_owned(),
            Phase::Ended => return,
        };
        self.note(false, text);
    }

    /// A frame that is taken again.
    pub(super) fn note_again(&mut self, why: &DeviceError) {
        let (tries, index) = (self.tries, self.index());
        self.note(true, format!("a frame of pose {index} is taken again ({tries}): {why}"));
    }
}
