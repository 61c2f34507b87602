//! A camera while it is plugged in: opened, set up by hand, streaming. Only the camera's thread touches it.

use super::controls::{self, Settings};
use super::nodes::{Node, Role};
use crate::camera::guard::guarded;
use crate::camera::raw::{Code, Offer, RawFormat, Sizes, TooShort, Wanted, choose};
use gonio_instrument::DeviceError;
use rustix::time::{ClockId, clock_gettime};
use std::io;
use std::time::Duration;
use v4l::buffer::{Flags, Metadata, Type};
use v4l::framesize::FrameSizeEnum;
use v4l::io::traits::{CaptureStream, Stream as _};
use v4l::prelude::MmapStream;
use v4l::video::Capture as _;
use v4l::{Device, Format, FourCC};

/// Buffers that the driver fills; one more is read meanwhile.
const BUFFERS: u32 = 6;
/// Buffers that come back empty one after the other when a stream is dead.
const STALLED: u32 = 2;
/// After the kernel has said that a frame is there it comes at once.
const AT_ONCE: Duration = Duration::from_millis(100);
/// Taken where the camera does not tell its frame interval.
const USUAL_INTERVAL: Duration = Duration::from_millis(100);

/// A frame as it came.
#[derive(Debug)]
pub(super) struct Arrived {
    /// The driver's running number.
    pub sequence: u32,
    /// When its first bytes came, by the kernel's monotonic clock.
    pub stamp: Duration,
    /// Its counts, if they were asked for; or what was wrong with it.
    pub counts: Option<Result<Vec<u16>, Damage>>,
}

/// Why a frame is of no use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Damage {
    #[error("the driver marked it as damaged")]
    Marked,
    #[error("{0}")]
    Short(#[from] TooShort),
}

pub(super) struct Session {
    name: String,
    device: Device,
    stream: Option<MmapStream<'static>>,
    pub format: &'static RawFormat,
    size: [u32; 2],
    stride: u32,
    pub interval: Duration,
    pub card: String,
    pub settings: Settings,
    pub exposure_limits: Option<[Duration; 2]>,
    /// Buffers that came back empty, one after the other.
    empty: u32,
}

impl Session {
    /// Opens the camera at `node`, makes every setting and starts the stream. `name` is what the user calls it.
    pub fn open(node: &Node, wanted: &Wanted, name: &str) -> Result<Session, DeviceError> {
        let device = open_pictures(node, name)?;
        let failed = |e: io::Error| device_error(name, &e);
        let card =
            guarded(|| device.query_caps()).ok().and_then(Result::ok).map(|c| c.card).unwrap_or_default();
        let offers = offers(&device).map_err(|reason| DeviceError::Io { device: name.to_owned(), reason })?;
        let format = choose(&offers, wanted)
            .map_err(|e| DeviceError::Io { device: name.to_owned(), reason: e.to_string() })?;
        let asked = Format::new(wanted.width, wanted.height, FourCC::new(&format.code.0));
        let taken = device.set_format(&asked).map_err(failed)?;
        if (taken.width, taken.height, taken.fourcc) != (asked.width, asked.height, asked.fourcc) {
            let reason = format!(
                "asked for {} {}x{}, it gives {} {}x{}",
                format.code,
                wanted.width,
                wanted.height,
                Code(taken.fourcc.repr),
                taken.width,
                taken.height
            );
            return Err(DeviceError::Refused { command: format!("its format on {name}"), reason });
        }
        let settings = controls::take_over(&device, name)?;
        let exposure_limits = controls::list(&device).ok().and_then(|all| controls::exposure_limits(&all));
        let interval = device.params().ok().and_then(|p| {
            let seconds = f64::from(p.interval.numerator) / f64::from(p.interval.denominator);
            Duration::try_from_secs_f64(seconds).ok()
        });
        let stream = start(&device).map_err(failed)?;
        Ok(Session {
            name: name.to_owned(),
            device,
            stream: Some(stream),
            format,
            size: [wanted.width, wanted.height],
            stride: taken.stride,
            interval: interval.filter(|i| !i.is_zero()).unwrap_or(USUAL_INTERVAL),
            card,
            settings,
            exposure_limits,
            empty: 0,
        })
    }

