//! A session as the devices it was recorded from: [`ReplayStage`] and [`ReplayCamera`] share a cursor, so the code of a live scan runs
//! over a recording unchanged.
//!
//! A move goes to the recorded pose with that command; it answers with the position read back then. A capture
//! gives the frame that was asked for with the same exposure and shutter, each once, in the order taken. Other settings that ask for
//! something that was not recorded get [`DeviceError::NotRecorded`], never a substitute.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use gonio_instrument::{
    Camera, CameraInfo, Cancel, DeviceError, Exposure, Frame, LinkStatistics, Pose, Sensors, Stage,
    StageIdentity,
};

use crate::chunk::RecordedPose;
use crate::session::Session;
use crate::{Devices, RecordingError};

/// An exposure is found by what was asked for or by what was taken, within this relative difference.
const EXPOSURE_TOLERANCE: f64 = 1e-3;
/// A pose is found within this many radians; the recorded ones are exact, a plan read from text may differ in the last bit.
const POSE_TOLERANCE: f64 = 1e-9;

/// Makes stage and camera of a session.
///
/// # Errors
/// Those of [`Session::devices`] where that part is unusable; a session without one answers with empty names.
pub fn replay(session: Session) -> Result<(ReplayStage, ReplayCamera), RecordingError> {
    let mut devices = match session.devices() {
        Err(RecordingError::NoSuchPart { .. }) => Devices::default(),
        other => other?,
    };
    if devices.camera.width == 0
        && let Ok(i) = session.instrument()
    {
        let [width, height] = i.camera.size;
        devices.camera = CameraInfo { width, height, bits: i.camera.bits, ..devices.camera };
    }
    let cursor = Arc::new(Mutex::new(Cursor {
        path: session.path().to_owned(),
        commanded: session.commanded().collect(),
        session,
        visited: BTreeSet::new(),
        pose: None,
        shutter_open: false,
        used: Vec::new(),
        last: None,
        lost: Vec::new(),
    }));
    let stage = ReplayStage { cursor: Arc::clone(&cursor), identity: devices.stage };
    Ok((stage, ReplayCamera { cursor, info: devices.camera }))
}

/// Where the replay stands.
#[derive(Debug)]
struct Cursor {
    session: Session,
    path: PathBuf,
    commanded: Vec<(u32, Pose)>,
    /// Poses already moved to: the plan may hold the same place twice.
    visited: BTreeSet<u32>,
    pose: Option<RecordedPose>,
    shutter_open: bool,
    used: Vec<bool>,
    last: Option<usize>,
    lost: Vec<RecordingError>,
}

fn near(a: Pose, b: Pose) -> bool {
    (a.tilt - b.tilt).abs().radians() < POSE_TOLERANCE && (a.spin - b.spin).abs().radians() < POSE_TOLERANCE
}

fn same(a: Duration, b: Duration) -> bool {
    let (a, b) = (a.as_secs_f64(), b.as_secs_f64());
    (a - b).abs() <= EXPOSURE_TOLERANCE * a.max(b)
}

impl Cursor {
    fn move_to(&mut self, pose: Pose) -> Result<Pose, DeviceError> {
        let wanted = |visited: bool| {
            self.commanded
                .iter()
                .find(|(i, p)| near(*p, pose) && self.visited.contains(i) == visited)
                .map(|&(i, _)| i)
        };
        let not_recorded = || DeviceError::NotRecorded { what: format!("pose at {pose}") };
        let index = wanted(false).or_else(|| wanted(true)).ok_or_else(not_recorded)?;
        self.visited.insert(index);
        self.pose = None;
        match self.session.pose(index) {
            Ok(p) => {
                let readback = p.record.readback;
                self.used = vec![false; p.record.exposures.len()];
                self.last = None;
                self.pose = Some(p);
                Ok(readback)
            }
            Err(e) => {
                let what = format!("whole pose at {pose} ({e})");
                self.lost.push(e);
                Err(DeviceError::NotRecorded { what })
            }
        }
    }

