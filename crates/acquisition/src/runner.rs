//! Drives stage, camera and journal by what the [`Engine`] says. All I/O of a scan happens here, and no decision.

use std::time::{Duration, Instant};

use gonio_instrument::{
    Camera, Cancel, DeviceError, Exposure, Frame, Pose, PoseRecord, Sensors, Stage, Stopping,
};

use crate::bracket::{FrameSummary, Judge};
use crate::demand::{exposure_needs, interest};
use crate::engine::{Action, Choice, Engine, Event, LostPose, Note, Outcome, Progress, Setup, Step};
use crate::frames::{Frames, Verdict};
use crate::journal::Journal;
use crate::pixel_map::PixelMap;

/// Who watches a scan. Calls come from the scan's thread: hand long work on.
pub trait Observer {
    /// Something went forward.
    fn progress(&mut self, progress: &Progress) {
        let _ = progress;
    }

    /// A frame was taken and kept.
    fn frame(&mut self, exposure: &Exposure) {
        let _ = exposure;
    }

    /// What the sensors said.
    fn sensors(&mut self, sensors: &Sensors) {
        let _ = sensors;
    }

    /// A pose is on the disk: reduce it, update the fit.
    fn pose_done(&mut self, record: PoseRecord) {
        let _ = record;
    }

    /// Which pose follows, asked after each pose that is on the disk; `ahead` are the places in the plan still to take. The shutter is closed
    /// meanwhile.
    fn choose(&mut self, ahead: &[u32]) -> Choice {
        let _ = ahead;
        Choice::AsPlanned
    }

    /// A pose was given up.
    fn pose_lost(&mut self, lost: &LostPose) {
        let _ = lost;
    }

    /// Something happened; it stands in the journal already.
    fn note(&mut self, note: &Note) {
        let _ = note;
    }

    /// How the camera has been doing.
    fn camera(&mut self, frames: &FrameCounts) {
        let _ = frames;
    }

    /// Whether the scan shall hold; asked between actions and, while it holds, every few milliseconds.
    fn hold(&mut self) -> bool {
        false
    }
}

pub use crate::frames::FrameCounts;

/// An observer that looks away.
impl Observer for () {}

/// How often a held scan asks whether to go on.
const HOLD_POLL: Duration = Duration::from_millis(20);

/// Runs a scan to its end and says how it ended. Whatever that is: motion is stopped, the shutter closed, the open pose given up,
/// everything measured is in the journal. Finishing the journal is left to the caller.
pub fn run(
    mut setup: Setup,
    map: &PixelMap,
    stage: &mut dyn Stage,
    camera: &mut dyn Camera,
    journal: &mut dyn Journal,
    cancel: &Cancel,
    observer: &mut dyn Observer,
) -> Outcome {
    let start = Instant::now();
    // a texture camera looks straight at the sample: there the cosine of the tilt tells
    if setup.exposure_needs.is_empty() && map.description().textures().is_none() {
        setup.exposure_needs = exposure_needs(map, &setup.poses);
    }
    // of what an earlier run measured a choice follows at once
    let mut asked = setup.done.is_empty();
    let mut engine = Engine::new(setup);
    let mut hands = Hands {
        map,
        stage,
        camera,
        journal,
        cancel,
        observer,
        frame: None,
        record: None,
        judge: None,
        frames: Frames::default(),
    };
    let mut lost = 0;
    loop {
        engine.handle(Event::Tick(start.elapsed()));
        match cancel.state() {
            Stopping::No => {}
            Stopping::Controlled => engine.handle(Event::Abort),
            Stopping::Emergency => engine.handle(Event::Emergency),
        }
        let hold = hands.observer.hold();
        engine.handle(if hold { Event::Pause } else { Event::Resume });
        if !asked && engine.between_poses() {
            asked = true;
            let choice = hands.observer.choose(engine.ahead());
            engine.choose(choice);
        }
        let step = engine.step();
        for note in engine.take_notes() {
            hands.note(&note);
        }
        match step {
            Step::Do(action) => {
                let event = hands.act(&action);
                let kept = action == Action::EndPose && event == Event::Done;
                engine.handle(Event::Tick(start.elapsed()));
                engine.handle(event);
                if kept && !engine.ahead().is_empty() {
                    let choice = hands.observer.choose(engine.ahead());
                    engine.choose(choice);
                }
                for l in engine.lost().iter().skip(lost) {
                    hands.observer.pose_lost(l);
                }
                lost = lost.max(engine.lost().len());
                hands.observer.progress(&engine.progress());
            }
            Step::Wait => {
                hands.observer.progress(&engine.progress());
                std::thread::sleep(HOLD_POLL);
            }
            Step::End(outcome) => {
                for note in engine.take_notes() {
                    hands.note(&note);
                }
                let text = format!("scan ended: {outcome:?}");
                let serious = outcome != Outcome::Done;
                // an event that cannot be written changes nothing any more
                let _ = hands.journal.event(serious, &text);
                hands.observer.progress(&engine.progress());
                return outcome;
            }
        }
    }
}

struct Hands<'a> {
    map: &'a PixelMap,
    stage: &'a mut dyn Stage,
    camera: &'a mut dyn Camera,
    journal: &'a mut dyn Journal,
    cancel: &'a Cancel,
    observer: &'a mut dyn Observer,
    frame: Option<Frame>,
    record: Option<PoseRecord>,
    /// Bracketing's memory of the pose, made with its first lit frame.
    judge: Option<Judge>,
    /// What the camera gave so far.
    frames: Frames,
}

