//! A scan from open devices to a closed session: journal, wire log, progress, state for other terminals.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use gonio_acquisition::engine::{Choice, LostPose, Note, Outcome, Progress, Setup};
use gonio_acquisition::journal::Journal;
use gonio_acquisition::runner::{self, FrameCounts, Observer};
use gonio_acquisition::{Phase, PixelMap};
use gonio_driver::stage::LinkWatch;
use gonio_instrument::{
    CameraInfo, Cancel, Certificate, Description, Exposure, LinkStatistics, Plan, Pose, PoseRecord,
    SampleRecord, Sensors, StageIdentity, Stopping,
};
use gonio_recording::{
    Attachment, Devices, FileFaults, Header, Level, RecordingError, Session, Writer, WriterOptions,
};

use crate::control::Control;
use crate::outcome::Failure;
use crate::progress;
use crate::rig::Rig;

/// What is to be recorded, and where.
pub struct Job<'a> {
    /// The instrument.
    pub instrument: &'a Description,
    /// The plan.
    pub plan: &'a Plan,
    /// Who and what.
    pub sample: SampleRecord,
    /// Certificate of a reference sample.
    pub certificate: Option<Certificate>,
    /// Kept in the session.
    pub provenance: BTreeMap<String, String>,
    /// Kept in the session.
    pub attachments: Vec<Attachment>,
    /// The session file.
    pub output: &'a Path,
    /// Go on with it.
    pub resume: bool,
    /// Overwrite it.
    pub force: bool,
    /// What shall go wrong with the file.
    pub file_faults: Option<FileFaults>,
}

/// How a scan went.
pub struct Recorded {
    /// How it ended.
    pub outcome: Outcome,
    /// Poses on the disk, those of earlier runs included.
    pub poses_done: u32,
    /// Poses of the plan.
    pub poses_total: u32,
    /// Frames kept in this run.
    pub frames: u32,
    /// How the link has been doing.
    pub link: LinkStatistics,
    /// How the camera has been doing.
    pub camera_frames: FrameCounts,
    /// The stage.
    pub stage: StageIdentity,
    /// The camera.
    pub camera: CameraInfo,
}

/// Runs a scan to its end. `on_pose` gets every pose that is on the disk: those of earlier runs first when resuming.
///
/// # Errors
/// [`Failure`] where the session cannot be created or finished; how the scan itself ended stands in [`Recorded::outcome`].
pub fn record(
    job: &Job<'_>,
    rig: &mut Rig,
    map: &PixelMap,
    cancel: &Cancel,
    control: Option<&Control>,
    on_pose: &mut dyn FnMut(PoseRecord),
) -> Result<Recorded, Failure> {
    record_choosing(job, rig, map, cancel, control, on_pose, &mut |_| Choice::AsPlanned)
}

