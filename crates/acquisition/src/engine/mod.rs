//! The scan as a state machine without clock, thread or I/O: [`Engine::step`] says what to do, [`Engine::handle`] takes what came of it.
//!
//! preflight (journal, sensors, shutter closed) → home → lamp → for each pose: move, dark frames (at the plan's first pose, shutter closed),
//! shutter open, bracket, shutter closed, pose done → lamp off → finished. However it ends, the last things asked for are: motion stopped, shutter
//! closed, the open pose given up, the journal closed. One action is under way at a time; pause, abort and emergency
//! may come at any instant. What passes by itself or by a hand (lid, lamp, heat, stray light) suspends the scan and is waited for; a device that
//! has restarted is homed, and the pose under way begun anew.

mod bracketing;
mod failing;
mod notes;
pub mod preflight;
mod progress;
mod remaining;
mod safing;
pub mod setup;
mod suspending;

use std::time::Duration;

use gonio_instrument::{DeviceError, Pose, ScanKind, Sensors};
use gonio_recording::RecordingError;

use crate::bracket::{Bracket, FrameSummary};
pub use notes::Note;
pub use preflight::PreflightError;
use remaining::Timing;
use safing::Safing;
pub use setup::Setup;
pub use suspending::Suspenders;
use suspending::Suspension;

/// How often a frame is tried before its pose is given up.
pub const TRIES: u32 = 3;

/// Something to do now. Each is answered by exactly one [`Event`].
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// See whether the journal can take the scan: [`Event::Done`] or [`Event::JournalFailed`].
    CheckJournal,
    /// Read the sensors: [`Event::Sensors`].
    ReadSensors,
    /// Find the reference marks.
    Home,
    /// Set the lamp's level and wait until it is warm.
    Lamp(f64),
    /// Move and settle: [`Event::Moved`].
    MoveTo {
        /// Place in the plan.
        index: u32,
        /// Where to.
        pose: Pose,
    },
    /// Open or close the shutter.
    Shutter(bool),
    /// Begin the pose in the journal.
    BeginPose {
        /// Place in the plan.
        index: u32,
        /// Where the plan wants it.
        commanded: Pose,
        /// Where the encoders say it is.
        readback: Pose,
    },
    /// Take a frame: [`Event::Frame`].
    Capture {
        /// Exposure asked for.
        exposure: Duration,
        /// Whether the lamp's light falls in.
        light: bool,
    },
    /// Keep the frame just taken, with this lamp monitor.
    Record {
        /// Exposure asked for.
        requested: Duration,
        /// Lamp monitor.
        lamp_monitor: f64,
        /// Whether the shutter was open.
        shutter_open: bool,
    },
    /// End the pose in the journal: it is on the disk when [`Event::Done`] comes.
    EndPose,
    /// Give the open pose up in the journal.
    GiveUpPose,
    /// Clear the device's fault, if its cause is gone.
    Rearm,
    /// Stop all motion in a controlled way.
    StopMotion,
    /// Stop everything at once, shutter closed, lamp off.
    EmergencyStop,
}

/// What came of an action, or what somebody asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The action is done.
    Done,
    /// The stage stands here.
    Moved(Pose),
    /// What the sensors say.
    Sensors(Sensors),
    /// A frame was taken.
    Frame(FrameSummary),
    /// The action failed.
    Failed(DeviceError),
    /// The journal could not keep something.
    JournalFailed(RecordingError),
    /// Hold after the frame under way.
    Pause,
    /// Go on.
    Resume,
    /// End in a controlled way.
    Abort,
    /// End at once.
    Emergency,
    /// Time since the scan began.
    Tick(Duration),
}

/// What the engine wants.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Do this, then [`Engine::handle`] its event.
    Do(Action),
    /// Paused: wait for [`Event::Resume`] or an end.
    Wait,
    /// The scan is over.
    End(Outcome),
}

/// A pose that is missing, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct LostPose {
    /// Place in the plan.
    pub index: u32,
    /// What went wrong.
    pub reason: String,
}

/// What follows a pose, as whoever watches the scan wants it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The next of the plan.
    #[default]
    AsPlanned,
    /// This place in the plan.
    This(u32),
    /// No further pose is needed: the scan ends as after its last one.
    Enough,
}

