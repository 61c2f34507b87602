//! The firmware on a thread of its own, behind something that carries bytes.

pub mod memory;
pub mod pty;

pub use memory::{Line, serve_memory};
pub use pty::{PortName, Pty, PtyError, serve_pty};

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// A running firmware. Dropping it ends the thread.
#[derive(Debug)]
pub struct Served {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    fn new(stop: Arc<AtomicBool>, thread: JoinHandle<()>) -> Served {
        Served { stop, thread: Some(thread) }
    }

    /// The thread has not ended.
    fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|t| !t.is_finished())
    }

    /// Ends the thread and waits for it, as if the cable were pulled.
    pub fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic has been printed where it happened.
            let _ = thread.join();
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop();
    }
}