    /// Sets the exposure time; gives the one that the camera took.
    pub fn set_exposure(&self, exposure: Duration) -> Result<Duration, DeviceError> {
        let taken = controls::set_exposure(&self.device, exposure).map_err(|e| {
            match device_error(&self.name, &e) {
                DeviceError::Io { reason, .. } => {
                    DeviceError::Refused { command: format!("an exposure of {exposure:?}"), reason }
                }
                gone => gone,
            }
        })?;
        if taken.is_zero() {
            let reason = "it says that it took none".to_owned();
            return Err(DeviceError::Refused { command: format!("an exposure of {exposure:?}"), reason });
        }
        Ok(taken)
    }

    /// Waits at most `wait` for a frame; its counts are unpacked if `wanted` says so of its stamp.
    pub fn next(
        &mut self,
        wait: Duration,
        wanted: impl FnOnce(Duration) -> bool,
    ) -> Result<Option<Arrived>, DeviceError> {
        let gone = || DeviceError::Gone { device: self.name.clone() };
        let stream = self.stream.as_mut().ok_or_else(gone)?;
        let milliseconds = i32::try_from(wait.as_millis()).unwrap_or(i32::MAX);
        match stream.handle().poll(POLLIN, milliseconds) {
            Ok(0) => return Ok(None),
            Ok(_) => {}
            Err(e) if e.kind() == io::ErrorKind::Interrupted => return Ok(None),
            Err(e) => return Err(device_error(&self.name, &e)),
        }
        let (bytes, meta) = CaptureStream::next(stream).map_err(|e| device_error(&self.name, &e))?;
        // what a driver gives back, all buffers at once, when the camera's endpoint has stalled; nothing comes after them
        self.empty =
            if meta.flags.contains(Flags::ERROR) && meta.bytesused == 0 { self.empty + 1 } else { 0 };
        if self.empty >= STALLED {
            let reason = "the stream has stalled and is started anew".to_owned();
            return Err(DeviceError::Io { device: self.name.clone(), reason });
        }
        let stamp = stamp(meta);
        let counts = wanted(stamp).then(|| {
            if meta.flags.contains(Flags::ERROR) {
                return Err(Damage::Marked);
            }
            let filled = bytes.get(..meta.bytesused as usize).unwrap_or(bytes);
            Ok(self.format.unpack(filled, self.size[0], self.size[1], self.stride)?)
        });
        Ok(Some(Arrived { sequence: meta.sequence, stamp, counts }))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // a stream that cannot be stopped panics; the device is closed all the same
        let stream = self.stream.take();
        if let Err(words) = guarded(move || drop(stream)) {
            tracing::debug!("{}: {words}", self.name);
        }
    }
}

const POLLIN: i16 = 1;

/// Now, by the clock of the stamps.
pub(super) fn monotonic() -> Duration {
    let now = clock_gettime(ClockId::Monotonic);
    Duration::new(u64::try_from(now.tv_sec).unwrap_or(0), u32::try_from(now.tv_nsec).unwrap_or(0))
}

fn stamp(meta: &Metadata) -> Duration {
    if meta.flags & Flags::TIMESTAMP_MASK != Flags::TIMESTAMP_MONOTONIC {
        return monotonic();
    }
    let seconds = u64::try_from(meta.timestamp.sec).unwrap_or(0);
    Duration::from_secs(seconds) + Duration::from_micros(u64::try_from(meta.timestamp.usec).unwrap_or(0))
}

/// Opens a node and sees to it that it gives pictures.
pub(super) fn open_pictures(node: &Node, name: &str) -> Result<Device, DeviceError> {
    let device = Device::with_path(&node.path).map_err(|e| device_error(name, &e))?;
    let io_error = |reason: String| DeviceError::Io { device: name.to_owned(), reason };
    match role(&device).map_err(io_error)? {
        Role::Pictures => Ok(device),
        Role::Metadata => Err(io_error(format!(
            "{} gives only metadata of a camera, no pictures; its pictures come from the node before it (`gonio doctor` lists them)",
            node.path.display()
        ))),
        Role::Other => Err(io_error(format!("{} is no camera that streams pictures", node.path.display()))),
    }
}

