//! A device whose port came back: is it the one that was there, and does it stand where it stood?
//!
//! A new boot counter voids positions (the protocol tells that itself). Where the counter is the same the encoders have been counting all the
//! while, so the axes must stand where the last telemetry saw them, unless something was under way that moves them.

use gonio_protocol::message::{Motion, Status};
use std::time::{Duration, Instant};

/// Encoders of axes at rest may flicker by this, micro-degrees.
const FLICKER_UDEG: i64 = 2_000;

/// What was known when the port hung up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Returning {
    before: Option<Status>,
    /// A command that moves the axes was under way.
    motion: bool,
    since: Instant,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Checked {
    /// All is as it was.
    Same,
    /// Positions are void; why.
    Moved(String),
}

impl Returning {
    pub fn new(before: Option<Status>, motion: bool, since: Instant) -> Returning {
        Returning { before, motion, since }
    }

    /// How long it was away.
    pub fn away(&self) -> Duration {
        self.since.elapsed()
    }

    /// Compares the first state told after the return with the last before.
    pub fn check(&self, now: &Status) -> Checked {
        let Some(before) = self.before else { return Checked::Same };
        if before.boot != now.boot {
            return Checked::Moved(format!("has restarted (start number {})", now.boot));
        }
        if before.homed && !now.homed {
            return Checked::Moved("came back without its positions".to_owned());
        }
        let at_rest = before.motion == Motion::Idle && now.motion == Motion::Idle && !self.motion;
        let off = |a: i32, b: i32| (i64::from(a) - i64::from(b)).abs();
        let tilt = off(before.position.tilt_udeg, now.position.tilt_udeg);
        let spin = off(before.position.spin_udeg, now.position.spin_udeg);
        if at_rest && before.homed && tilt.max(spin) > FLICKER_UDEG {
            return Checked::Moved(format!(
                "stood at rest and came back {:.3}° (tilt) and {:.3}° (spin) from there",
                tilt as f64 / 1e6,
                spin as f64 / 1e6
            ));
        }
        Checked::Same
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_protocol::message::Position;

    fn status(boot: u32, homed: bool, tilt_udeg: i32) -> Status {
        Status { boot, homed, position: Position { tilt_udeg, spin_udeg: 0 }, ..Status::default() }
    }

    fn check(before: Status, motion: bool, now: Status) -> bool {
        Returning::new(Some(before), motion, Instant::now()).check(&now) == Checked::Same
    }

    #[test]
    fn only_the_same_device_at_the_same_place_goes_on() {
        let before = status(3, true, 40_000_000);
        assert!(check(before, false, before));
        assert!(check(before, false, status(3, true, 40_001_000)), "encoders flicker");
        assert!(!check(before, false, status(3, true, 40_003_000)), "somebody turned it");
        assert!(!check(before, false, status(4, true, 40_000_000)), "it has restarted");
        assert!(!check(before, false, status(3, false, 40_000_000)), "it has lost its positions");
        assert!(check(before, true, status(3, true, 10_000_000)), "a move was under way");
        assert!(
            check(status(3, false, 0), false, status(3, false, 9_000_000)),
            "never homed: nothing to lose"
        );
    }
}