fn device<T>(result: Result<T, DeviceError>, event: impl FnOnce(T) -> Event) -> Event {
    result.map_or_else(Event::Failed, event)
}

fn done(result: Result<(), DeviceError>) -> Event {
    device(result, |()| Event::Done)
}

impl Hands<'_> {
    /// Into the journal and to the observer. A note that cannot be written ends nothing: the next frame or pose tells.
    fn note(&mut self, note: &Note) {
        let _ = self.journal.event(note.serious, &note.text);
        self.observer.note(note);
    }

    fn act(&mut self, action: &Action) -> Event {
        match action {
            Action::CheckJournal => self.journal(|j| j.check()),
            Action::ReadSensors => self.sensors(),
            Action::Home => done(self.stage.home(self.cancel)),
            // switching off must work after a stop was asked for
            Action::Lamp(level) if *level == 0.0 => done(self.stage.set_lamp(0.0, &Cancel::new())),
            Action::Lamp(level) => done(self.stage.set_lamp(*level, self.cancel)),
            Action::MoveTo { pose, .. } => device(self.stage.move_to(*pose, self.cancel), Event::Moved),
            Action::Shutter(open) => done(self.stage.set_shutter(*open)),
            Action::BeginPose { index, commanded, readback } => {
                let (index, commanded, readback) = (*index, *commanded, *readback);
                self.judge = None;
                self.record = Some(PoseRecord { index, commanded, readback, exposures: Vec::new() });
                self.journal(|j| j.begin_pose(index, commanded, readback))
            }
            Action::Capture { exposure, light } => self.capture(*exposure, *light),
            Action::Record { requested, lamp_monitor, shutter_open } => {
                self.keep(*requested, *lamp_monitor, *shutter_open)
            }
            Action::EndPose => {
                let event = self.journal(|j| j.end_pose());
                if let (Event::Done, Some(record)) = (&event, self.record.take()) {
                    self.observer.pose_done(record);
                }
                event
            }
            Action::GiveUpPose => {
                self.record = None;
                self.journal(|j| j.give_up_pose())
            }
            Action::Rearm => done(self.stage.rearm()),
            Action::StopMotion => done(self.stage.stop()),
            Action::EmergencyStop => done(self.stage.emergency_stop()),
        }
    }

    fn journal(
        &mut self,
        write: impl FnOnce(&mut dyn Journal) -> Result<(), gonio_recording::RecordingError>,
    ) -> Event {
        write(self.journal).map_or_else(Event::JournalFailed, |()| Event::Done)
    }

    fn sensors(&mut self) -> Event {
        match self.stage.sensors() {
            Ok(s) => {
                self.observer.sensors(&s);
                match self.journal.sensors(&s) {
                    Ok(()) => Event::Sensors(s),
                    Err(e) => Event::JournalFailed(e),
                }
            }
            Err(e) => Event::Failed(e),
        }
    }

    fn capture(&mut self, exposure: Duration, light: bool) -> Event {
        let frame = match self.camera.capture(exposure, self.cancel) {
            Ok(f) => f,
            Err(e) => {
                self.frames.failed(&e);
                self.observer.camera(&self.frames.counts());
                return Event::Failed(e);
            }
        };
        let expected = (self.map.width() as u32, self.map.height() as u32);
        if (frame.width, frame.height) != expected
            || frame.pixels.len() != self.map.width() * self.map.height()
        {
            return Event::Failed(DeviceError::BadFrame {
                sequence: frame.sequence,
                reason: format!(
                    "it has {} x {} pixels, expected {} x {}",
                    frame.width, frame.height, expected.0, expected.1
                ),
            });
        }
        let verdict = self.frames.judge(&frame, self.map.description().camera.read_noise_e > 0.0);
        let before = self.frames.counts();
        self.observer.camera(&before);
        match verdict {
            Verdict::Sound { missing: 0 } => {}
            Verdict::Sound { missing } => {
                let text = format!(
                    "{missing} frames before frame {} were lost; it takes their place",
                    frame.sequence
                );
                self.note(&Note { serious: true, text });
            }
            Verdict::Unusable(reason) => {
                return Event::Failed(DeviceError::BadFrame { sequence: frame.sequence, reason });
            }
        }
        let summary = if light {
            let (map, record) = (self.map, &self.record);
            let readback = record.as_ref().map_or_else(Pose::default, |r| r.readback);
            let judge = self
                .judge
                .get_or_insert_with(|| Judge::new(&map.description().camera, &interest(map, readback)));
            judge.judge(&frame)
        } else {
            FrameSummary { exposure_s: frame.exposure.as_secs_f64(), ..FrameSummary::default() }
        };
        self.frame = Some(frame);
        Event::Frame(summary)
    }

    fn keep(&mut self, requested: Duration, lamp_monitor: f64, shutter_open: bool) -> Event {
        let Some(frame) = self.frame.take() else { return Event::Done };
        let exposure = Exposure { frame, lamp_monitor, shutter_open };
        if let Err(e) = self.journal.frame(&exposure, requested) {
            return Event::JournalFailed(e);
        }
        self.observer.frame(&exposure);
        if let Some(r) = &mut self.record {
            r.exposures.push(exposure);
        }
        Event::Done
    }
}
