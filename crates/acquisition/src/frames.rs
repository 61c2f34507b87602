//! Is this the frame that was asked for? Each frame is matched to one exposure of one pose, exactly once.
//!
//! * A gap in the sequence numbers: frames were exposed and lost; the one that came was exposed after them, under the same conditions, and
//!   takes their place. It is counted and told.
//! * A number that is not above the last: the frame before once more. Refused.
//! * The last row of the frame before, noise and all: the transfer was torn or stood still. Refused.
//! * After a capture that timed out the next frame may be the one that was late, exposed under another shutter or at another exposure:
//!   nobody can tell, so it is refused, whatever it is.

use gonio_instrument::{DeviceError, Frame};

/// What became of the camera's frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Taken.
    pub sound: u64,
    /// Exposed and lost on their way, by the gaps in the sequence.
    pub missing: u64,
    /// Refused: torn, or frozen.
    pub torn: u64,
    /// Refused: the frame before once more.
    pub repeated: u64,
    /// Refused: came after a capture that timed out.
    pub late: u64,
    /// Captures that timed out.
    pub timed_out: u64,
    /// Number of the first frame that came; what the camera did before nobody can tell.
    pub first: Option<u64>,
    /// Number of the last.
    pub last: Option<u64>,
}

/// What to do with a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Take it.
    Sound {
        /// Frames before it that never came.
        missing: u64,
    },
    /// Take another; why.
    Unusable(String),
}

/// Memory of the frames so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frames {
    counts: FrameCounts,
    /// By which a torn or frozen one is known.
    last_row: Vec<u16>,
    /// A capture has timed out; its frame may still be on its way.
    distrust: bool,
}

impl Frames {
    pub(crate) fn counts(&self) -> FrameCounts {
        self.counts
    }

    /// A capture that gave no frame.
    pub(crate) fn failed(&mut self, error: &DeviceError) {
        if matches!(error, DeviceError::Timeout { .. }) {
            self.counts.timed_out += 1;
            self.distrust = true;
        }
    }

    /// Judges a frame; `noisy` where the sensor has read noise, so that no two rows are alike.
    pub(crate) fn judge(&mut self, frame: &Frame, noisy: bool) -> Verdict {
        let missing = match self.counts.last {
            Some(last) if frame.sequence <= last => {
                self.counts.repeated += 1;
                return Verdict::Unusable(format!("frame {last} was the last, so this one came before"));
            }
            Some(last) => frame.sequence - last - 1,
            None => 0,
        };
        self.counts.last = Some(frame.sequence);
        self.counts.first.get_or_insert(frame.sequence);
        self.counts.missing += missing;
        let width = (frame.width as usize).max(1);
        let row = frame.pixels.chunks_exact(width).next_back().unwrap_or(&[]);
        let torn = noisy && row == self.last_row.as_slice() && has_structure(row);
        if std::mem::take(&mut self.distrust) {
            self.counts.late += 1;
            self.last_row = row.to_vec();
            return Verdict::Unusable(
                "it came after a capture that timed out, and may be that one's".to_owned(),
            );
        }
        if torn {
            self.counts.torn += 1;
            let why = "its last row is that of the frame before, noise and all: the transfer was torn or stood still";
            return Verdict::Unusable(why.to_owned());
        }
        self.last_row = row.to_vec();
        self.counts.sound += 1;
        Verdict::Sound { missing }
    }
}

/// A row without any structure, dark or saturated, tells nothing.
fn has_structure(row: &[u16]) -> bool {
    let level = row.first().copied().unwrap_or(0);
    row.iter().filter(|v| **v != level).count() > row.len() / 8
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn frame(sequence: u64, last_row: u16) -> Frame {
        let mut pixels: Vec<u16> = (0..64).map(|n| (n * 37 + sequence as u16 * 11) % 97).collect();
        for (n, p) in pixels[48..].iter_mut().enumerate() {
            *p = last_row + n as u16 % 5;
        }
        let (exposure, stamp) = (Duration::from_millis(1), Duration::ZERO);
        Frame { width: 16, height: 4, pixels, exposure, sequence, stamp, sensor_temperature_c: None }
    }

    fn timeout() -> DeviceError {
        DeviceError::Timeout { device: "c".into(), what: "a frame".into(), waited: Duration::ZERO }
    }

    #[test]
    fn every_frame_is_taken_once_or_told() {
        let mut frames = Frames::default();
        assert_eq!(frames.judge(&frame(5, 10), true), Verdict::Sound { missing: 0 });
        assert_eq!(frames.judge(&frame(8, 20), true), Verdict::Sound { missing: 2 });
        assert!(matches!(frames.judge(&frame(8, 20), true), Verdict::Unusable(_)), "once more");
        assert!(matches!(frames.judge(&frame(9, 20), true), Verdict::Unusable(_)), "torn");
        assert_eq!(
            frames.judge(&frame(10, 30), true),
            Verdict::Sound { missing: 0 },
            "no gap: it came, torn"
        );
        frames.failed(&timeout());
        assert!(matches!(frames.judge(&frame(11, 40), true), Verdict::Unusable(_)), "late, perhaps");
        assert_eq!(frames.judge(&frame(12, 50), true), Verdict::Sound { missing: 0 });
        let counts = FrameCounts {
            sound: 4,
            missing: 2,
            torn: 1,
            repeated: 1,
            late: 1,
            timed_out: 1,
            first: Some(5),
            last: Some(12),
        };
        assert_eq!(frames.counts(), counts);
    }

    #[test]
    fn rows_that_tell_nothing_are_not_held_against_a_frame() {
        let mut frames = Frames::default();
        let flat = |sequence| Frame { pixels: vec![64; 64], ..frame(sequence, 0) };
        assert_eq!(frames.judge(&flat(0), true), Verdict::Sound { missing: 0 });
        assert_eq!(frames.judge(&flat(1), true), Verdict::Sound { missing: 0 });
        assert_eq!(frames.judge(&frame(2, 10), false), Verdict::Sound { missing: 0 });
        assert_eq!(
            frames.judge(&frame(3, 10), false),
            Verdict::Sound { missing: 0 },
            "a sensor without noise"
        );
    }
}
