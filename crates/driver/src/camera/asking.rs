//! How a capture reaches the thread that owns a camera, and how its frame comes back: one question at a time, given up when a stop is asked for.

use gonio_instrument::{Cancel, DeviceError, Frame};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// How often a stop request is looked at while a frame is awaited.
const GLANCE: Duration = Duration::from_millis(20);
/// Questions that may lie there: the one under way and those given up before it.
const DEPTH: usize = 4;

/// A capture asked for by another thread.
pub(super) struct Request {
    pub exposure: Duration,
    pub answer: SyncSender<Result<Frame, DeviceError>>,
    abandoned: Arc<AtomicBool>,
}

impl Request {
    /// Nobody waits for the answer any more.
    pub fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }

    /// Answers it; the one who asked may have lost interest.
    pub fn answer(self, result: Result<Frame, DeviceError>) {
        let _ = self.answer.try_send(result);
    }
}

/// The thread of a camera and the way to it. Dropped, it waits until the thread has put the camera down.
#[derive(Debug)]
pub(super) struct CameraThread {
    name: String,
    requests: Option<SyncSender<Request>>,
    thread: Option<JoinHandle<()>>,
}

impl CameraThread {
    /// Starts `work` on a thread; it ends when the channel it is given ends. `name` is what the user calls the camera.
    pub fn spawn(
        thread: &str,
        name: &str,
        work: impl FnOnce(Receiver<Request>) + Send + 'static,
    ) -> Result<CameraThread, DeviceError> {
        let (requests, inbox) = sync_channel(DEPTH);
        let thread = Builder::new()
            .name(thread.to_owned())
            .spawn(move || work(inbox))
            .map_err(|e| DeviceError::Io { device: name.to_owned(), reason: e.to_string() })?;
        Ok(CameraThread { name: name.to_owned(), requests: Some(requests), thread: Some(thread) })
    }

    /// Asks for a frame and waits for it.
    pub fn capture(&self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        if cancel.is_raised() {
            return Err(DeviceError::Cancelled);
        }
        let gone = || DeviceError::Gone { device: self.name.clone() };
        let (answer, frame) = sync_channel(1);
        let abandoned = Arc::new(AtomicBool::new(false));
        let request = Request { exposure, answer, abandoned: Arc::clone(&abandoned) };
        self.requests.as_ref().ok_or_else(gone)?.send(request).map_err(|_| gone())?;
        loop {
            match frame.recv_timeout(GLANCE) {
                Ok(result) => return result,
                Err(RecvTimeoutError::Disconnected) => return Err(gone()),
                Err(RecvTimeoutError::Timeout) if cancel.is_raised() => {
                    abandoned.store(true, Ordering::Relaxed);
                    return Err(DeviceError::Cancelled);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

impl Drop for CameraThread {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            // a panic has been printed where it happened
            let _ = thread.join();
        }
    }
}

/// Refuses a frame with counts above the instrument's depth: a camera that puts its values into the upper bits of a word would be read as too bright by a
/// power of two.
pub(super) fn check_depth(frame: Frame, bits: u32) -> Result<Frame, DeviceError> {
    let top = u16::try_from((1u32 << bits.min(16)) - 1).unwrap_or(u16::MAX);
    match frame.pixels.iter().find(|p| **p > top) {
        None => Ok(frame),
        Some(high) => Err(DeviceError::BadFrame {
            sequence: frame.sequence,
            reason: format!(
                "it holds a count of {high}, above {top}, the top of the instrument's {bits} bits; if the camera fills the upper bits of its words, \
                 describe it with bits = 16"
            ),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    fn frame(top: u16) -> Frame {
        Frame {
            width: 2,
            height: 1,
            pixels: vec![3, top],
            exposure: Duration::ZERO,
            sequence: 9,
            stamp: Duration::ZERO,
            sensor_temperature_c: None,
        }
    }

    #[test]
    fn counts_beyond_the_depth_are_told() {
        assert!(check_depth(frame(4095), 12).is_ok() && check_depth(frame(65535), 16).is_ok());
        let error = check_depth(frame(4096), 12).expect_err("13 bits").to_string();
        assert!(error.contains("4096") && error.contains("4095") && error.contains("bits = 16"), "{error}");
    }

    #[test]
    fn a_question_is_answered_given_up_or_told_that_nobody_is_there() {
        let (given_up, seen) = sync_channel(8);
        let camera = CameraThread::spawn("test-camera", "eye", move |inbox| {
            while let Ok(request) = inbox.recv() {
                match request.exposure.as_millis() {
                    1 => request.answer(Ok(frame(5))),
                    2 => {
                        let end = Instant::now() + Duration::from_secs(10);
                        while !request.is_abandoned() && Instant::now() < end {
                            std::thread::sleep(Duration::from_millis(1));
                        }
                        let _ = given_up.send(request.is_abandoned());
                    }
                    _ => return,
                }
            }
        })
        .expect("a thread");
        let cancel = Cancel::new();
        assert_eq!(camera.capture(Duration::from_millis(1), &cancel), Ok(frame(5)));
        let raised = Cancel::new();
        let raise = raised.clone();
        let stopper = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(30));
            raise.stop();
        });
        assert_eq!(camera.capture(Duration::from_millis(2), &raised), Err(DeviceError::Cancelled));
        assert_eq!(seen.recv_timeout(Duration::from_secs(10)), Ok(true), "the camera is told");
        stopper.join().expect("it stops");
        assert_eq!(camera.capture(Duration::from_millis(1), &raised), Err(DeviceError::Cancelled));
        let gone = camera.capture(Duration::from_millis(3), &cancel);
        assert_eq!(gone, Err(DeviceError::Gone { device: "eye".into() }));
    }
}
