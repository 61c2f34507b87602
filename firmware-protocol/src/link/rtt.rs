//! When to send again: RFC 6298.
//!
//! First sample R: `SRTT = R`, `RTTVAR = R/2`. Then `RTTVAR = 3/4 RTTVAR + 1/4 |SRTT − R|`,
//! `SRTT = 7/8 SRTT + 1/8 R`, `RTO = SRTT + max(G, 4 RTTVAR)`; doubled at each expiry (section 5.5). The RFC's floor of
//! one second is meant for the internet; this link is a cable, so the floor is [`MIN_RTO`] and the ceiling [`MAX_RTO`].

use core::time::Duration;

/// Shortest retransmission time-out.
pub const MIN_RTO: Duration = Duration::from_millis(20);
/// Longest retransmission time-out.
pub const MAX_RTO: Duration = Duration::from_millis(1000);
/// Time-out before the first sample.
pub const INITIAL_RTO: Duration = Duration::from_millis(100);
/// Granularity of the clock, G.
const GRANULARITY: Duration = Duration::from_millis(1);

/// Round-trip estimator.
#[derive(Clone, Copy, Debug)]
pub struct RoundTrip {
    smoothed: Option<Duration>,
    variation: Duration,
    rto: Duration,
}

impl Default for RoundTrip {
    fn default() -> Self {
        Self::new()
    }
}

impl RoundTrip {
    /// No sample yet.
    pub const fn new() -> Self {
        RoundTrip { smoothed: None, variation: Duration::ZERO, rto: INITIAL_RTO }
    }

    /// Takes a sample. Never from a frame that was sent more than once (Karn).
    pub fn sample(&mut self, measured: Duration) {
        let smoothed = match self.smoothed {
            None => {
                self.variation = measured / 2;
                measured
            }
            Some(smoothed) => {
                self.variation = self.variation * 3 / 4 + smoothed.abs_diff(measured) / 4;
                smoothed * 7 / 8 + measured / 8
            }
        };
        self.smoothed = Some(smoothed);
        self.reset();
    }

    /// Takes back the doubling, after an acknowledgement of something new.
    pub fn reset(&mut self) {
        if let Some(smoothed) = self.smoothed {
            self.rto = (smoothed + (self.variation * 4).max(GRANULARITY)).clamp(MIN_RTO, MAX_RTO);
        } else {
            self.rto = INITIAL_RTO;
        }
    }

    /// The timer has expired.
    pub fn back_off(&mut self) {
        self.rto = (self.rto * 2).min(MAX_RTO);
    }

    /// Current time-out.
    pub fn rto(&self) -> Duration {
        self.rto
    }

    /// Smoothed round trip.
    pub fn smoothed(&self) -> Option<Duration> {
        self.smoothed
    }
}
