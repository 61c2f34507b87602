//! How far the device's clock is from the host's, from heartbeats: NTP's offset with its clock filter (RFC 5905, sections 8 and 10).
//!
//! A heartbeat leaves at `sent` and its telemetry, which carries the device's uptime, comes at `now`, both by the host's clock. The device read its
//! clock somewhere between; the middle is the best guess, and half the round trip the most it can be off. Of the last [`SAMPLES`] the one
//! with the shortest round trip is believed.

use core::time::Duration;

/// Heartbeats among which the best is chosen: a quarter of a second.
const SAMPLES: usize = 8;
/// Step of the device's clock in telemetry.
const STEP: Duration = Duration::from_millis(1);

/// The device's clock against the host's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockOffset {
    /// Device's uptime less host's time, microseconds.
    pub offset_us: i64,
    /// Most that can be off, if neither clock drifts within a quarter of a second.
    pub error: Duration,
}

/// Chooses among the latest heartbeats.
#[derive(Clone, Debug, Default)]
pub struct ClockFilter {
    samples: [Option<ClockOffset>; SAMPLES],
    next: usize,
}

impl ClockFilter {
    /// Nothing heard yet.
    pub const fn new() -> Self {
        ClockFilter { samples: [None; SAMPLES], next: 0 }
    }

    /// Takes a heartbeat sent at `sent` whose answer, with the device's `uptime`, came at `now`.
    pub fn sample(&mut self, sent: Duration, now: Duration, uptime: Duration) {
        let round_trip = now.saturating_sub(sent);
        let middle = sent.saturating_add(round_trip / 2);
        // the clock told stands still for a step: on average it is half a step ahead
        let device = uptime.saturating_add(STEP / 2);
        let micros = |d: Duration| i64::try_from(d.as_micros()).unwrap_or(i64::MAX);
        let offset_us = micros(device).saturating_sub(micros(middle));
        if let Some(slot) = self.samples.get_mut(self.next) {
            *slot = Some(ClockOffset { offset_us, error: round_trip / 2 + STEP / 2 });
        }
        self.next = (self.next + 1) % SAMPLES;
    }

    /// The best of the latest.
    pub fn offset(&self) -> Option<ClockOffset> {
        self.samples.iter().flatten().min_by_key(|sample| sample.error).copied()
    }
}
