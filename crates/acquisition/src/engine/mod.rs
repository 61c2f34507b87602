//! The scan as a state machine without clock, thread or I/O: [`Engine::step`] says what to do, [`Engine::handle`] takes what came of it.
//!
//! preflight (journal, sensors, shutter closed) → home → lamp → for each pose: move, dark frames (at the plan's first pose, shutter closed),
//! shutter open, bracket, shutter closed, pose done → lamp off → finished. However it ends, the last things asked for are: motion stopped, shutter
//! closed, the open pose given up, the journal closed. One action is under way at a time; pause, abort and emergency
//! may come at any instant. What passes by itself or by a hand (lid, lamp, heat, stray light) suspends the scan and is waited for; a device that
//! has restarted is homed, and the pose under way begun anew.

mod bracketing;
mod course;
mod failing;
mod notes;
pub mod preflight;
mod progress;
mod remaining;
mod safing;
pub mod setup;
mod state;
mod suspending;
mod words;

use std::time::Duration;

use gonio_instrument::Pose;

use crate::bracket::{Bracket, FrameSummary};
pub use notes::Note;
pub use preflight::PreflightError;
use remaining::Timing;
use safing::Safing;
pub use setup::Setup;
use state::{Frame, State};
pub use suspending::Suspenders;
use suspending::Suspension;
pub use words::{Action, Choice, Event, LostPose, Outcome, Phase, Progress, ScanError, Step};

/// How often a frame is tried before its pose is given up.
pub const TRIES: u32 = 3;

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
    /// The lamp gave no light and was lit again; no light has come since.
    relit: bool,
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
            relit: false,
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
}
