//! The journal: the calls of a scan, carried to a thread that hashes, compresses and writes.
//!
//! A frame of 1280 × 1024 costs the caller one copy; the rest happens beside the next exposure. The channel holds
//! a few frames, so a slow disk slows the scan instead of filling memory. What fails on the thread is told at the next call and at
//! [`Writer::end_pose`], which waits until the pose is on the disk.

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gonio_instrument::{Exposure, Pose, Sensors};
use prost::Message as _;

use crate::header::{self, Header, SessionRecord};
use crate::layout::Topic;
use crate::medium::{FaultyFile, FileFaults, Medium};
use crate::message::{FrameInfo, SensorReading, Wire, ns};
use crate::paths::{continuations, segment_path};
use crate::segment_writer::SegmentWriter;
use crate::{RecordingError, digest};

/// Commands in flight; at 2.6 MB a frame some 16 MB.
const IN_FLIGHT: usize = 6;

/// Time since the Unix epoch by the system's clock, as [`Writer::event`] and [`Writer::wire`] take it.
#[must_use]
pub fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Where the journal takes the time of poses and frames from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// The system's clock.
    #[default]
    System,
    /// Counts up from `start` by `step` each time it is asked: files that are the same every time.
    Steps {
        /// First time.
        start: Duration,
        /// Added at each use.
        step: Duration,
    },
}

impl Clock {
    /// The time now; counts up where the clock does.
    pub fn time(&mut self) -> Duration {
        match self {
            Self::System => now(),
            Self::Steps { start, step } => {
                let t = *start;
                *start += *step;
                t
            }
        }
    }
}

/// How a session is created.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WriterOptions {
    /// Overwrite a session of the same name, its continuation segments included.
    pub overwrite: bool,
    /// Where times come from.
    pub clock: Clock,
    /// A bad disk, to see what becomes of the session.
    pub faults: Option<FileFaults>,
}

/// How serious an event is; the values are those of `foxglove.Log`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// For those who look for a fault.
    Debug = 1,
    /// Normal course.
    Info = 2,
    /// Something to look at.
    Warning = 3,
    /// Something failed.
    Error = 4,
}

impl Level {
    /// The level with this number; unknown numbers count as [`Level::Info`].
    pub(crate) const fn from_number(n: i32) -> Self {
        match n {
            1 => Self::Debug,
            3 => Self::Warning,
            4 | 5 => Self::Error,
            _ => Self::Info,
        }
    }
}

/// Which way bytes went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the host to the device.
    ToDevice,
    /// From the device to the host.
    FromDevice,
}

enum Command {
    Message(Topic, u64, Vec<u8>),
    Event(u64, Level, String),
    Begin(u64, u32, Pose, Pose),
    Frame(u64, Vec<u8>, FrameInfo),
    GiveUp(u64),
    End(u64, SyncSender<Result<u64, RecordingError>>),
    Finish(u64, SyncSender<Result<u64, RecordingError>>),
    Abandon,
}

/// Writes a session. Dropped without [`Writer::finish`] it finishes by itself and gives an open pose up.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    segment: u32,
    clock: Clock,
    in_pose: bool,
    sender: Option<SyncSender<Command>>,
    thread: Option<JoinHandle<()>>,
    failure: Arc<Mutex<Option<RecordingError>>>,
}

impl Writer {
    /// Creates the session `path` with its header, durable on return.
    ///
    /// # Errors
    /// [`RecordingError::Exists`] where the file or a continuation of it exists and `overwrite` is off;
    /// [`RecordingError::Denied`], [`RecordingError::DiskFull`], [`RecordingError::Io`] as the system says;
    /// [`RecordingError::Header`] where a part cannot be written as text.
    pub fn create(path: &Path, header: &Header, options: WriterOptions) -> Result<Self, RecordingError> {
        let stale = continuations(path);
        if let (Some(&n), false) = (stale.first(), options.overwrite) {
            return Err(RecordingError::Exists { path: segment_path(path, n) });
        }
        let mut clock = options.clock;
        let started = clock.time();
        let record = SessionRecord::new(header, 1, started)?;
        let file = create_file(path, options.overwrite)?;
        // the continuations of a session that is gone would be taken for this one's
        for n in stale {
            let old = segment_path(path, n);
            std::fs::remove_file(&old).map_err(|e| RecordingError::io("remove", &old, 0, &e))?;
        }
        Self::begin(medium(file, options.faults), path, header, &record, clock)
    }

