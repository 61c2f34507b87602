//! The bench: the instrument with its three faces, plugged into the machine, and the hands that pull plugs when the guest asks for it.

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use gonio_instrument::certificate::Certificate;
use gonio_instrument::{Description, Misalignment, ScanKind};
use gonio_sim::optics::Sample;
use gonio_sim::{Truth, VirtualCamera};

use super::machine::Sockets;
use super::verdict::Verdict;
use crate::camera::{self, CameraDevice};
use crate::instrument::{Instrument, Socket};
use crate::line::{Device, FromGuest, Reply};
use crate::serial::SerialPlug;
use crate::stage::{self, StageDevice};
use crate::usb::{Fault, Port, PortError, Slot, port};

/// How much faster than life the instrument runs.
const TIME_SCALE: f64 = 20.0;
/// How often the time is looked at while the guest says nothing.
const GLANCE: Duration = Duration::from_millis(500);

/// Why there is no bench.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A thread or the channel.
    #[error("the virtual instrument cannot be run: {0}")]
    Io(#[from] io::Error),
    /// A halt that nobody met or cleared.
    #[error("the halt of the {0} device was not met and cleared")]
    NotHealed(&'static str),
    /// The paint on the holder.
    #[error("the sample on the holder: {0}")]
    Sample(String),
}

/// Everything that is plugged into the machine.
pub struct Bench {
    truth: Truth,
    serial: SerialPlug,
    usb: Port,
    camera: Port,
    camera_bench: camera::Bench,
    control: UnixStream,
    absent: Vec<Device>,
    _instrument: Instrument,
}

impl std::fmt::Debug for Bench {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bench").field("absent", &self.absent).finish_non_exhaustive()
    }
}

impl Bench {
    /// Builds the instrument and plugs in all but the `absent` devices.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn build(
        description: &Description,
        truth: Truth,
        seed: u64,
        sockets: &Sockets,
        absent: &[Device],
    ) -> Result<Bench, BenchError> {
        let instrument = Instrument::start(description, seed, TIME_SCALE)?;
        let sample = sample(ScanKind::Sample, &truth)?;
        let eye = VirtualCamera::new(
            instrument.world().clone(),
            description,
            &Misalignment::default(),
            sample,
            seed,
        );
        let slot = Slot::default();
        let (device, camera_bench) = CameraDevice::new(description, eye, slot.ready())?;
        let camera = slot.run(&sockets.camera, "camera", Box::new(device))?;
        let slot = Slot::default();
        let device = StageDevice::new(instrument.wire(Socket::Usb), slot.ready());
        let usb = slot.run(&sockets.usb, "usb", Box::new(device))?;
        let serial = SerialPlug::new(sockets.serial.clone(), instrument.wire(Socket::Serial));
        let control = port::connect(&sockets.control)?;
        let absent = absent.to_vec();
        let mut bench =
            Bench { truth, serial, usb, camera, camera_bench, control, absent, _instrument: instrument };
        for device in Device::ALL {
            bench.plug(device, true)?;
        }
        Ok(bench)
    }

    fn plug(&mut self, device: Device, on: bool) -> Result<(), BenchError> {
        if self.absent.contains(&device) {
            return Ok(());
        }
        match device {
            Device::Serial => self.serial.plug(on)?,
            Device::Usb => self.usb.plug(on),
            Device::Camera => self.camera.plug(on),
        }
        Ok(())
    }

    /// Does what the guest asks until the machine ends, at most so long, and gathers what it tells.
    ///
    /// # Errors
    /// The channel breaks.
    pub fn serve(&mut self, verdict: &mut Verdict, longest: Duration) -> io::Result<()> {
        self.control.set_read_timeout(Some(GLANCE))?;
        let mut lines = BufReader::new(self.control.try_clone()?);
        let mut line = Vec::new();
        let start = Instant::now();
        while start.elapsed() < longest {
            match lines.read_until(b'\n', &mut line) {
                Ok(0) => return Ok(()),
                Ok(_) => {}
                // what came of a line is kept
                Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => continue,
                // the machine has been switched off
                Err(e) if e.kind() == io::ErrorKind::ConnectionReset => return Ok(()),
                Err(e) => return Err(e),
            }
            let text = String::from_utf8_lossy(&std::mem::take(&mut line)).into_owned();
            let reply = match serde_json::from_str(&text) {
                Ok(FromGuest::Result { name, seconds, failure }) => {
                    verdict.result(name, seconds, failure);
                    continue;
                }
                Ok(FromGuest::Figure(figure)) => {
                    verdict.figure(figure);
                    continue;
                }
                Ok(FromGuest::Note(text)) => {
                    crate::log(&text);
                    continue;
                }
                Ok(request) => match self.obey(&request) {
                    Ok(()) => Reply::Done,
                    Err(error) => Reply::Refused(error.to_string()),
                },
                Err(error) => Reply::Refused(format!("the host does not understand {text:?}: {error}")),
            };
            let mut answer = serde_json::to_string(&reply).map_err(io::Error::other)?;
            answer.push('\n');
            self.control.write_all(answer.as_bytes())?;
        }
        Ok(())
    }

    fn obey(&mut self, request: &FromGuest) -> Result<(), BenchError> {
        match *request {
            FromGuest::Plug { device, on } => self.plug(device, on)?,
            FromGuest::Halt { device } => self.fault(device, Fault::Halt),
            FromGuest::Healed { device } => self.healed(device)?,
            FromGuest::Silence { device, on } => self.fault(device, |_| Fault::Silent(on)),
            FromGuest::Chart { on } => self.camera_bench.show_chart(on),
            FromGuest::Tear { frames } => self.camera_bench.tear(frames),
            FromGuest::Sample { kind } => self.camera_bench.put(sample(kind, &self.truth)?),
            FromGuest::Result { .. } | FromGuest::Figure(_) | FromGuest::Note(_) => {}
        }
        Ok(())
    }

    fn healed(&self, device: Device) -> Result<(), BenchError> {
        let healed = match device {
            Device::Usb => self.usb.healed(),
            Device::Camera => self.camera.healed(),
            Device::Serial => false,
        };
        if healed { Ok(()) } else { Err(BenchError::NotHealed(device.name())) }
    }

    /// The serial adapter is QEMU's and knows no faults but the pulled plug.
    fn fault(&self, device: Device, fault: impl Fn(u8) -> Fault) {
        match device {
            Device::Usb => self.usb.fault(fault(stage::IN)),
            Device::Camera => self.camera.fault(fault(camera::STREAM)),
            Device::Serial => {}
        }
    }
}

fn sample(kind: ScanKind, truth: &Truth) -> Result<Sample, BenchError> {
    Sample::of_kind(kind, truth, &Certificate::virtual_white()).map_err(|e| BenchError::Sample(e.to_string()))
}
