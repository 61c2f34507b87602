//! A bad camera: a wrapper around any camera that drops, tears, freezes, repeats and delays frames, and is unplugged; all of it drawn from a
//! seed, for each frame of the camera below by its place.

use crate::dice::Dice;
use gonio_instrument::{Camera, CameraInfo, Cancel, DeviceError, Frame};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// How bad the camera is: chances per frame, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraFaults {
    /// A frame is lost on its way; the next one comes, and its sequence number shows the gap.
    pub dropped: f64,
    /// The lower rows are those that the host's buffer held before.
    pub torn: f64,
    /// The host's buffer is not written at all, and comes under a new sequence number.
    pub frozen: f64,
    /// The frame before comes once more, sequence number and all.
    pub duplicated: f64,
    /// The frame comes so late that its capture has been given up; the next capture gets it.
    pub late: f64,
    /// How long a late frame is waited for.
    pub late_by: Duration,
    /// The camera is unplugged after so many frames.
    pub unplugged_after: Option<u64>,
}

/// What was done to the frames, for those who count.
#[derive(Clone, Debug, Default)]
pub struct CameraTally(Arc<[AtomicU64; 5]>);

/// Counts of a [`CameraTally`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mistreated {
    /// Lost on their way.
    pub dropped: u64,
    /// Torn.
    pub torn: u64,
    /// Frozen.
    pub frozen: u64,
    /// Given twice.
    pub duplicated: u64,
    /// Given too late.
    pub late: u64,
}

