//! The course of a scan: which action a state asks for, and which state follows its answer.

use gonio_instrument::ScanKind;

use super::{Action, Engine, Event, Frame, Outcome, ScanError, State};

impl Engine {
    /// What the state asks for.
    pub(super) fn action(&self) -> Option<Action> {
        Some(match self.state {
            State::CheckJournal => Action::CheckJournal,
            State::CheckSensors => Action::ReadSensors,
            State::Shut | State::Close | State::Shade => Action::Shutter(false),
            State::Home => Action::Home,
            State::LampOn | State::Relight => Action::Lamp(1.0),
            State::Suspended => self.look(),
            State::Move => Action::MoveTo { index: self.index(), pose: self.pose() },
            State::Begin => {
                Action::BeginPose { index: self.index(), commanded: self.pose(), readback: self.readback }
            }
            State::Dark { .. } => self.frame_action(false),
            State::Open => Action::Shutter(true),
            State::Expose => self.frame_action(true),
            State::EndPose => Action::EndPose,
            State::GiveUp => Action::GiveUpPose,
            State::Halt => Action::StopMotion,
            State::LampOff => Action::Lamp(0.0),
            State::Safing => self.safing.as_ref()?.action()?,
            State::Ended => return None,
        })
    }

    /// Takes what came of it.
    pub(super) fn answer(&mut self, event: Event) {
        if self.state == State::Safing {
            if let Some(s) = &mut self.safing {
                s.answer(&event);
            }
            return;
        }
        match event {
            Event::Failed(e) => self.failed(e),
            Event::JournalFailed(e) => self.fail(ScanError::Journal(e)),
            event => self.advance(&event),
        }
    }

    pub(super) fn advance(&mut self, event: &Event) {
        self.state = match self.state {
            State::CheckJournal => State::CheckSensors,
            State::CheckSensors => {
                if let Event::Sensors(s) = event
                    && let Err(e) = self.setup.check_sensors(s)
                {
                    return self.end(Outcome::Refused(e), false);
                }
                State::Shut
            }
            State::Shut => State::Home,
            State::Home if self.setup.kind == ScanKind::Dark => self.next_pose(),
            State::Home => State::LampOn,
            State::LampOn => {
                self.lamp_on = true;
                self.next_pose()
            }
            State::Move => {
                if let Event::Moved(p) = event {
                    self.readback = *p;
                }
                State::Begin
            }
            State::Begin => {
                self.pose_open = true;
                self.frame = Frame::Idle;
                self.begin_frames()
            }
            State::Open => State::Expose,
            State::Dark { k } => return self.dark_frame(k, event),
            State::Expose => return self.light_frame(event),
            State::Close => {
                if self.anew || self.lost.last().is_some_and(|l| l.index == self.index()) {
                    State::GiveUp
                } else {
                    State::EndPose
                }
            }
            State::EndPose => {
                self.pose_open = false;
                self.timing.done(self.bracket.needed_s());
                self.hint = self.bracket.hint();
                self.beginnings = 0;
                self.done += 1;
                self.at += 1;
                self.next_pose()
            }
            State::Halt => {
                self.at += 1;
                self.next_pose()
            }
            State::GiveUp => {
                self.pose_open = false;
                self.timing.given_up();
                if std::mem::take(&mut self.anew) {
                    State::Shut
                } else {
                    self.beginnings = 0;
                    self.at += 1;
                    self.next_pose()
                }
            }
            State::Shade => State::Suspended,
            State::Suspended => return self.looked(event),
            State::Relight => return self.go_on(),
            State::LampOff => {
                let lost = std::mem::take(&mut self.lost);
                self.outcome = Some(if lost.is_empty() { Outcome::Done } else { Outcome::Partial { lost } });
                State::Ended
            }
            s @ (State::Safing | State::Ended) => s,
        };
    }

    pub(super) fn next_pose(&mut self) -> State {
        self.tries = 0;
        if self.at < self.todo.len() {
            return State::Move;
        }
        if self.lamp_on {
            return State::LampOff;
        }
        let lost = std::mem::take(&mut self.lost);
        self.outcome = Some(if lost.is_empty() { Outcome::Done } else { Outcome::Partial { lost } });
        State::Ended
    }
}