/// As [`record`]; `choose` says after each pose which one follows, given the places in the plan still to take.
///
/// # Errors
/// As [`record`].
pub fn record_choosing(
    job: &Job<'_>,
    rig: &mut Rig,
    map: &PixelMap,
    cancel: &Cancel,
    control: Option<&Control>,
    on_pose: &mut dyn FnMut(PoseRecord),
    choose: &mut dyn FnMut(&[u32]) -> Choice,
) -> Result<Recorded, Failure> {
    let (stage, camera) = (rig.stage.identity(), rig.camera.info());
    let mut header = Header::new(job.instrument.clone(), job.plan.clone(), job.sample.clone());
    header.certificate.clone_from(&job.certificate);
    header.devices = Devices { stage: stage.clone(), camera: camera.clone() };
    header.provenance.clone_from(&job.provenance);
    header.attachments.clone_from(&job.attachments);

    let mut setup = Setup::new(job.instrument.clone(), job.plan.clone(), camera.clone(), job.sample.kind);
    gonio_recording::check_space(job.output, job.plan, &job.instrument.camera).map_err(journal_failure)?;
    let options = WriterOptions { overwrite: job.force, faults: job.file_faults, ..WriterOptions::default() };
    let writer = if job.resume {
        let (writer, done) =
            gonio_recording::resume_with(job.output, &header, options).map_err(journal_failure)?;
        for pose in Session::open(job.output).map_err(journal_failure)?.poses().flatten() {
            setup.learn(&pose);
            on_pose(pose);
        }
        setup = setup.resuming(done.done);
        writer
    } else {
        Writer::create(job.output, &header, options).map_err(journal_failure)?
    };
    let room =
        Room { path: job.output, pose: gonio_recording::space_per_pose(job.plan, &job.instrument.camera) };
    let mut journal = WiredJournal { writer, rig_wire: &rig.wire, notes: &rig.notes, room };
    let total = setup.poses.len() as u32;
    let mut watcher = Watcher {
        bar: progress::bar(job.sample.kind.name(), u64::from(total)),
        control,
        on_pose,
        choose,
        link: rig.watch.clone(),
        last: None,
        frames: FrameCounts::default(),
    };
    let mut outcome =
        runner::run(setup, map, &mut *rig.stage, &mut *rig.camera, &mut journal, cancel, &mut watcher);
    watcher.bar.finish_and_clear();
    if let Outcome::Aborted { emergency, .. } = &mut outcome {
        // the device may be the first to say that it was stopped
        *emergency |= cancel.state() == Stopping::Emergency;
    }
    let (last, camera_frames) = (watcher.last, watcher.frames);
    let _ = journal.drain();
    let finished = journal.writer.finish();
    if matches!(outcome, Outcome::Refused(_)) && !job.resume {
        // refused before anything was measured: nothing to keep
        let _ = std::fs::remove_file(job.output);
    }
    let recorded = Recorded {
        poses_done: last.map_or(0, |p| p.poses_done),
        poses_total: total,
        frames: last.map_or(0, |p| p.exposures_done),
        link: rig.stage.statistics(),
        camera_frames,
        stage,
        camera,
        outcome,
    };
    match (finished, &recorded.outcome) {
        // a scan that ended for another reason tells that one
        (Err(e), Outcome::Done) => Err(journal_failure(e)),
        _ => Ok(recorded),
    }
}

/// The outcome of a scan as the outcome of a command.
///
/// # Errors
/// [`Failure`] for a scan that was refused, stopped or failed.
pub fn verdict(recorded: &Recorded, session: &Path) -> Result<crate::Outcome, Failure> {
    use gonio_acquisition::engine::{PreflightError, ScanError};
    let kept = format!(
        "{} of {} poses are kept in {}",
        recorded.poses_done,
        recorded.poses_total,
        session.display()
    );
    match &recorded.outcome {
        Outcome::Done => Ok(crate::Outcome::Done),
        Outcome::Partial { lost } => {
            let names: Vec<String> = lost.iter().map(|l| format!("pose {}: {}", l.index, l.reason)).collect();
            Ok(crate::Outcome::WithLoss(format!(
                "{kept}; lost: {}; take them with --resume",
                names.join("; ")
            )))
        }
        Outcome::Aborted { emergency, .. } => Err(Failure::Failed(format!(
            "{} on request; {kept}; go on with --resume",
            if *emergency { "emergency stop" } else { "stopped" }
        ))),
        Outcome::Refused(e @ (PreflightError::Interlock | PreflightError::SampleHeight { .. })) => {
            Err(Failure::Device(e.to_string()))
        }
        Outcome::Refused(e) => Err(Failure::usage(e)),
        Outcome::Failed { error: ScanError::Device(e), .. } => {
            Err(Failure::Device(told(&e.to_string(), &kept)))
        }
        Outcome::Failed { error: ScanError::Journal(e), .. } => {
            Err(Failure::Failed(told(&e.to_string(), &kept)))
        }
    }
}

/// An error with what is kept; how to go on is said once.
fn told(error: &str, kept: &str) -> String {
    let how = if error.contains("--resume") { "" } else { "; go on with --resume" };
    format!("{error}; {kept}{how}")
}

/// A wrong name or a session that stands in the way is the user's to mend; a full disk is a failure.
fn journal_failure(e: RecordingError) -> Failure {
    match &e {
        RecordingError::DiskFull { .. }
        | RecordingError::NotEnoughSpace { .. }
        | RecordingError::Io { .. } => Failure::Failed(e.to_string()),
        _ => Failure::usage(e),
    }
}

/// The session's journal, with the bytes on the wire written between its other entries.
struct WiredJournal<'a> {
    writer: Writer,
    rig_wire: &'a std::sync::mpsc::Receiver<crate::rig::WireRecord>,
    notes: &'a std::sync::mpsc::Receiver<crate::rig::StageNote>,
    room: Room<'a>,
}

/// Room on the disk, watched from pose to pose: others fill it too.
struct Room<'a> {
    path: &'a Path,
    /// Most that a pose can take.
    pose: u64,
}

