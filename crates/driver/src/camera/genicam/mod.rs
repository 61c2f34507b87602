//! GenICam cameras (GigE Vision, USB3 Vision) through the Aravis library: raw frames, one for each trigger, exposure and gain by hand.
//!
//! A thread of its own (`gonio-genicam`) has the camera. A frame that comes damaged is taken again, three times at most, and shows as a gap in
//! [`Frame::sequence`]. A camera that does not answer any more is opened anew until it does or patience ends.
//!
//! Built with the feature `genicam`, which needs libaravis 0.8.25 or newer.

mod formats;
mod session;

pub use formats::choose;

use crate::camera::asking::{CameraThread, Request, check_depth};
use crate::camera::raw::Wanted;
use aravis::Aravis;
use gonio_instrument::{Camera, CameraInfo, Cancel, DeviceError, Frame};
use session::{Arrived, Session};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Tries for a frame that comes damaged.
const TRIES: u32 = 3;
/// Longest wait for a frame beyond its exposure.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often a camera that does not answer is looked for.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// A GenICam camera that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GenicamDevice {
    /// What to give to `--camera genicam:`.
    pub id: String,
    /// Vendor and model.
    pub description: String,
    /// `GigEVision` or `USB3Vision`.
    pub protocol: String,
    /// Network address or USB place.
    pub address: String,
}

/// Lists the cameras that answer; takes about a second, since those on the network are asked.
#[must_use]
pub fn list() -> Vec<GenicamDevice> {
    // the library gives its token once, and lists only to who holds it
    static LIBRARY: OnceLock<Mutex<Option<Aravis>>> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| Mutex::new(Aravis::initialize().ok()));
    let library = library.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(library) = library.as_ref() else { return Vec::new() };
    let text = |t: &std::ffi::CString| t.to_string_lossy().into_owned();
    let found = crate::camera::guard::guarded(|| library.get_device_list()).unwrap_or_default();
    found
        .iter()
        .map(|d| GenicamDevice {
            id: text(&d.id),
            description: format!("{} {}", text(&d.vendor), text(&d.model)),
            protocol: text(&d.protocol),
            address: text(&d.address),
        })
        .collect()
}

/// An open GenICam camera.
#[derive(Debug)]
pub struct GenicamCamera {
    info: CameraInfo,
    format: String,
    settings: Vec<String>,
    thread: CameraThread,
}

/// Opens the camera of this id (as [`list`] gives it, or an address; empty for the first that is found). A camera that is lost is looked for as long as
/// `patience`.
///
/// # Errors
/// [`DeviceError::Absent`], [`DeviceError::InUse`]; [`DeviceError::Io`] where no format fits; [`DeviceError::Refused`] where it stays automatic or has not the
/// wanted size.
pub fn open(id: &str, wanted: &Wanted, patience: Duration) -> Result<GenicamCamera, DeviceError> {
    let name = format!("genicam:{id}");
    let (opened, ready) = sync_channel(1);
    let (called, id, wanted) = (name.clone(), id.to_owned(), *wanted);
    // the library's objects stay on the thread that made them
    let thread = CameraThread::spawn("gonio-genicam", &name, move |requests| {
        match Session::open(&id, &wanted, &called) {
            Err(error) => drop(opened.try_send(Err(error))),
            Ok(session) => {
                let info = CameraInfo {
                    name: session.model.clone(),
                    serial: session.serial.clone(),
                    width: wanted.width,
                    height: wanted.height,
                    bits: session.told_bits().unwrap_or(0),
                };
                drop(opened.try_send(Ok((info, session.format_name.clone(), session.settings.clone()))));
                let worker = Worker {
                    name: called,
                    id,
                    wanted,
                    patience,
                    session: Some(session),
                    opened: Instant::now(),
                    number: 0,
                };
                worker.run(&requests);
            }
        }
    })?;
    let gone = DeviceError::Gone { device: name };
    let (info, format, settings) = ready.recv().unwrap_or(Err(gone))?;
    tracing::info!(?info, %format, ?settings, "GenICam camera opened");
    Ok(GenicamCamera { info, format, settings, thread })
}