    fn capture(&mut self, exposure: Duration) -> Result<Frame, DeviceError> {
        let open = self.shutter_open;
        let what = |why: &str| DeviceError::NotRecorded {
            what: format!(
                "frame of {exposure:?} with the shutter {} {why}",
                if open { "open" } else { "closed" }
            ),
        };
        let pose = self.pose.as_ref().ok_or_else(|| what("before the first pose"))?;
        let found = pose
            .record
            .exposures
            .iter()
            .zip(&pose.requested)
            .enumerate()
            .find(|(i, (e, requested))| {
                !self.used.get(*i).copied().unwrap_or(true)
                    && e.shutter_open == open
                    && (same(exposure, **requested) || same(exposure, e.frame.exposure))
            })
            .map(|(i, (e, _))| (i, e.frame.clone()));
        let (i, frame) = found.ok_or_else(|| what(&format!("at pose {}", pose.record.index)))?;
        if let Some(u) = self.used.get_mut(i) {
            *u = true;
        }
        self.last = Some(i);
        Ok(frame)
    }

    /// The exposure that the sensors speak of: the one captured last at this pose, else its first.
    fn current(&self) -> Option<&Exposure> {
        let exposures = &self.pose.as_ref()?.record.exposures;
        match self.last {
            Some(i) => exposures.get(i),
            None => exposures.iter().find(|e| e.shutter_open == self.shutter_open).or(exposures.first()),
        }
    }
}

fn lock(cursor: &Mutex<Cursor>) -> MutexGuard<'_, Cursor> {
    cursor.lock().unwrap_or_else(PoisonError::into_inner)
}

fn check(cancel: &Cancel) -> Result<(), DeviceError> {
    if cancel.is_raised() { Err(DeviceError::Cancelled) } else { Ok(()) }
}

/// The stage of a recorded session.
#[derive(Debug)]
pub struct ReplayStage {
    cursor: Arc<Mutex<Cursor>>,
    identity: StageIdentity,
}

impl ReplayStage {
    /// Poses that were asked for and turned out damaged.
    #[must_use]
    pub fn lost(&self) -> Vec<RecordingError> {
        lock(&self.cursor).lost.clone()
    }
}

impl Stage for ReplayStage {
    fn identity(&self) -> StageIdentity {
        self.identity.clone()
    }

    fn home(&mut self, cancel: &Cancel) -> Result<(), DeviceError> {
        check(cancel)
    }

    fn move_to(&mut self, pose: Pose, cancel: &Cancel) -> Result<Pose, DeviceError> {
        check(cancel)?;
        lock(&self.cursor).move_to(pose)
    }

    fn set_shutter(&mut self, open: bool) -> Result<(), DeviceError> {
        lock(&self.cursor).shutter_open = open;
        Ok(())
    }

    fn set_lamp(&mut self, _level: f64, cancel: &Cancel) -> Result<(), DeviceError> {
        check(cancel)
    }

    /// The lamp monitor as noted with the frame captured last at this pose (before the first: with its first frame). Ask
    /// after the capture, as a live scan does, and each frame gets its own. The sample stands at F1 and the interlock is closed: the scan
    /// was made.
    fn sensors(&mut self) -> Result<Sensors, DeviceError> {
        let cursor = lock(&self.cursor);
        let lamp_monitor = cursor.current().map_or(1.0, |e| e.lamp_monitor);
        Ok(Sensors { lamp_monitor, temperature_c: 0.0, sample_height_mm: 0.0, interlock_closed: true })
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn emergency_stop(&mut self) -> Result<(), DeviceError> {
        lock(&self.cursor).shutter_open = false;
        Ok(())
    }

    fn rearm(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn statistics(&self) -> LinkStatistics {
        LinkStatistics::default()
    }
}

/// The camera of a recorded session.
#[derive(Debug)]
pub struct ReplayCamera {
    cursor: Arc<Mutex<Cursor>>,
    info: CameraInfo,
}

impl ReplayCamera {
    /// Exposures of the current pose in the order taken, for code that does not choose them itself.
    #[must_use]
    pub fn exposures(&self) -> Vec<Exposure> {
        lock(&self.cursor).pose.as_ref().map(|p| p.record.exposures.clone()).unwrap_or_default()
    }

    /// The session behind the devices.
    #[must_use]
    pub fn session_path(&self) -> PathBuf {
        lock(&self.cursor).path.clone()
    }
}

impl Camera for ReplayCamera {
    fn info(&self) -> CameraInfo {
        self.info.clone()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        check(cancel)?;
        lock(&self.cursor).capture(exposure)
    }
}
