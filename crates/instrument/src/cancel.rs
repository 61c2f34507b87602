//! A request to stop that other threads and signal handlers can set.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// How urgently to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopping {
    /// Go on.
    No,
    /// Stop in a controlled way, keep what was measured.
    Controlled,
    /// Emergency stop: motion and lamp off at once.
    Emergency,
}

/// Shared, clonable stop request. Once raised it only grows more urgent.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicU8>);

impl Cancel {
    /// A request that is not raised.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks for a controlled stop.
    pub fn stop(&self) {
        self.0.fetch_max(1, Ordering::SeqCst);
    }

    /// Asks for an emergency stop.
    pub fn emergency_stop(&self) {
        self.0.fetch_max(2, Ordering::SeqCst);
    }

    /// What is asked for.
    #[must_use]
    pub fn state(&self) -> Stopping {
        match self.0.load(Ordering::SeqCst) {
            0 => Stopping::No,
            1 => Stopping::Controlled,
            _ => Stopping::Emergency,
        }
    }

    /// Whether any stop is asked for.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.state() != Stopping::No
    }
}