    /// Begins the segment that `record` names; for a continued session.
    pub(crate) fn create_segment(
        first: &Path,
        header: &Header,
        record: &SessionRecord,
        options: WriterOptions,
    ) -> Result<Self, RecordingError> {
        let path = segment_path(first, record.segment);
        let file = create_file(&path, false)?;
        Self::begin(medium(file, options.faults), &path, header, record, options.clock)
    }

    fn begin(
        file: Box<dyn Medium>,
        path: &Path,
        header: &Header,
        record: &SessionRecord,
        clock: Clock,
    ) -> Result<Self, RecordingError> {
        let attachments = header::attachments(header, record)?;
        let made = SegmentWriter::create(file, path, &attachments, record.started_ns);
        let segment = match made {
            Ok(s) => s,
            Err(e) => {
                // a file without a header is of use to nobody
                let _ = std::fs::remove_file(path);
                return Err(e);
            }
        };
        sync_folder(path);
        Ok(Self::over(segment, path, record.segment, clock))
    }

    /// Runs a segment on its own thread.
    pub(crate) fn over(segment: SegmentWriter, path: &Path, number: u32, clock: Clock) -> Self {
        let failure = Arc::new(Mutex::new(None));
        let (sender, receiver) = sync_channel(IN_FLIGHT);
        let shared = Arc::clone(&failure);
        let thread = std::thread::Builder::new()
            .name("gonio-journal".to_owned())
            .spawn(move || work(segment, &receiver, &shared))
            .ok();
        Self {
            path: path.to_owned(),
            segment: number,
            clock,
            in_pose: false,
            sender: thread.is_some().then_some(sender),
            thread,
            failure,
        }
    }

    /// The file being written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of the segment being written, from 1.
    #[must_use]
    pub const fn segment(&self) -> u32 {
        self.segment
    }

    /// Time by the journal's clock.
    pub fn time(&mut self) -> Duration {
        self.clock.time()
    }

    fn failed(&self) -> Option<RecordingError> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn send(&self, command: Command) -> Result<(), RecordingError> {
        if let Some(e) = self.failed() {
            return Err(e);
        }
        let stopped = || RecordingError::Stopped { path: self.path.clone() };
        self.sender
            .as_ref()
            .ok_or_else(stopped)?
            .send(command)
            .map_err(|_| self.failed().unwrap_or_else(stopped))
    }

    fn ask(
        &self,
        command: impl FnOnce(SyncSender<Result<u64, RecordingError>>) -> Command,
    ) -> Result<u64, RecordingError> {
        let (reply, answer) = sync_channel(1);
        self.send(command(reply))?;
        answer.recv().unwrap_or_else(|_| {
            Err(self.failed().unwrap_or_else(|| RecordingError::Stopped { path: self.path.clone() }))
        })
    }

    /// Notes an event.
    ///
    /// # Errors
    /// What failed on the journal's thread since the last call.
    pub fn event(&mut self, time: Duration, level: Level, text: &str) -> Result<(), RecordingError> {
        self.send(Command::Event(ns(time), level, text.to_owned()))
    }

    /// Notes bytes on the wire.
    ///
    /// # Errors
    /// What failed on the journal's thread since the last call.
    pub fn wire(&mut self, direction: Direction, time: Duration, bytes: &[u8]) -> Result<(), RecordingError> {
        let m = Wire { from_device: direction == Direction::FromDevice, bytes: bytes.to_owned() };
        self.send(Command::Message(Topic::Wire, ns(time), m.encode_to_vec()))
    }

