//! What a device told, with its time, to be waited for.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

type Shared<T> = Arc<(Mutex<Vec<(Instant, T)>>, Condvar)>;

/// A list that grows on a device's thread and is waited for on another.
#[derive(Debug)]
pub struct Events<T>(Shared<T>);

impl<T> Clone for Events<T> {
    fn clone(&self) -> Self {
        Events(Arc::clone(&self.0))
    }
}

impl<T: Clone> Events<T> {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Events<T> {
        Events(Arc::new((Mutex::new(Vec::new()), Condvar::new())))
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(Instant, T)>> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Now this happened.
    pub fn add(&self, event: T) {
        self.lock().push((Instant::now(), event));
        self.0.1.notify_all();
    }

    /// Forgets what was.
    pub fn clear(&self) {
        self.lock().clear();
    }

    /// All so far, and forgets them.
    pub fn drain(&self) -> Vec<T> {
        self.lock().drain(..).map(|(_, e)| e).collect()
    }

    /// All so far.
    #[must_use]
    pub fn all(&self) -> Vec<T> {
        self.lock().iter().map(|(_, e)| e.clone()).collect()
    }

    /// When the first of its kind happened; waits for it at most so long.
    #[must_use]
    pub fn wait(&self, longest: Duration, kind: impl Fn(&T) -> bool) -> Option<Instant> {
        let end = Instant::now() + longest;
        let mut list = self.lock();
        loop {
            if let Some((at, _)) = list.iter().find(|(_, e)| kind(e)) {
                return Some(*at);
            }
            let left = end.checked_duration_since(Instant::now())?;
            list = self.0.1.wait_timeout(list, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
