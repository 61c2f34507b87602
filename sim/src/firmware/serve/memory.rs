//! The firmware between two channels.

use super::Served;
use crate::firmware::Firmware;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Blocks of bytes that fit into a channel.
const DEPTH: usize = 256;

/// The host's end of a line in memory.
#[derive(Debug)]
pub struct Line {
    /// Bytes to the firmware.
    pub to_device: SyncSender<Vec<u8>>,
    /// Bytes from the firmware.
    pub from_device: Receiver<Vec<u8>>,
}

/// Runs the firmware on a thread; it ends when the returned handle is dropped, not with the line:
/// a device whose cable is pulled makes itself safe.
///
/// # Errors
/// The thread cannot be started.
pub fn serve_memory(firmware: Firmware) -> io::Result<(Line, Served)> {
    let (to_device, input) = sync_channel::<Vec<u8>>(DEPTH);
    let (output, from_device) = sync_channel::<Vec<u8>>(DEPTH);
    let stop = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&stop);
    let thread = std::thread::Builder::new()
        .name("gonio-firmware".into())
        .spawn(move || run(firmware, &input, &output, &seen))?;
    Ok((Line { to_device, from_device }, Served::new(stop, thread)))
}

fn run(mut firmware: Firmware, input: &Receiver<Vec<u8>>, output: &SyncSender<Vec<u8>>, stop: &AtomicBool) {
    let start = Instant::now();
    let mut out = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        // Bytes before time: a late thread must not find a lease expired whose renewal is waiting.
        while let Ok(bytes) = input.try_recv() {
            firmware.receive(start.elapsed(), &bytes);
        }
        firmware.poll(start.elapsed(), &mut out);
        if !out.is_empty() {
            // A reader that is too slow, or gone, loses bytes, as on a real line.
            let _ = output.try_send(std::mem::take(&mut out));
        }
        let now = start.elapsed();
        let sleep = firmware.next_timeout(now).saturating_sub(now);
        match input.recv_timeout(sleep) {
            Ok(bytes) => firmware.receive(start.elapsed(), &bytes),
            Err(RecvTimeoutError::Timeout) => {}
            // Nobody will ever send again; the device goes on, and makes itself safe.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(sleep.max(Duration::from_millis(1))),
        }
    }
}
