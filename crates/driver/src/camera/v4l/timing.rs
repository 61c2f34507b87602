//! Which frame answers a question: the first one that was exposed wholly after it, with the exposure that was set for it.
//!
//! A camera that streams has frames under way when it is asked, exposed before the sample stood where it stands now or before the new exposure
//! time. Most drivers stamp a frame when its first bytes arrive, whatever they call it, and a camera may hold a frame back for one frame
//! interval before it sends it. So a frame answers if its stamp is at least exposure and interval later than the question; and
//! after a change of the exposure time [`SETTLE`] frames pass first, since sensors take new settings over at the next frame but one.

use std::time::Duration;

/// Frames that pass after a change of the exposure time.
pub const SETTLE: u32 = 2;
/// Longest time that a camera is believed to hold a frame back.
const HELD_BACK: Duration = Duration::from_millis(200);
/// Longest wait for a frame beyond what exposure and interval explain.
const PATIENCE: Duration = Duration::from_secs(3);

/// A question that waits for its frame. Times are of the kernel's monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Question {
    /// When it was asked, all settings made.
    pub asked: Duration,
    /// The exposure time that the camera took.
    pub exposure: Duration,
    /// Frames still to pass.
    pub settle: u32,
    /// Time between frames, where the camera tells it.
    pub interval: Duration,
}

impl Question {
    /// Whether the frame of this stamp answers; counts those that pass.
    pub fn answered_by(&mut self, stamp: Duration) -> bool {
        if stamp < self.asked {
            return false;
        }
        if self.settle > 0 {
            self.settle -= 1;
            return false;
        }
        stamp >= self.asked + self.exposure + self.interval.min(HELD_BACK)
    }

    /// How long the answer may take.
    #[must_use]
    pub fn patience(&self) -> Duration {
        let frame = self.exposure.max(self.interval);
        frame * (self.settle + 3) + PATIENCE
    }
}

/// Frames that the driver lost, from its running number: what lies between the last one and this. A number that goes back began anew.
#[must_use]
pub fn gap(last: Option<u32>, now: u32) -> u64 {
    let Some(last) = last else { return 0 };
    match now.wrapping_sub(last) {
        0 => 0,
        ahead if ahead < u32::MAX / 2 => u64::from(ahead - 1),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(n: u64) -> Duration {
        Duration::from_millis(n)
    }

    /// Stamp of the first frame that answers, of a stream with this interval.
    fn answer(mut question: Question, first: u64, interval: u64) -> u64 {
        (0..100)
            .map(|n| first + n * interval)
            .find(|stamp| question.answered_by(ms(*stamp)))
            .expect("an answer")
    }

    #[test]
    fn a_frame_under_way_when_asked_never_answers() {
        for exposure in [1, 20, 33] {
            for first in 0..33 {
                let question =
                    Question { asked: ms(100), exposure: ms(exposure), settle: 0, interval: ms(33) };
                let stamp = answer(question, first, 33);
                // stamped at its arrival, held back for an interval before it
                assert!(stamp - 33 - exposure >= 100, "exposure began at {}", stamp - 33 - exposure);
                assert!(stamp <= 100 + 33 + exposure + 33, "and no frame more than needed: {stamp}");
            }
        }
    }

    #[test]
    fn after_a_change_two_frames_pass() {
        let question = Question { asked: ms(100), exposure: ms(1), settle: SETTLE, interval: ms(10) };
        assert_eq!(answer(question, 5, 10), 125, "105 and 115 pass");
        let mut late = question;
        assert!(
            !late.answered_by(ms(99)) && late.settle == SETTLE,
            "an old frame does not count as one of them"
        );
    }

    #[test]
    fn patience_covers_what_has_to_pass() {
        let question = Question { asked: ms(0), exposure: ms(2000), settle: SETTLE, interval: ms(33) };
        assert!(question.patience() >= ms(2000) * (SETTLE + 2));
    }

    #[test]
    fn lost_frames_are_counted_over_the_turn_of_the_number() {
        assert_eq!(gap(None, 7), 0);
        assert_eq!(gap(Some(7), 8), 0);
        assert_eq!(gap(Some(7), 11), 3);
        assert_eq!(gap(Some(u32::MAX), 2), 2);
        assert_eq!(gap(Some(500), 0), 0, "the stream began anew");
        assert_eq!(gap(Some(5), 5), 0);
    }
}
