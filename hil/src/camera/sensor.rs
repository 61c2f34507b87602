//! The sensor: exposes frame after frame while the stream runs, of the virtual instrument or of a test chart.
//!
//! A frame is begun every interval, or every exposure where that is longer; with two frames waiting for the bus no third is begun, so no
//! frame that was exposed is ever lost here.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gonio_instrument::{Camera, Cancel};
use gonio_sim::VirtualCamera;
use gonio_sim::optics::Sample;

use super::chart;
use super::controls::Controls;
use crate::usb::Ready;

/// Exposed frames that wait for the bus.
const DEPTH: usize = 2;

/// A frame on its way.
#[derive(Clone, Debug)]
pub struct Exposed {
    /// Camera clock at the start of exposure.
    pub began: Duration,
    /// Pixels, little endian.
    pub bytes: Vec<u8>,
}

/// What sensor, bus and bench share.
pub struct Shared {
    state: Mutex<State>,
    change: Condvar,
}

struct State {
    controls: Controls,
    /// Size of the running stream and its interval; `None` while none runs.
    stream: Option<([u16; 2], Duration)>,
    /// Grows with each start and stop, so that a frame exposed for an earlier stream is known as such.
    generation: u64,
    cancel: Cancel,
    exposed: VecDeque<Exposed>,
    chart: bool,
    sample: Option<Sample>,
    frames: u64,
    tears: u32,
    end: bool,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Shared")
    }
}

impl Shared {
    /// Nothing streams.
    #[must_use]
    pub fn new(controls: Controls) -> Arc<Shared> {
        let state = State {
            controls,
            stream: None,
            generation: 0,
            cancel: Cancel::new(),
            exposed: VecDeque::new(),
            chart: false,
            sample: None,
            frames: 0,
            tears: 0,
            end: false,
        };
        Arc::new(Shared { state: Mutex::new(state), change: Condvar::new() })
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads or changes the controls.
    pub fn controls<T>(&self, with: impl FnOnce(&mut Controls) -> T) -> T {
        with(&mut self.lock().controls)
    }

    /// Starts a stream, or stops it.
    pub fn stream(&self, stream: Option<([u16; 2], Duration)>) {
        let mut state = self.lock();
        state.cancel.stop();
        state.cancel = Cancel::new();
        state.generation += 1;
        state.exposed.clear();
        state.stream = stream;
        self.change.notify_all();
    }

    /// The next frame for the bus.
    pub fn take(&self) -> Option<Exposed> {
        let frame = self.lock().exposed.pop_front();
        self.change.notify_all();
        frame
    }

    /// Shows a test chart instead of the instrument; its numbers begin anew.
    pub fn show_chart(&self, on: bool) {
        let mut state = self.lock();
        state.chart = on;
        state.frames = 0;
    }

    /// Breaks off so many frames half-way.
    pub fn tear(&self, frames: u32) {
        self.lock().tears = frames;
    }

    /// The frame on the bus is to be broken off; asked once per frame.
    pub fn take_tear(&self) -> bool {
        let mut state = self.lock();
        let tear = state.tears > 0;
        state.tears = state.tears.saturating_sub(1);
        tear
    }

    /// Puts a sample on the holder; seen from the next frame on.
    pub fn put(&self, sample: Sample) {
        self.lock().sample = Some(sample);
    }
}

/// The running sensor. Dropping it ends it.
#[derive(Debug)]
pub struct Sensor {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Sensor {
    /// Runs the sensor on a thread of its own; `ready` is rung for each frame.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        shared: Arc<Shared>,
        camera: VirtualCamera,
        black: u16,
        top: u16,
        ready: Ready,
    ) -> std::io::Result<Sensor> {
        let mut run = Run { shared: Arc::clone(&shared), camera, black, top, ready, born: Instant::now() };
        let thread = std::thread::Builder::new().name("hil-sensor".to_owned()).spawn(move || run.frames())?;
        Ok(Sensor { shared, thread: Some(thread) })
    }
}

impl Drop for Sensor {
    fn drop(&mut self) {
        self.shared.lock().end = true;
        self.shared.stream(None);
        if let Some(thread) = self.thread.take() {
            // a panic has been printed where it happened
            let _ = thread.join();
        }
    }
}

struct Run {
    shared: Arc<Shared>,
    camera: VirtualCamera,
    black: u16,
    top: u16,
    ready: Ready,
    born: Instant,
}

/// What one frame is exposed with.
struct Job {
    generation: u64,
    size: [u16; 2],
    interval: Duration,
    exposure: Duration,
    gain: f64,
    chart: Option<u64>,
    cancel: Cancel,
}

impl Run {
    fn frames(&mut self) {
        let mut began: Option<Instant> = None;
        while let Some(job) = self.next_job() {
            let due = began.map_or_else(Instant::now, |b| b + job.interval);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            let now = Instant::now();
            began = Some(now);
            let Some(pixels) = self.expose(&job) else { continue };
            let bytes = pixels.iter().flat_map(|p| p.to_le_bytes()).collect();
            let mut state = self.shared.lock();
            if state.generation == job.generation {
                state.frames += 1;
                state.exposed.push_back(Exposed { began: now.duration_since(self.born), bytes });
                drop(state);
                self.ready.ring();
            }
        }
    }

    /// Waits until there is something to expose; `None` at the end.
    fn next_job(&mut self) -> Option<Job> {
        let mut state = self.shared.lock();
        loop {
            if state.end {
                return None;
            }
            if let Some(sample) = state.sample.take() {
                self.camera.set_sample(sample);
            }
            if let Some((size, interval)) = state.stream
                && state.exposed.len() < DEPTH
            {
                let info = self.camera.info();
                let native = u32::from(size[0]) == info.width && u32::from(size[1]) == info.height;
                return Some(Job {
                    generation: state.generation,
                    size,
                    interval,
                    exposure: state.controls.exposure(),
                    gain: state.controls.gain_factor(),
                    chart: (state.chart || !native).then_some(state.frames),
                    cancel: state.cancel.clone(),
                });
            }
            state = self.shared.change.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn expose(&mut self, job: &Job) -> Option<Vec<u16>> {
        if let Some(number) = job.chart {
            return Some(chart::draw(number, usize::from(job.size[0]) * usize::from(job.size[1])));
        }
        let frame = self.camera.capture(job.exposure, &job.cancel).ok()?;
        Some(frame.pixels.into_iter().map(|p| self.amplify(p, job.gain)).collect())
    }

    /// Gain acts on the signal, not on the black level.
    fn amplify(&self, counts: u16, gain: f64) -> u16 {
        if gain == 1.0 {
            return counts;
        }
        let black = f64::from(self.black);
        (black + (f64::from(counts) - black) * gain).round().clamp(0.0, f64::from(self.top)) as u16
    }
}