/// How a scan ended. Whatever it says, the device was left safe and what was measured is kept.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Every pose is measured.
    Done,
    /// Some poses are missing, against the plan.
    Partial {
        /// Which.
        lost: Vec<LostPose>,
    },
    /// Ended on request; continue with `--resume`.
    Aborted {
        /// Whether it was the emergency stop.
        emergency: bool,
        /// Poses not taken.
        remaining: u32,
    },
    /// Not begun.
    Refused(PreflightError),
    /// Ended by an error.
    Failed {
        /// What went wrong.
        error: ScanError,
        /// Poses not taken.
        remaining: u32,
    },
}

/// What ends a scan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScanError {
    /// The stage or the camera.
    #[error("{0}; poses already measured are kept, continue with --resume")]
    Device(DeviceError),
    /// The recording.
    #[error("{0}; poses already measured are kept, make room and continue with --resume")]
    Journal(RecordingError),
}

/// What is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Checking.
    Preflight,
    /// Homing.
    Homing,
    /// The lamp warms up.
    Lamp,
    /// Moving to a pose.
    Moving,
    /// Taking dark frames.
    Dark,
    /// Taking frames.
    Exposing,
    /// Held.
    Paused,
    /// Waiting for something to pass.
    Suspended,
    /// Making the device safe.
    Safing,
    /// Over.
    Ended,
}

/// How far the scan is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is under way.
    pub phase: Phase,
    /// Poses done, those of earlier runs included.
    pub poses_done: u32,
    /// Poses of the plan.
    pub poses_total: u32,
    /// Frames kept in this run.
    pub exposures_done: u32,
    /// Frames that the whole run will take, by what the poses so far took.
    pub exposures_total: u32,
    /// Time left, once a pose of this run is done.
    pub remaining: Option<Duration>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    CheckJournal,
    CheckSensors,
    /// Whoever was here before may have left the shutter open.
    Shut,
    Home,
    LampOn,
    Move,
    Begin,
    Dark {
        k: usize,
    },
    Open,
    Expose,
    Close,
    EndPose,
    GiveUp,
    /// A move failed: whatever still turns is stopped before the next.
    Halt,
    /// Suspended: the shutter closes.
    Shade,
    /// Suspended: waiting.
    Suspended,
    /// It has passed: the lamp is switched on again.
    Relight,
    LampOff,
    Safing,
    Ended,
}

impl State {
    /// Whether the scan can stand still here, and go on later or anew.
    const fn waits(self) -> bool {
        !matches!(
            self,
            Self::CheckJournal
                | Self::CheckSensors
                | Self::Begin
                | Self::EndPose
                | Self::GiveUp
                | Self::LampOff
                | Self::Safing
                | Self::Ended
        )
    }
}

/// Where the frame under way stands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Frame {
    /// None: one is to be taken.
    Idle,
    /// Taken, the lamp is to be read.
    Taken,
    /// To be kept with this lamp monitor.
    Read(f64),
}

/// The scan.
#[derive(Clone, Debug)]
pub struct Engine {
    setup: Setup,
    /// Places in the plan still to take, in order.
    todo: Vec<u32>,
    at: usize,
    state: State,
    frame: Frame,
    bracket: Bracket,
    /// Exposure from which a bracket begins: what was of use at the pose before.
    hint: Duration,
    repeat: u32,
    requested: Duration,
    summary: FrameSummary,
    tries: u32,
    readback: Pose,
    paused: bool,
    in_flight: bool,
    abort: Option<bool>,
    safing: Option<Safing>,
    pose_open: bool,
    lamp_on: bool,
    lost: Vec<LostPose>,
    outcome: Option<Outcome>,
    done: u32,
    frames: u32,
    elapsed: Duration,
    /// Lamp monitor at the first lit frame.
    lamp_reference: Option<f64>,
    suspension: Option<Suspension>,
    /// When the last suspension ended, and when it had begun.
    resumed_at: Option<(Duration, Duration)>,
    /// The pose under way is given up to be begun anew.
    anew: bool,
    /// How often that was done for this pose.
    beginnings: u32,
    timing: Timing,
    /// Action under way, and when it began.
    acting: Option<(Action, Duration)>,
    notes: Vec<Note>,
    noted: Option<(Phase, usize)>,
}