impl Room<'_> {
    fn check(&self) -> Result<(), RecordingError> {
        // a system that does not tell is no reason to stop
        let Ok(free) = gonio_recording::free_space(self.path) else { return Ok(()) };
        if free < self.pose {
            let path = self.path.to_owned();
            return Err(RecordingError::NotEnoughSpace { path, needed: self.pose, free });
        }
        Ok(())
    }
}

impl WiredJournal<'_> {
    fn drain(&mut self) -> Result<(), RecordingError> {
        while let Ok(w) = self.rig_wire.try_recv() {
            self.writer.wire(w.direction, w.time, &w.bytes)?;
        }
        while let Ok(n) = self.notes.try_recv() {
            self.writer.event(n.time, if n.serious { Level::Warning } else { Level::Info }, &n.text)?;
        }
        Ok(())
    }
}

impl Journal for WiredJournal<'_> {
    fn check(&mut self) -> Result<(), RecordingError> {
        Journal::check(&mut self.writer)
    }

    fn begin_pose(&mut self, index: u32, commanded: Pose, readback: Pose) -> Result<(), RecordingError> {
        self.room.check()?;
        self.drain()?;
        Journal::begin_pose(&mut self.writer, index, commanded, readback)
    }

    fn frame(&mut self, exposure: &Exposure, requested: Duration) -> Result<(), RecordingError> {
        self.drain()?;
        Journal::frame(&mut self.writer, exposure, requested)
    }

    fn end_pose(&mut self) -> Result<(), RecordingError> {
        self.drain()?;
        Journal::end_pose(&mut self.writer)
    }

    fn give_up_pose(&mut self) -> Result<(), RecordingError> {
        Journal::give_up_pose(&mut self.writer)
    }

    fn sensors(&mut self, sensors: &Sensors) -> Result<(), RecordingError> {
        Journal::sensors(&mut self.writer, sensors)
    }

    fn event(&mut self, serious: bool, text: &str) -> Result<(), RecordingError> {
        Journal::event(&mut self.writer, serious, text)
    }
}

struct Watcher<'a> {
    bar: indicatif::ProgressBar,
    control: Option<&'a Control>,
    on_pose: &'a mut dyn FnMut(PoseRecord),
    choose: &'a mut dyn FnMut(&[u32]) -> Choice,
    link: LinkWatch,
    last: Option<Progress>,
    frames: FrameCounts,
}

impl Observer for Watcher<'_> {
    fn progress(&mut self, p: &Progress) {
        self.bar.set_position(u64::from(p.poses_done));
        let step = format!("{:?}", p.phase).to_lowercase();
        let left = p.remaining.map(|r| format!(", about {} s to go", r.as_secs() + 1)).unwrap_or_default();
        self.bar
            .set_message(format!("{step}, frame {} of about {}{left}", p.exposures_done, p.exposures_total));
        if let Some(c) = self.control {
            c.update(|s| {
                s.step = step;
                s.poses_done = p.poses_done;
                s.poses_total = p.poses_total;
                s.remaining_s = p.remaining.map_or(0.0, |r| r.as_secs_f64());
                s.link = self.link.statistics();
                if p.phase != Phase::Suspended {
                    s.waiting_for.clear();
                }
            });
        }
        self.last = Some(*p);
    }

    fn pose_done(&mut self, record: PoseRecord) {
        tracing::info!("pose {} done ({}), {} frames", record.index, record.readback, record.exposures.len());
        (self.on_pose)(record);
    }

    fn choose(&mut self, ahead: &[u32]) -> Choice {
        (self.choose)(ahead)
    }

    fn note(&mut self, note: &Note) {
        if note.serious {
            self.bar.suspend(|| tracing::warn!("{}", note.text));
        } else {
            tracing::info!("{}", note.text);
        }
        if let (Some(c), Some(why)) = (self.control, note.text.strip_prefix("suspended: ")) {
            c.update(|s| why.clone_into(&mut s.waiting_for));
            self.bar.println(format!("waiting: {why}"));
        }
    }

    fn camera(&mut self, frames: &FrameCounts) {
        self.frames = *frames;
    }

    fn pose_lost(&mut self, lost: &LostPose) {
        self.bar.println(format!("pose {} was given up: {}", lost.index, lost.reason));
        tracing::warn!("pose {} was given up: {}", lost.index, lost.reason);
    }

    fn hold(&mut self) -> bool {
        self.control.is_some_and(Control::paused)
    }
}
