//! What fails, and what is done about it: a frame is taken again, a pose given up or begun anew, the scan suspended or ended.

use gonio_instrument::DeviceError;

use super::safing::Safing;
use super::{Engine, Event, Frame, LostPose, Outcome, ScanError, State, TRIES};

impl Engine {
    /// Gives the pose under way up and goes on with the next.
    pub(super) fn lose(&mut self, reason: String) {
        let index = self.index();
        self.note(true, format!("pose {index} is given up: {reason}"));
        self.lost.push(LostPose { index, reason });
        self.frame = Frame::Idle;
        self.state = if self.pose_open { State::Close } else { State::Halt };
    }

    pub(super) fn failed(&mut self, e: DeviceError) {
        match (&e, self.state) {
            (DeviceError::Cancelled, _) => {
                let emergency = self.abort.unwrap_or(false);
                self.end(Outcome::Aborted { emergency, remaining: self.remaining() }, emergency);
            }
            // one more try for a frame that came damaged or not at all
            (
                DeviceError::BadFrame { .. } | DeviceError::Timeout { .. },
                State::Dark { .. } | State::Expose,
            ) if self.frame == Frame::Idle => {
                self.tries += 1;
                if self.tries >= TRIES {
                    self.lose(e.to_string());
                } else {
                    self.note_again(&e);
                }
            }
            // a fault that closed the shutter spoils the frame; what can be re-armed has been, what cannot refuses the next command
            (DeviceError::Fault { .. }, State::Dark { .. } | State::Expose) if self.frame == Frame::Taken => {
                self.frame = Frame::Idle;
                self.tries += 1;
                if self.tries >= TRIES {
                    self.fail(ScanError::Device(e));
                } else {
                    self.note_again(&e);
                    if self.state == State::Expose {
                        self.state = State::Open;
                    }
                }
            }
            // left behind by whoever was here before
            (DeviceError::Fault { .. } | DeviceError::Suspended { .. }, State::CheckSensors)
                if self.tries == 0 =>
            {
                self.tries = 1;
            }
            (DeviceError::Suspended { .. } | DeviceError::Fault { .. }, State::Suspended) => self.wait_on(),
            // it has switched the lamp off itself
            (DeviceError::Suspended { .. }, State::LampOff) => self.advance(&Event::Done),
            (DeviceError::Suspended { .. }, s) if s.waits() => self.suspend_for_device(e),
            (DeviceError::PositionsVoid { .. }, s) if s.waits() => self.begin_anew(e),
            (DeviceError::NotRecorded { .. }, State::Move | State::Dark { .. } | State::Expose) => {
                self.lose(e.to_string());
            }
            _ => self.fail(ScanError::Device(e)),
        }
    }

    /// Nobody knows any more where the sample stands: home, and take the pose under way from its beginning.
    pub(super) fn begin_anew(&mut self, e: DeviceError) {
        self.beginnings += 1;
        if self.beginnings > TRIES {
            return self.fail(ScanError::Device(e));
        }
        self.note(true, format!("pose {} begins anew: {e}", self.index()));
        self.frame = Frame::Idle;
        self.suspension = None;
        self.anew = self.pose_open;
        self.state = if self.pose_open { State::Close } else { State::Shut };
    }

    pub(super) fn fail(&mut self, error: ScanError) {
        self.end(Outcome::Failed { error, remaining: self.remaining() }, false);
    }

    pub(super) fn end(&mut self, outcome: Outcome, emergency: bool) {
        self.outcome = Some(outcome);
        self.safing = Some(Safing::new(emergency, self.pose_open, self.lamp_on));
        self.state = State::Safing;
        self.frame = Frame::Idle;
    }
}
