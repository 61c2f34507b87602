//! Cameras of Video4Linux: 8- to 16-bit raw frames, grey or Bayer, with exposure and gain by hand.
//!
//! The camera streams all the time and a thread of its own (`gonio-camera`) empties the stream; a capture takes the first frame that was exposed wholly
//! after it was asked for ([`timing`]). Frames in between pass and are counted. A frame that the driver lost or that came
//! damaged while one was waited for shows as a gap in [`Frame::sequence`]. A camera that is unplugged is found again by its USB ids and serial
//! number, and a capture under way waits for that.

pub mod controls;
pub mod nodes;
mod session;
mod survey;
pub mod timing;
mod worker;

pub use super::raw::Wanted;
pub use controls::{ControlFacts, Settings};
pub use nodes::{CameraName, Node, Role};
pub use survey::{CameraFacts, list_cameras, look_at};

use super::asking::CameraThread;
use gonio_instrument::{Camera, CameraInfo, Cancel, DeviceError, Frame};
use nodes::Places;
use session::{Session, monotonic};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use worker::{State, Worker};

/// What happens to a camera besides frames.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// It is gone, or its stream has stopped; it is looked for.
    Lost(DeviceError),
    /// It is back and set up as before.
    Returned {
        /// Since the loss was noticed.
        away: Duration,
    },
}

/// Sees what happens to the camera. Called on the camera's thread: it must not block.
pub type NoticeSink = Arc<dyn Fn(&Notice) + Send + Sync>;

/// How to use a camera.
#[derive(Clone)]
pub struct Options {
    /// How long a camera that was unplugged is looked for while a frame is waited for.
    pub patience: Duration,
    /// Sees what happens to it.
    pub notices: Option<NoticeSink>,
}

impl Default for Options {
    fn default() -> Self {
        Options { patience: Duration::from_secs(30), notices: None }
    }
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options").field("patience", &self.patience).finish_non_exhaustive()
    }
}

/// What became of the frames that the camera gave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Given to whoever asked.
    pub taken: u64,
    /// Not given to anybody: nobody had asked, or they were exposed too early for the one who had.
    pub passed: u64,
    /// Damaged on their way, while one was waited for.
    pub damaged: u64,
    /// Lost by the driver, by the gaps in its running number.
    pub lost: u64,
}

/// An open camera.
#[derive(Debug)]
pub struct V4lCamera {
    info: CameraInfo,
    format: String,
    settings: Settings,
    exposure_limits: Option<[Duration; 2]>,
    tally: Arc<Mutex<Tally>>,
    thread: CameraThread,
}

/// Opens a camera with the usual options.
///
/// # Errors
/// As [`open_with`].
pub fn open(name: &CameraName, wanted: &Wanted) -> Result<V4lCamera, DeviceError> {
    open_with(name, wanted, Options::default())
}

/// Finds a camera, chooses its format, takes all that is automatic out of the way and starts it.
///
/// # Errors
/// [`DeviceError::Absent`], [`DeviceError::Denied`], [`DeviceError::InUse`]; [`DeviceError::Io`] where no format fits or the node is no camera;
/// [`DeviceError::Refused`] where it stays automatic.
pub fn open_with(name: &CameraName, wanted: &Wanted, options: Options) -> Result<V4lCamera, DeviceError> {
    let (places, candidates) = (Places::default(), Places::default().candidates(name)?);
    let name = name.to_string();
    let (node, session) = open_first(candidates, wanted, &name)?;
    let info = CameraInfo {
        name: if session.card.is_empty() { name.clone() } else { session.card.clone() },
        serial: node.serial().to_owned(),
        width: wanted.width,
        height: wanted.height,
        // a container of 16 bits tells nothing of the sensor: the instrument's word counts
        bits: session.format.told_bits().unwrap_or(0),
    };
    let (format, settings) = (session.format.code.to_string(), session.settings.clone());
    let exposure_limits = session.exposure_limits;
    tracing::info!(%name, ?info, %format, ?settings, ?exposure_limits, "camera opened");
    let tally = Arc::new(Mutex::new(Tally::default()));
    let (counted, wanted, called) = (Arc::clone(&tally), *wanted, name.clone());
    let thread = CameraThread::spawn("gonio-camera", &name, move |requests| {
        let opened = monotonic();
        let (session, state) = (Some(session), State::default());
        let name = called;
        Worker { name, wanted, places, node, session, requests, options, tally: counted, opened, state }
            .run();
    })?;
    Ok(V4lCamera { info, format, settings, exposure_limits, tally, thread })
}

/// The first node that gives pictures; if none does, why the first does not.
fn open_first(nodes: Vec<Node>, wanted: &Wanted, name: &str) -> Result<(Node, Session), DeviceError> {
    let mut first = None;
    for node in nodes {
        match Session::open(&node, wanted, name) {
            Ok(session) => return Ok((node, session)),
            Err(error) => drop(first.get_or_insert(error)),
        }
    }
    Err(first.unwrap_or_else(|| DeviceError::Absent { device: name.to_owned() }))
}

impl V4lCamera {
    /// What became of the frames so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        *self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Four-character code of the format in use.
    #[must_use]
    pub fn format(&self) -> &str {
        &self.format
    }

    /// What was set when it was opened, as read back.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Shortest and longest exposure time, where the camera tells them.
    #[must_use]
    pub fn exposure_limits(&self) -> Option<[Duration; 2]> {
        self.exposure_limits
    }
}

impl Camera for V4lCamera {
    fn info(&self) -> CameraInfo {
        self.info.clone()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        self.thread.capture(exposure, cancel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::BayerPattern;

    #[test]
    fn a_camera_that_is_not_there_is_absent() {
        let wanted = Wanted { width: 160, height: 128, bits: 12, pattern: BayerPattern::Rggb };
        let error = open(&CameraName::Number(987), &wanted).expect_err("no such camera");
        assert_eq!(error, DeviceError::Absent { device: "v4l:987".into() });
        let plain = tempfile::NamedTempFile::new().expect("a file");
        let error = open(&CameraName::Path(plain.path().to_owned()), &wanted).expect_err("no camera");
        assert!(matches!(error, DeviceError::Io { .. }), "{error}");
    }
}