impl CameraTally {
    fn add(&self, which: usize) {
        if let Some(counter) = self.0.get(which) {
            counter.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// So far.
    #[must_use]
    pub fn counts(&self) -> Mistreated {
        let [dropped, torn, frozen, duplicated, late] = [0, 1, 2, 3, 4]
            .map(|n: usize| self.0.get(n).map_or(0, |counter| counter.load(Ordering::Relaxed)));
        Mistreated { dropped, torn, frozen, duplicated, late }
    }
}

/// A camera with faults.
#[derive(Debug)]
pub struct FaultyCamera<C> {
    inner: C,
    faults: CameraFaults,
    dice: Dice,
    frames: u64,
    /// What the host's buffer holds: the frame given last.
    buffer: Option<Frame>,
    /// A late frame that waits for the next capture.
    late: Option<Frame>,
    tally: CameraTally,
}

impl<C: Camera> FaultyCamera<C> {
    /// Puts `inner` behind faults; the same seed draws the same fate for the n-th frame.
    pub fn new(inner: C, faults: CameraFaults, seed: u64) -> FaultyCamera<C> {
        FaultyCamera {
            inner,
            faults,
            dice: Dice(seed ^ 0xfa17),
            frames: 0,
            buffer: None,
            late: None,
            tally: CameraTally::default(),
        }
    }

    /// Counts on while the camera is used.
    #[must_use]
    pub fn tally(&self) -> CameraTally {
        self.tally.clone()
    }

    fn give(&mut self, frame: Frame) -> Frame {
        self.buffer = Some(frame.clone());
        frame
    }
}

impl<C: Camera> Camera for FaultyCamera<C> {
    fn info(&self) -> CameraInfo {
        self.inner.info()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        loop {
            if self.faults.unplugged_after.is_some_and(|n| self.frames >= n) {
                return Err(DeviceError::Gone { device: self.inner.info().name });
            }
            if let Some(frame) = self.late.take() {
                return Ok(self.give(frame));
            }
            let mut frame = self.inner.capture(exposure, cancel)?;
            self.frames += 1;
            let faults = self.faults;
            let [dropped, torn, frozen, duplicated, late] =
                [faults.dropped, faults.torn, faults.frozen, faults.duplicated, faults.late]
                    .map(|chance| self.dice.happens(chance));
            let cut = self.dice.fraction();
            if dropped {
                self.tally.add(0);
                continue;
            }
            if let Some(before) = &self.buffer
                && before.pixels.len() == frame.pixels.len()
            {
                if duplicated {
                    self.tally.add(3);
                    return Ok(before.clone());
                }
                if frozen {
                    self.tally.add(2);
                    frame.pixels.clone_from(&before.pixels);
                } else if torn {
                    self.tally.add(1);
                    let row = (cut * f64::from(frame.height)) as usize;
                    let from = row * frame.width as usize;
                    for (new, old) in frame.pixels.iter_mut().zip(&before.pixels).skip(from) {
                        *new = *old;
                    }
                }
            }
            if late {
                self.tally.add(4);
                self.late = Some(frame);
                wait(self.faults.late_by, cancel)?;
                return Err(DeviceError::Timeout {
                    device: self.inner.info().name,
                    what: "a frame".to_owned(),
                    waited: exposure + self.faults.late_by,
                });
            }
            return Ok(self.give(frame));
        }
    }
}

/// Waits unless a stop is asked for.
fn wait(time: Duration, cancel: &Cancel) -> Result<(), DeviceError> {
    let end = Instant::now() + time;
    loop {
        if cancel.is_raised() {
            return Err(DeviceError::Cancelled);
        }
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(());
        }
        std::thread::sleep(left.min(Duration::from_millis(10)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frame n is full of n, and has number n.
    struct Counting(u64);

    impl Camera for Counting {
        fn info(&self) -> CameraInfo {
            CameraInfo { name: "counting".into(), width: 4, height: 8, bits: 12, ..CameraInfo::default() }
        }

        fn capture(&mut self, exposure: Duration, _: &Cancel) -> Result<Frame, DeviceError> {
            self.0 += 1;
            Ok(Frame {
                width: 4,
                height: 8,
                pixels: vec![self.0 as u16; 32],
                exposure,
                sequence: self.0,
                stamp: Duration::ZERO,
                sensor_temperature_c: None,
            })
        }
    }

    fn shots(faults: CameraFaults, seed: u64) -> (Vec<Result<Frame, DeviceError>>, Mistreated) {
        let mut camera = FaultyCamera::new(Counting(0), faults, seed);
        let tally = camera.tally();
        let shots = (0..100).map(|_| camera.capture(Duration::from_millis(1), &Cancel::new())).collect();
        (shots, tally.counts())
    }

    fn none() -> CameraFaults {
        CameraFaults::default()
    }

    #[test]
    fn dropped_frames_leave_a_gap_in_the_sequence() {
        let (shots, tally) = shots(CameraFaults { dropped: 0.3, ..none() }, 1);
        let numbers: Vec<u64> = shots.into_iter().map(|f| f.expect("a frame").sequence).collect();
        let gaps: u64 = numbers.windows(2).map(|n| n[1] - n[0] - 1).sum();
        assert_eq!(numbers[0] - 1 + gaps, tally.dropped);
        assert!(tally.dropped > 10);
    }

    #[test]
    fn frozen_frames_repeat_and_torn_frames_repeat_in_their_lower_part() {
        let (frozen, _) = shots(CameraFaults { frozen: 1.0, ..none() }, 1);
        let frozen: Vec<Frame> = frozen.into_iter().map(|f| f.expect("a frame")).collect();
        assert!(frozen.windows(2).all(|f| f[0].pixels == f[1].pixels && f[0].sequence < f[1].sequence));
        let (torn, tally) = shots(CameraFaults { torn: 0.2, ..none() }, 1);
        let torn: Vec<Frame> = torn.into_iter().map(|f| f.expect("a frame")).collect();
        let last_row_old = torn.windows(2).filter(|f| f[0].pixels[31] == f[1].pixels[31]).count();
        assert_eq!(last_row_old as u64, tally.torn);
        assert!(tally.torn > 5);
    }

    #[test]
    fn duplicates_come_twice_and_late_frames_to_the_capture_after_theirs() {
        let (twice, tally) = shots(CameraFaults { duplicated: 0.2, ..none() }, 1);
        let twice: Vec<Frame> = twice.into_iter().map(|f| f.expect("a frame")).collect();
        assert_eq!(twice.windows(2).filter(|f| f[0] == f[1]).count() as u64, tally.duplicated);
        let (late, tally) = shots(CameraFaults { late: 0.2, ..none() }, 1);
        let timeouts = late.iter().filter(|f| matches!(f, Err(DeviceError::Timeout { .. }))).count();
        assert_eq!(timeouts as u64, tally.late);
        let mut numbers = late.into_iter().flatten().map(|f| f.sequence);
        assert!(numbers.by_ref().zip(1..).all(|(found, n)| found == n), "late, and none lost");
    }

    #[test]
    fn an_unplugged_camera_says_so_and_a_seed_gives_the_same_fate_twice() {
        let (unplugged, _) = shots(CameraFaults { unplugged_after: Some(2), ..none() }, 1);
        assert!(unplugged[1].is_ok() && matches!(unplugged[2], Err(DeviceError::Gone { .. })));
        let bad = CameraFaults { dropped: 0.2, torn: 0.2, frozen: 0.1, duplicated: 0.1, late: 0.1, ..none() };
        assert_eq!(shots(bad, 7).0, shots(bad, 7).0);
        assert_ne!(shots(bad, 7).0, shots(bad, 8).0);
    }
}
