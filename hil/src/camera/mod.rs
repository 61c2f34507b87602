//! A 16-bit camera of the USB video class that looks into the virtual instrument.

pub mod chart;
mod controls;
mod sensor;
mod uvc;

pub use uvc::{PRODUCT, SERIAL, STREAM};

use std::sync::Arc;
use std::time::Duration;

use gonio_instrument::Description;
use gonio_sim::VirtualCamera;
use gonio_sim::optics::Sample;

use crate::redir::Setup;
use crate::usb::{Descriptors, Function, Ready, Stalled};
use controls::{Controls, Effect, Stream};
use sensor::{Exposed, Sensor, Shared};

/// A larger frame than that of the tiny instrument; always a test chart.
pub const LARGE: [u16; 2] = [640, 512];

const HEADER: usize = 6;
const END_OF_HEADER: u8 = 0x80;
const PRESENTATION_TIME: u8 = 0x04;
const END_OF_FRAME: u8 = 0x02;

/// What the bench may do to the camera while it runs.
#[derive(Clone, Debug)]
pub struct Bench(Arc<Shared>);

impl Bench {
    /// Puts a sample on the holder.
    pub fn put(&self, sample: Sample) {
        self.0.put(sample);
    }

    /// Shows a test chart instead, its numbers from 0, or the instrument again.
    pub fn show_chart(&self, on: bool) {
        self.0.show_chart(on);
    }

    /// Breaks off so many of the next frames half-way, as a bus that loses packets does.
    pub fn tear(&self, frames: u32) {
        self.0.tear(frames);
    }
}

/// The device.
#[derive(Debug)]
pub struct CameraDevice {
    descriptors: Descriptors,
    sizes: Vec<[u16; 2]>,
    shared: Arc<Shared>,
    /// The frame on the bus and how many of its bytes have gone.
    sending: Option<(Exposed, usize)>,
    /// Changes with each frame.
    frame_bit: u8,
    _sensor: Sensor,
}

impl CameraDevice {
    /// The camera of an instrument.
    ///
    /// # Errors
    /// The sensor's thread cannot be started.
    pub fn new(
        instrument: &Description,
        camera: VirtualCamera,
        ready: Ready,
    ) -> std::io::Result<(CameraDevice, Bench)> {
        let c = &instrument.camera;
        let native = c.size.map(|n| u16::try_from(n).unwrap_or(u16::MAX));
        let sizes = vec![native, LARGE];
        let shared = Shared::new(Controls::new(sizes.clone()));
        let black = u16::try_from(c.black_level).unwrap_or(u16::MAX);
        let top = ((1u32 << c.bits.min(16)) - 1) as u16;
        let sensor = Sensor::start(Arc::clone(&shared), camera, black, top, ready)?;
        let bench = Bench(Arc::clone(&shared));
        let descriptors = uvc::descriptors(&sizes);
        Ok((CameraDevice { descriptors, sizes, shared, sending: None, frame_bit: 0, _sensor: sensor }, bench))
    }

    fn stop(&mut self) {
        self.shared.stream(None);
        self.sending = None;
    }

    fn start(&mut self, stream: Stream) {
        let size = self.sizes.get(stream.frame).copied().unwrap_or_default();
        self.sending = None;
        self.shared.stream(Some((size, Duration::from_nanos(u64::from(stream.interval) * 100))));
    }
}

impl Function for CameraDevice {
    fn descriptors(&self) -> &Descriptors {
        &self.descriptors
    }

    fn control(&mut self, setup: Setup, data: &[u8]) -> Result<Vec<u8>, Stalled> {
        let (bytes, effect) = self.shared.controls(|c| c.request(setup, data))?;
        if let Effect::Start(stream) = effect {
            self.start(stream);
        }
        Ok(bytes)
    }

    fn bulk_out(&mut self, _endpoint: u8, _data: &[u8]) {}

    /// One payload: header length, flags, time of the frame, then as many pixels as fit.
    fn bulk_in(&mut self, _endpoint: u8, length: usize) -> Option<Vec<u8>> {
        let (frame, sent) = match self.sending.take() {
            Some(under_way) => under_way,
            None => (self.shared.take()?, 0),
        };
        let part = length.min(uvc::PAYLOAD as usize).saturating_sub(HEADER);
        let end = (sent + part).min(frame.bytes.len());
        let last = end == frame.bytes.len() || (sent > 0 && self.shared.take_tear());
        let mut flags = END_OF_HEADER | PRESENTATION_TIME | self.frame_bit;
        if last {
            flags |= END_OF_FRAME;
        }
        let mut payload = vec![HEADER as u8, flags];
        payload.extend((frame.began.as_micros() as u32).to_le_bytes());
        payload.extend_from_slice(frame.bytes.get(sent..end).unwrap_or_default());
        if last {
            self.frame_bit ^= 1;
        } else {
            self.sending = Some((frame, end));
        }
        Some(payload)
    }

    /// The class has no word for the end of a bulk stream; hosts clear a halt that is none.
    fn halt_cleared(&mut self, _endpoint: u8) {
        self.stop();
    }

    fn reset(&mut self) {
        self.stop();
        self.shared.controls(Controls::reset);
    }
}