impl GenicamCamera {
    /// Name of the pixel format in use.
    #[must_use]
    pub fn format(&self) -> &str {
        &self.format
    }

    /// What was set when it was opened.
    #[must_use]
    pub fn settings(&self) -> &[String] {
        &self.settings
    }
}

impl Camera for GenicamCamera {
    fn info(&self) -> CameraInfo {
        self.info.clone()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        self.thread.capture(exposure, cancel)
    }
}

struct Worker {
    name: String,
    id: String,
    wanted: Wanted,
    patience: Duration,
    session: Option<Session>,
    opened: Instant,
    /// Number of the frame given last.
    number: u64,
}

impl Worker {
    /// Until nobody can ask any more.
    fn run(mut self, requests: &Receiver<Request>) {
        while let Ok(request) = requests.recv() {
            let result = self.serve(&request);
            request.answer(result);
        }
    }

    fn serve(&mut self, request: &Request) -> Result<Frame, DeviceError> {
        let since = Instant::now();
        let mut silent_before = false;
        loop {
            if request.is_abandoned() {
                return Err(DeviceError::Cancelled);
            }
            match self.capture(request) {
                Err(DeviceError::Io { reason, .. }) if since.elapsed() < self.patience => {
                    tracing::warn!("{}: {reason}; it is opened anew", self.name);
                    self.session = None;
                    std::thread::sleep(LOOK_AGAIN);
                }
                Err(DeviceError::Absent { .. } | DeviceError::InUse { .. })
                    if since.elapsed() < self.patience =>
                {
                    std::thread::sleep(LOOK_AGAIN);
                }
                // one that was switched off and on again takes settings as before, and sends nobody anything
                Err(DeviceError::Timeout { .. }) if !silent_before => {
                    tracing::warn!("{}: no frame came; it is opened anew", self.name);
                    silent_before = true;
                    self.session = None;
                }
                Err(silent @ DeviceError::Timeout { .. }) => {
                    self.session = None;
                    return Err(silent);
                }
                Err(DeviceError::Io { .. } | DeviceError::Absent { .. }) => {
                    self.session = None;
                    return Err(DeviceError::Gone { device: self.name.clone() });
                }
                other => return other,
            }
        }
    }

    fn capture(&mut self, request: &Request) -> Result<Frame, DeviceError> {
        let session = match &mut self.session {
            Some(session) => session,
            none => none.insert(Session::open(&self.id, &self.wanted, &self.name)?),
        };
        let exposure = session.set_exposure(request.exposure, &self.name)?;
        let wait = exposure + PATIENCE;
        for _ in 0..TRIES {
            let asked = self.opened.elapsed();
            self.number += 1;
            let why = match session.shoot(wait, &self.name, || request.is_abandoned())? {
                Arrived::Counts(pixels, id) => {
                    tracing::trace!("{}: frame {id}", self.name);
                    let frame = Frame {
                        width: self.wanted.width,
                        height: self.wanted.height,
                        pixels,
                        exposure,
                        sequence: self.number,
                        stamp: asked,
                        sensor_temperature_c: None,
                    };
                    return check_depth(frame, self.wanted.bits);
                }
                Arrived::Damaged(why) => why,
                Arrived::Nothing if request.is_abandoned() => return Err(DeviceError::Cancelled),
                Arrived::Nothing => {
                    let (device, what) = (self.name.clone(), "a frame".to_owned());
                    return Err(DeviceError::Timeout { device, what, waited: wait });
                }
            };
            tracing::warn!("{}: a frame is of no use: {why}; it is taken again", self.name);
        }
        let reason = format!("{TRIES} frames one after the other were damaged; see to cable and network");
        Err(DeviceError::BadFrame { sequence: self.number, reason })
    }
}