    /// Notes what the sensors said.
    ///
    /// # Errors
    /// What failed on the journal's thread since the last call.
    pub fn sensors(&mut self, time: Duration, sensors: &Sensors) -> Result<(), RecordingError> {
        let m = SensorReading {
            lamp_monitor: sensors.lamp_monitor,
            temperature_c: sensors.temperature_c,
            sample_height_mm: sensors.sample_height_mm,
            interlock_closed: sensors.interlock_closed,
        };
        self.send(Command::Message(Topic::Sensors, ns(time), m.encode_to_vec()))
    }

    /// Begins a pose: its place in the plan, where the plan wants it, where the encoders say it is.
    ///
    /// # Errors
    /// [`RecordingError::Order`] inside another pose; what failed on the journal's thread since the last call.
    pub fn begin_pose(&mut self, index: u32, commanded: Pose, readback: Pose) -> Result<(), RecordingError> {
        if self.in_pose {
            return Err(RecordingError::Order { call: "begin a pose", state: "inside another" });
        }
        let t = ns(self.clock.time());
        self.send(Command::Begin(t, index, commanded, readback))?;
        self.in_pose = true;
        Ok(())
    }

    /// Records a frame of the pose that is open.
    ///
    /// # Errors
    /// As [`Writer::frame_requested`].
    pub fn frame(&mut self, exposure: &Exposure) -> Result<(), RecordingError> {
        self.frame_requested(exposure, exposure.frame.exposure)
    }

    /// Records a frame together with the exposure that was asked for, where the camera rounds: a replay finds the frame by either.
    ///
    /// # Errors
    /// [`RecordingError::BadFrame`] where size and pixels disagree, [`RecordingError::Order`] outside a pose; what failed on the
    /// journal's thread since the last call.
    pub fn frame_requested(
        &mut self,
        exposure: &Exposure,
        requested: Duration,
    ) -> Result<(), RecordingError> {
        if !self.in_pose {
            return Err(RecordingError::Order { call: "record a frame", state: "outside a pose" });
        }
        let f = &exposure.frame;
        if u64::from(f.width) * u64::from(f.height) != f.pixels.len() as u64 {
            return Err(RecordingError::BadFrame {
                width: f.width,
                height: f.height,
                pixels: f.pixels.len(),
            });
        }
        let info = FrameInfo {
            pose: 0,
            width: f.width,
            height: f.height,
            exposure_ns: ns(f.exposure),
            requested_ns: ns(requested),
            lamp_monitor: exposure.lamp_monitor,
            shutter_open: exposure.shutter_open,
            sequence: f.sequence,
            stamp_ns: ns(f.stamp),
            sensor_temperature_c: f.sensor_temperature_c,
            sha256: Vec::new(),
        };
        let t = ns(self.clock.time());
        self.send(Command::Frame(t, digest::to_bytes(&f.pixels), info))
    }

    /// Ends the pose and waits until it is on the disk; only then does it count as done. Returns the bytes written so far.
    ///
    /// # Errors
    /// [`RecordingError::Order`] outside a pose; [`RecordingError::DiskFull`] and others if the pose could not be kept: it is then not
    /// in the file, and those before it are.
    pub fn end_pose(&mut self) -> Result<u64, RecordingError> {
        if !self.in_pose {
            return Err(RecordingError::Order { call: "end a pose", state: "outside a pose" });
        }
        self.in_pose = false;
        let t = ns(self.clock.time());
        self.ask(|reply| Command::End(t, reply))
    }

    /// Gives the open pose up, as a stop in mid-pose does: its frames stay in the file but it does not count as done.
    ///
    /// # Errors
    /// What failed on the journal's thread since the last call.
    pub fn give_up_pose(&mut self) -> Result<(), RecordingError> {
        if !self.in_pose {
            return Ok(());
        }
        self.in_pose = false;
        let t = ns(self.clock.time());
        self.send(Command::GiveUp(t))
    }

    /// Closes the session with its summary; durable on return. Returns the size of the file. An open pose is given up. After a
    /// failure the poses before it are closed all the same, and the failure is told.
    ///
    /// # Errors
    /// What failed on the journal's thread, now or before.
    pub fn finish(mut self) -> Result<u64, RecordingError> {
        self.close()
    }

