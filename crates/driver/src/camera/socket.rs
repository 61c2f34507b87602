//! A camera behind a Unix socket: how one program lends its camera, the virtual one above all, to another.
//!
//! One client at a time owns the camera; a second is told that it is in use. A client that goes away cancels its capture.

use super::message::{Message, ReadError};
use gonio_instrument::{Camera, CameraInfo, Cancel, DeviceError, Frame};
use std::io;
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// How often a stop request is looked at while a frame is awaited.
const GLANCE: Duration = Duration::from_millis(20);
/// Longest wait beyond the exposure; tracing a pose for the first time takes seconds on a slow machine.
const PATIENCE: Duration = Duration::from_secs(120);
/// How long a client waits for the one before it to put the camera down.
const HANDOVER: Duration = Duration::from_secs(2);
/// How often the server looks whether it shall end.
const ACCEPT_GLANCE: Duration = Duration::from_millis(20);

type Shared = Arc<Mutex<Box<dyn Camera>>>;

/// A camera lent to other programs. Dropping it ends the service and removes the socket.
#[derive(Debug)]
pub struct CameraServer {
    path: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl CameraServer {
    /// Serves `camera` at `path`. A socket left behind by a program that died is replaced; one that is served, or a file that is no
    /// socket, is not.
    ///
    /// # Errors
    /// [`DeviceError::InUse`], [`DeviceError::Io`].
    pub fn serve(camera: Box<dyn Camera>, path: &Path) -> Result<CameraServer, DeviceError> {
        let device = path.display().to_string();
        let io_error =
            |error: io::Error| DeviceError::Io { device: device.clone(), reason: error.to_string() };
        if UnixStream::connect(path).is_ok() {
            return Err(DeviceError::InUse { device });
        }
        if let Ok(found) = std::fs::symlink_metadata(path) {
            use std::os::unix::fs::FileTypeExt as _;
            if !found.file_type().is_socket() {
                let reason = "exists and is no socket; choose another name".to_owned();
                return Err(DeviceError::Io { device, reason });
            }
            std::fs::remove_file(path).map_err(io_error)?;
        }
        let listener = UnixListener::bind(path).map_err(io_error)?;
        listener.set_nonblocking(true).map_err(io_error)?;
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        let camera: Shared = Arc::new(Mutex::new(camera));
        let thread = Builder::new()
            .name("gonio-camera-server".into())
            .spawn(move || accept(&listener, &camera, &seen))
            .map_err(io_error)?;
        Ok(CameraServer { path: path.to_path_buf(), stop, thread: Some(thread) })
    }

    /// Where it is served.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for CameraServer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = std::fs::remove_file(&self.path);
    }
}

fn accept(listener: &UnixListener, camera: &Shared, stop: &AtomicBool) {
    let mut guests: Vec<(UnixStream, JoinHandle<()>)> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => {
                let camera = Arc::clone(camera);
                let guest = stream.try_clone().and_then(|handle| {
                    stream.set_nonblocking(false)?;
                    let serve = move || serve_guest(stream, &camera);
                    Ok((handle, Builder::new().name("gonio-camera-guest".into()).spawn(serve)?))
                });
                match guest {
                    Ok(guest) => guests.push(guest),
                    Err(error) => tracing::warn!(%error, "a camera client could not be served"),
                }
            }
            Err(_) => std::thread::sleep(ACCEPT_GLANCE),
        }
        guests.retain(|(_, thread)| !thread.is_finished());
    }
    for (stream, thread) in guests {
        let _ = stream.shutdown(Shutdown::Both);
        let _ = thread.join();
    }
}

/// Until the guest goes. Its messages are read on a thread of their own, so that a cancel reaches a running capture.
fn serve_guest(stream: UnixStream, camera: &Shared) {
    let Ok(mut input) = stream.try_clone() else { return };
    let mut output = stream;
    let (sender, requests) = sync_channel::<(Message, Cancel)>(4);
    let reader = Builder::new().name("gonio-camera-reader".into()).spawn(move || {
        let mut current = Cancel::new();
        while let Ok(message) = Message::read(&mut input) {
            if message == Message::Cancel {
                current.stop();
                continue;
            }
            current = Cancel::new();
            if sender.send((message, current.clone())).is_err() {
                return;
            }
        }
        current.stop();
    });
    let mut lent = None;
    for (message, cancel) in requests {
        // Lent at the first question: whoever only looks whether the socket is served takes nothing.
        let Some(camera) = lent.take().or_else(|| lend(camera)) else {
            let _ = Message::Error(DeviceError::InUse { device: "the camera".into() }).write(&mut output);
            break;
        };
        let camera = lent.insert(camera);
        let answer = match message {
            Message::AskInfo => Message::Info(camera.info()),
            Message::Capture(exposure) => match camera.capture(exposure, &cancel) {
                Ok(frame) => Message::Frame(frame),
                Err(error) => Message::Error(error),
            },
            // Only a server says these.
            Message::Info(_) | Message::Frame(_) | Message::Error(_) | Message::Cancel => break,
        };
        if answer.write(&mut output).is_err() {
            break;
        }
    }
    let _ = output.shutdown(Shutdown::Both);
    if let Ok(reader) = reader {
        let _ = reader.join();
    }
}