impl Engine {
    /// A scan of what is left of the plan.
    #[must_use]
    pub fn new(setup: Setup) -> Self {
        let todo: Vec<u32> = (0..setup.poses.len() as u32).filter(|i| !setup.done.contains(i)).collect();
        let bracket = Bracket::new(setup.exposure_s, setup.max_exposures, setup.first_exposure);
        let mut engine = Self {
            todo,
            at: 0,
            state: State::CheckJournal,
            frame: Frame::Idle,
            bracket,
            hint: setup.first_exposure,
            repeat: 0,
            requested: Duration::ZERO,
            summary: FrameSummary::default(),
            tries: 0,
            readback: Pose::default(),
            paused: false,
            in_flight: false,
            abort: None,
            safing: None,
            pose_open: false,
            lamp_on: false,
            lost: Vec::new(),
            outcome: None,
            done: 0,
            frames: 0,
            elapsed: Duration::ZERO,
            lamp_reference: None,
            suspension: None,
            resumed_at: None,
            anew: false,
            beginnings: 0,
            timing: Timing::new(setup.exposure_s[1]),
            acting: None,
            notes: Vec::new(),
            noted: None,
            setup,
        };
        if let Err(e) = engine.setup.check() {
            engine.outcome = Some(Outcome::Refused(e));
            engine.state = State::Ended;
        }
        engine
    }

    /// What to do now. While an action is under way the same one is returned again.
    pub fn step(&mut self) -> Step {
        if self.state == State::Ended {
            return Step::End(self.outcome.clone().unwrap_or(Outcome::Done));
        }
        if !self.in_flight && self.state != State::Safing {
            if let Some(emergency) = self.abort {
                self.end(Outcome::Aborted { emergency, remaining: self.remaining() }, emergency);
            } else if (self.paused && self.may_pause()) || self.is_waiting() {
                self.note_phase();
                return Step::Wait;
            }
        }
        self.note_phase();
        match self.action() {
            Some(a) => {
                if !self.in_flight {
                    self.acting = Some((a.clone(), self.elapsed));
                }
                self.in_flight = true;
                Step::Do(a)
            }
            None => {
                self.state = State::Ended;
                Step::End(self.outcome.clone().unwrap_or(Outcome::Done))
            }
        }
    }

    /// Takes an event.
    pub fn handle(&mut self, event: Event) {
        match event {
            Event::Pause => self.paused = true,
            Event::Resume => self.paused = false,
            Event::Abort => self.abort = Some(self.abort.unwrap_or(false)),
            Event::Emergency => {
                self.abort = Some(true);
                if let Some(s) = &mut self.safing {
                    s.escalate();
                }
            }
            Event::Tick(t) => self.elapsed = self.elapsed.max(t),
            answer => {
                if self.in_flight {
                    self.in_flight = false;
                    self.learn(&answer);
                    self.answer(answer);
                }
            }
        }
    }

    /// Places in the plan still to take, the next one first.
    #[must_use]
    pub fn ahead(&self) -> &[u32] {
        self.todo.get(self.at..).unwrap_or(&[])
    }

    /// Whether a pose is about to begin: the moment for a choice.
    #[must_use]
    pub fn between_poses(&self) -> bool {
        !self.in_flight && self.state == State::Move
    }

    /// Follows a choice between two poses; at any other time, and for a place that is not ahead, nothing changes.
    pub fn choose(&mut self, choice: Choice) {
        if !self.between_poses() {
            return;
        }
        match choice {
            Choice::AsPlanned => {}
            Choice::This(index) => {
                if let Some(k) = self.ahead().iter().position(|i| *i == index) {
                    self.todo[self.at..=self.at + k].rotate_right(1);
                }
            }
            Choice::Enough => {
                self.todo.truncate(self.at);
                self.state = self.next_pose();
            }
        }
    }

    /// Poses that were given up so far.
    #[must_use]
    pub fn lost(&self) -> &[LostPose] {
        &self.lost
    }

    /// Poses not taken: those ahead, the one under way, and those given up.
    fn remaining(&self) -> u32 {
        let ahead = self.todo.get(self.at..).unwrap_or(&[]);
        let lost = self.lost.iter().filter(|l| !ahead.contains(&l.index)).count();
        (ahead.len() + lost) as u32
    }

    fn index(&self) -> u32 {
        self.todo.get(self.at).copied().unwrap_or(0)
    }

    fn pose(&self) -> Pose {
        self.setup.poses.get(self.index() as usize).copied().unwrap_or_default()
    }

    /// A pause holds between frames and before moves, not in the middle of keeping a frame.
    fn may_pause(&self) -> bool {
        self.frame == Frame::Idle && !matches!(self.state, State::EndPose | State::GiveUp | State::Close)
    }

    fn action(&self) -> Option<Action> {
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

    fn answer(&mut self, event: Event) {
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

    fn advance(&mut self, event: &Event) {
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

    fn next_pose(&mut self) -> State {
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