/// What an open node is for.
pub(super) fn role(device: &Device) -> Result<Role, String> {
    let capabilities = guarded(|| device.query_caps())?;
    match capabilities {
        Ok(c) => Ok(Role::of(c.capabilities.bits())),
        Err(e) => Err(format!("it does not tell what it is ({e})")),
    }
}

/// All formats and sizes.
pub(super) fn offers(device: &Device) -> Result<Vec<Offer>, String> {
    let formats = guarded(|| device.enum_formats())?.map_err(|e| e.to_string())?;
    let offer = |code: FourCC| {
        let sizes = guarded(|| device.enum_framesizes(code)).ok().and_then(Result::ok).unwrap_or_default();
        let sizes = sizes.into_iter().map(|s| match s.size {
            FrameSizeEnum::Discrete(d) => Sizes::One(d.width, d.height),
            FrameSizeEnum::Stepwise(s) => Sizes::Steps {
                width: [s.min_width, s.max_width, s.step_width],
                height: [s.min_height, s.max_height, s.step_height],
            },
        });
        Offer { code: Code(code.repr), sizes: sizes.collect() }
    };
    Ok(formats.into_iter().map(|f| offer(f.fourcc)).collect())
}

/// Gives the driver every buffer but the first and starts it. The library's own start would wait for the first frame, and after a time-out would give the same
/// buffer twice.
fn start(device: &Device) -> io::Result<MmapStream<'static>> {
    let mut stream = MmapStream::with_buffers(device, Type::VideoCapture, BUFFERS)?;
    stream.set_timeout(AT_ONCE);
    let started = (|| {
        let mut given = 0;
        for index in 1..BUFFERS as usize {
            // the driver may give fewer than asked for
            match CaptureStream::queue(&mut stream, index) {
                Ok(()) => given += 1,
                Err(e) if e.kind() == io::ErrorKind::InvalidInput && given > 0 => break,
                Err(e) => return Err(e),
            }
        }
        stream.start()
    })();
    match started {
        Ok(()) => Ok(stream),
        Err(e) => {
            let _ = guarded(move || drop(stream));
            Err(e)
        }
    }
}

/// An error of the system as one of ours.
pub(super) fn device_error(name: &str, error: &io::Error) -> DeviceError {
    const EIO: i32 = 5;
    const ENXIO: i32 = 6;
    const EBUSY: i32 = 16;
    const ENODEV: i32 = 19;
    const EPIPE: i32 = 32;
    const ESHUTDOWN: i32 = 108;
    let device = name.to_owned();
    match error.raw_os_error() {
        // what is left of a camera that was unplugged answers with these
        Some(ENODEV | ENXIO | EIO | EPIPE | ESHUTDOWN) => DeviceError::Gone { device },
        Some(EBUSY) => DeviceError::InUse { device },
        _ => match error.kind() {
            io::ErrorKind::NotFound => DeviceError::Absent { device },
            io::ErrorKind::PermissionDenied => DeviceError::Denied { device },
            _ => DeviceError::Io { device, reason: error.to_string() },
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_system_are_told_apart() {
        let of = |code| device_error("v4l:0", &io::Error::from_raw_os_error(code));
        assert!(matches!(of(13), DeviceError::Denied { .. }));
        assert!(matches!(of(2), DeviceError::Absent { .. }));
        assert!(matches!(of(16), DeviceError::InUse { .. }));
        assert!(matches!(of(19), DeviceError::Gone { .. }));
        assert!(matches!(of(22), DeviceError::Io { .. }));
    }

    #[test]
    fn stamps_of_another_clock_are_not_taken() {
        let meta = |flags| Metadata {
            flags,
            timestamp: v4l::timestamp::Timestamp::new(5, 250_000),
            ..Metadata::default()
        };
        assert_eq!(stamp(&meta(Flags::TIMESTAMP_MONOTONIC)), Duration::from_millis(5250));
        let now = stamp(&meta(Flags::TIMESTAMP_UNKNOWN));
        assert!(now <= monotonic() && monotonic() - now < Duration::from_secs(1));
        let copied = stamp(&meta(Flags::TIMESTAMP_COPY));
        assert!(monotonic() - copied < Duration::from_secs(1));
    }
}