/// The camera, unless another guest keeps it; one that has just gone may still be putting it down.
fn lend(camera: &Shared) -> Option<MutexGuard<'_, Box<dyn Camera>>> {
    let start = Instant::now();
    loop {
        match camera.try_lock() {
            Ok(camera) => return Some(camera),
            Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) if start.elapsed() < HANDOVER => std::thread::sleep(GLANCE),
            Err(TryLockError::WouldBlock) => return None,
        }
    }
}

/// A camera that another program lends through a socket.
#[derive(Debug)]
pub struct SocketCamera {
    name: String,
    output: UnixStream,
    answers: Receiver<Result<Message, ReadError>>,
    info: CameraInfo,
    /// Answers to cancelled captures that are still to come.
    stale: u32,
}

impl SocketCamera {
    /// Connects to the server at `path`.
    ///
    /// # Errors
    /// [`DeviceError::Absent`] if nobody serves there, [`DeviceError::Denied`], [`DeviceError::InUse`], [`DeviceError::Io`].
    pub fn connect(path: &Path) -> Result<SocketCamera, DeviceError> {
        let name = path.display().to_string();
        let output = UnixStream::connect(path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
                DeviceError::Absent { device: name.clone() }
            }
            io::ErrorKind::PermissionDenied => DeviceError::Denied { device: name.clone() },
            _ => DeviceError::Io { device: name.clone(), reason: error.to_string() },
        })?;
        let io_error = |error: io::Error| DeviceError::Io { device: name.clone(), reason: error.to_string() };
        let mut input = output.try_clone().map_err(io_error)?;
        let (sender, answers) = sync_channel(2);
        // Ends when the socket is shut down, at the latest when this camera is dropped.
        Builder::new()
            .name("gonio-camera".into())
            .spawn(move || {
                loop {
                    let answer = Message::read(&mut input);
                    let last = answer.is_err();
                    if sender.send(answer).is_err() || last {
                        return;
                    }
                }
            })
            .map_err(io_error)?;
        let mut camera = SocketCamera { name, output, answers, info: CameraInfo::default(), stale: 0 };
        match camera.ask(&Message::AskInfo, PATIENCE, &Cancel::new())? {
            Message::Info(info) => camera.info = info,
            other => return Err(camera.unexpected(&other)),
        }
        Ok(camera)
    }

    fn ask(
        &mut self,
        question: &Message,
        patience: Duration,
        cancel: &Cancel,
    ) -> Result<Message, DeviceError> {
        let refused = question.write(&mut self.output).is_err();
        let start = Instant::now();
        let mut cancelled = false;
        loop {
            match self.answers.recv_timeout(GLANCE) {
                Ok(Ok(Message::Error(DeviceError::InUse { .. }))) => {
                    return Err(DeviceError::InUse { device: self.name.clone() });
                }
                Ok(Ok(_)) if self.stale > 0 => self.stale -= 1,
                Ok(Ok(Message::Error(error))) => return Err(error),
                Ok(Ok(_)) if cancelled => return Err(DeviceError::Cancelled),
                Ok(Ok(message)) => return Ok(message),
                Ok(Err(ReadError::Malformed(reason))) => {
                    let reason = format!("a message of the camera server is damaged: {reason}");
                    return Err(DeviceError::Io { device: self.name.clone(), reason });
                }
                Ok(Err(ReadError::Closed | ReadError::Broken)) | Err(RecvTimeoutError::Disconnected) => {
                    return Err(DeviceError::Gone { device: self.name.clone() });
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if cancel.is_raised() && !cancelled && !refused {
                cancelled = true;
                let _ = Message::Cancel.write(&mut self.output);
            }
            if start.elapsed() > patience {
                self.stale += 1;
                return Err(DeviceError::Timeout {
                    device: self.name.clone(),
                    what: "a frame".to_owned(),
                    waited: patience,
                });
            }
        }
    }

    fn unexpected(&self, message: &Message) -> DeviceError {
        let kind = match message {
            Message::Frame(_) => "a frame",
            Message::Info(_) => "its description",
            _ => "a question",
        };
        let reason = format!("the camera server answered with {kind} where something else was asked for");
        DeviceError::Io { device: self.name.clone(), reason }
    }
}

impl Drop for SocketCamera {
    fn drop(&mut self) {
        // Ends the reading thread, and at the server the capture under way.
        let _ = self.output.shutdown(Shutdown::Both);
    }
}

impl Camera for SocketCamera {
    fn info(&self) -> CameraInfo {
        self.info.clone()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        if cancel.is_raised() {
            return Err(DeviceError::Cancelled);
        }
        match self.ask(&Message::Capture(exposure), exposure + PATIENCE, cancel)? {
            Message::Frame(frame) => Ok(frame),
            other => Err(self.unexpected(&other)),
        }
    }
}
