//! A lease: something may go on only while it is renewed.

use core::time::Duration;

/// A lease of fixed length. Not held at first.
#[derive(Clone, Copy, Debug)]
pub struct Lease {
    length: Duration,
    expires: Option<Duration>,
}

impl Lease {
    /// A lease that lasts for `length` after each renewal.
    pub const fn new(length: Duration) -> Lease {
        Lease { length, expires: None }
    }

    /// Starts it, or starts it again.
    pub fn take(&mut self, now: Duration) {
        self.expires = Some(now.saturating_add(self.length));
    }

    /// Renews it if it is held. One that has run out is renewed as well as long as nobody has acted on that: a device that hears a
    /// heartbeat before it looks at its clock has not been left alone.
    pub fn renew(&mut self, now: Duration) {
        if self.is_held() {
            self.take(now);
        }
    }

    /// Gives it back: what it guarded has ended, or its expiry has been acted on.
    pub fn release(&mut self) {
        self.expires = None;
    }

    /// Taken and not given back.
    pub fn is_held(&self) -> bool {
        self.expires.is_some()
    }

    /// Held, and its time is over.
    pub fn is_expired(&self, now: Duration) -> bool {
        self.expires.is_some_and(|at| now >= at)
    }

    /// When it will expire.
    pub fn expires(&self) -> Option<Duration> {
        self.expires
    }
}