    fn close(&mut self) -> Result<u64, RecordingError> {
        let Some(sender) = self.sender.take() else {
            return Err(RecordingError::Stopped { path: self.path.clone() });
        };
        let (reply, answer) = sync_channel(1);
        let t = ns(self.clock.time());
        let sent = sender.send(Command::Finish(t, reply)).is_ok();
        let stopped = || self.failed().unwrap_or_else(|| RecordingError::Stopped { path: self.path.clone() });
        let result = if sent { answer.recv().unwrap_or_else(|_| Err(stopped())) } else { Err(stopped()) };
        drop(sender);
        if let Some(t) = self.thread.take() {
            let _ = t.join();
        }
        match self.failed() {
            Some(e) => Err(e),
            None => result,
        }
    }

    /// Stops writing at once, as a power failure would: nothing pending is kept, no summary is written. For tests of what follows.
    pub fn abandon(mut self) {
        if let Some(sender) = self.sender.take() {
            let _ = sender.send(Command::Abandon);
        }
        if let Some(t) = self.thread.take() {
            let _ = t.join();
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        if self.sender.is_some() {
            let _ = self.close();
        }
    }
}

/// Creates a session file, and holds it against other writers while it is open.
pub(crate) fn create_file(path: &Path, overwrite: bool) -> Result<File, RecordingError> {
    let io = |e: &std::io::Error| RecordingError::io("create", path, 0, e);
    let mut options = OpenOptions::new();
    options.write(true).create(true).create_new(!overwrite);
    let file = options.open(path).map_err(|e| io(&e))?;
    lock(&file, path)?;
    // only now: a session that is just being written must not be emptied
    file.set_len(0).map_err(|e| io(&e))?;
    Ok(file)
}

/// Holds a file against other writers; given back when it is closed.
pub(crate) fn lock(file: &File, path: &Path) -> Result<(), RecordingError> {
    match file.try_lock() {
        Err(std::fs::TryLockError::WouldBlock) => Err(RecordingError::InUse { path: path.to_owned() }),
        // a file system without locks must not keep anyone from measuring
        Ok(()) | Err(std::fs::TryLockError::Error(_)) => Ok(()),
    }
}

fn medium(file: File, faults: Option<FileFaults>) -> Box<dyn Medium> {
    match faults {
        None => Box::new(file),
        Some(faults) => Box::new(FaultyFile::new(file, faults)),
    }
}

/// Makes the name itself durable, where the system lets one; without it a power failure may lose the file as a whole.
fn sync_folder(path: &Path) {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    if let Ok(f) = File::open(folder) {
        let _ = f.sync_all();
    }
}

/// The journal's thread. After the first failure it takes no more poses, but still closes the file.
fn work(mut segment: SegmentWriter, receiver: &Receiver<Command>, failure: &Mutex<Option<RecordingError>>) {
    let broken = std::cell::Cell::new(false);
    for command in receiver {
        // the failure is noted before the answer goes out: the caller's next call must find it
        let note = |result: Result<u64, RecordingError>| {
            if let Err(e) = &result {
                broken.set(true);
                failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| e.clone());
            }
            result
        };
        let result = match command {
            Command::Finish(t, reply) => {
                let result = if broken.get() { segment.close() } else { segment.finish(t) };
                let _ = reply.send(result);
                return;
            }
            Command::Abandon => return,
            // a caller who waits for an answer finds the failure instead
            _ if broken.get() => continue,
            Command::End(t, reply) => {
                let result = note(segment.end_pose(t).map(|()| segment.sealed_bytes()));
                let _ = reply.send(result);
                continue;
            }
            Command::Message(topic, t, payload) => segment.message(topic, t, &payload),
            Command::Event(t, level, text) => segment.event(t, level as i32, &text),
            Command::Begin(t, index, commanded, readback) => {
                segment.begin_pose(t, index, commanded, readback)
            }
            Command::Frame(t, data, info) => segment.frame(t, data, info),
            Command::GiveUp(t) => segment.give_up_pose(t),
        };
        let _ = note(result.map(|()| 0));
    }
}
