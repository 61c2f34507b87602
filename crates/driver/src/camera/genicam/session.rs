//! A GenICam camera while it answers: opened, everything automatic off, one frame for each software trigger. Only the camera's thread touches it.
//!
//! A camera without a software trigger is stopped and started for each frame instead: what it exposes then began after it was asked.

use super::formats::choose;
use crate::camera::guard::guarded;
use crate::camera::raw::{RawFormat, Wanted};
use aravis::prelude::*;
use aravis::{
    AcquisitionMode, Auto, Buffer, BufferPayloadType, BufferStatus, Camera, GvStream, GvStreamOption,
    GvStreamSocketBuffer, Stream,
};
use glib::object::Cast as _;
use gonio_instrument::DeviceError;
use std::time::{Duration, Instant};

use aravis::glib;

/// Buffers that the library fills.
const BUFFERS: usize = 4;

/// A frame as it came, or what was wrong with it.
pub(super) enum Arrived {
    /// Its counts and the camera's own number.
    Counts(Vec<u16>, u64),
    /// Of no use; why.
    Damaged(String),
    /// None in time.
    Nothing,
}

pub(super) struct Session {
    camera: Camera,
    stream: Option<Stream>,
    format: &'static RawFormat,
    size: [u32; 2],
    triggered: bool,
    pub model: String,
    pub serial: String,
    pub format_name: String,
    /// Gain, and what else was set by hand, in words.
    pub settings: Vec<String>,
}

/// A library call whose failure is told with what was being done.
fn tell<T>(
    name: &str,
    doing: &str,
    result: Result<Result<T, glib::Error>, String>,
) -> Result<T, DeviceError> {
    let io = |reason: String| DeviceError::Io { device: name.to_owned(), reason };
    result.map_err(io)?.map_err(|e| io(format!("{doing}: {}", e.message())))
}

impl Session {
    /// Opens the camera of this id (a name, serial number or address; empty for the first that is found) and starts it.
    pub fn open(id: &str, wanted: &Wanted, name: &str) -> Result<Session, DeviceError> {
        let id = Some(id).filter(|id| !id.is_empty());
        let camera = match guarded(|| Camera::new(id)) {
            Ok(Ok(camera)) => camera,
            Ok(Err(e)) if e.message().contains("denied") || e.message().contains("controlled by another") => {
                return Err(DeviceError::InUse { device: name.to_owned() });
            }
            // the library tells "not found" and a null pointer, nothing finer
            Ok(Err(_)) | Err(_) => return Err(DeviceError::Absent { device: name.to_owned() }),
        };
        let names =
            tell(name, "its pixel formats", guarded(|| camera.dup_available_pixel_formats_as_strings()))?;
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let (format_name, format) =
            choose(&names, wanted).map_err(|reason| DeviceError::Io { device: name.to_owned(), reason })?;
        tell(name, "setting its pixel format", guarded(|| camera.set_pixel_format_from_string(format_name)))?;
        set_region(&camera, wanted, name)?;
        let settings = take_over(&camera, name)?;
        tell(
            name,
            "continuous acquisition",
            guarded(|| camera.set_acquisition_mode(AcquisitionMode::Continuous)),
        )?;
        let triggered = guarded(|| camera.is_feature_available("TriggerSoftware"))
            .is_ok_and(|r| r == Ok(true))
            && guarded(|| camera.set_trigger("Software")).is_ok_and(|r| r.is_ok());
        let text = |result: Result<Result<glib::GString, glib::Error>, String>| {
            result.ok().and_then(Result::ok).map(|t| t.to_string()).unwrap_or_default()
        };
        let (vendor, model) = (text(guarded(|| camera.vendor_name())), text(guarded(|| camera.model_name())));
        let serial = text(guarded(|| camera.device_serial_number()));
        let mut session = Session {
            stream: None,
            format,
            size: [wanted.width, wanted.height],
            triggered,
            model: format!("{vendor} {model}").trim().to_owned(),
            serial,
            format_name: format_name.to_owned(),
            settings,
            camera,
        };
        session.start(name)?;
        Ok(session)
    }

    fn start(&mut self, name: &str) -> Result<(), DeviceError> {
        if self.camera.is_gv_device() {
            // a packet socket takes an administrator's rights, and sees nothing on loopback
            self.camera.gv_set_stream_options(GvStreamOption::PACKET_SOCKET_DISABLED);
        }
        let camera = &self.camera;
        let stream = tell(name, "opening its stream", guarded(|| camera.create_stream()))?;
        if let Some(network) = stream.downcast_ref::<GvStream>() {
            network.set_socket_buffer(GvStreamSocketBuffer::Auto);
        }
        let payload = tell(name, "the size of its frames", guarded(|| camera.payload()))? as usize;
        for _ in 0..BUFFERS {
            stream.push_buffer(Buffer::new_allocate(payload));
        }
        self.stream = Some(stream);
        tell(name, "starting it", guarded(|| camera.start_acquisition()))
    }

    /// Bits of a value, if the format tells them.
    pub fn told_bits(&self) -> Option<u32> {
        self.format.told_bits()
    }

    /// Sets the exposure time and gives the one that the camera took.
    pub fn set_exposure(&self, exposure: Duration, name: &str) -> Result<Duration, DeviceError> {
        let camera = &self.camera;
        let wanted_us = exposure.as_secs_f64() * 1e6;
        // outside of what it can, the nearest
        let wanted_us = match guarded(|| camera.exposure_time_bounds()) {
            Ok(Ok((low, high))) if low <= high => wanted_us.clamp(low, high),
            _ => wanted_us,
        };
        tell(name, "setting its exposure time", guarded(|| camera.set_exposure_time(wanted_us)))?;
        let taken_us = tell(name, "its exposure time", guarded(|| camera.exposure_time()))?;
        Duration::try_from_secs_f64(taken_us * 1e-6).ok().filter(|t| !t.is_zero()).ok_or_else(|| {
            let reason = format!("it says that it took {taken_us} µs");
            DeviceError::Refused { command: format!("an exposure of {exposure:?}"), reason }
        })
    }

    /// Takes one frame that begins after this call; waits at most `wait` for it, or until `stop` says so.
    pub fn shoot(
        &mut self,
        wait: Duration,
        name: &str,
        stop: impl Fn() -> bool,
    ) -> Result<Arrived, DeviceError> {
        let camera = &self.camera;
        if !self.triggered {
            tell(name, "stopping it", guarded(|| camera.stop_acquisition()))?;
        }
        let Some(stream) = &self.stream else { return Ok(Arrived::Nothing) };
        // what came unasked, or too late for the one who had asked
        while let Some(old) = stream.try_pop_buffer() {
            stream.push_buffer(old);
        }
        if self.triggered {
            tell(name, "triggering it", guarded(|| camera.software_trigger()))?;
        } else {
            tell(name, "starting it", guarded(|| camera.start_acquisition()))?;
        }
        let end = Instant::now() + wait;
        loop {
            // the library's own acquisition call gives a null pointer after a time-out; this one says `None`
            if let Some(buffer) = stream.timeout_pop_buffer(20_000) {
                let arrived = self.unpack(&buffer);
                stream.push_buffer(buffer);
                return Ok(arrived);
            }
            if stop() || Instant::now() >= end {
                return Ok(Arrived::Nothing);
            }
        }
    }

    fn unpack(&self, buffer: &Buffer) -> Arrived {
        if buffer.status() != BufferStatus::Success {
            return Arrived::Damaged(format!("its status is {:?}", buffer.status()));
        }
        if buffer.payload_type() != BufferPayloadType::Image {
            return Arrived::Damaged(format!("it holds {:?}, no image", buffer.payload_type()));
        }
        let (width, height) = (buffer.image_width(), buffer.image_height());
        if [i64::from(width), i64::from(height)] != self.size.map(i64::from) {
            return Arrived::Damaged(format!("it has {width} x {height} pixels"));
        }
        let (padding, _) = buffer.image_padding();
        let row = self.format.row_bytes(self.size[0]);
        let stride = row + usize::try_from(padding).unwrap_or(0);
        let data = buffer.image_data();
        match self.format.unpack(&data, self.size[0], self.size[1], u32::try_from(stride).unwrap_or(0)) {
            Ok(counts) => Arrived::Counts(counts, buffer.frame_id()),
            Err(short) => Arrived::Damaged(short.to_string()),
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // a camera that is gone cannot be stopped, and need not be
        let camera = &self.camera;
        let _ = guarded(|| camera.stop_acquisition());
        let stream = self.stream.take();
        let _ = guarded(move || drop(stream));
    }
}

/// A region of the wanted size in the middle of the sensor, or as near to it as the camera's steps allow.
fn set_region(camera: &Camera, wanted: &Wanted, name: &str) -> Result<(), DeviceError> {
    let size = |n: u32| i32::try_from(n).unwrap_or(i32::MAX);
    let (width, height) = (size(wanted.width), size(wanted.height));
    let (sensor_width, sensor_height) =
        tell(name, "the size of its sensor", guarded(|| camera.sensor_size()))?;
    let step = |result: Result<Result<i32, glib::Error>, String>| {
        result.ok().and_then(Result::ok).unwrap_or(1).max(1)
    };
    let middle = |sensor: i32, size: i32, step: i32| (sensor - size).max(0) / 2 / step * step;
    let x = middle(sensor_width, width, step(guarded(|| camera.x_offset_increment())));
    let y = middle(sensor_height, height, step(guarded(|| camera.y_offset_increment())));
    tell(name, "setting its region", guarded(|| camera.set_region(x, y, width, height)))?;
    let (_, _, found_width, found_height) = tell(name, "its region", guarded(|| camera.region()))?;
    if (found_width, found_height) != (width, height) {
        let reason = format!(
            "it gives {found_width} x {found_height} pixels of its {sensor_width} x {sensor_height}; give the --instrument that describes this camera"
        );
        return Err(DeviceError::Refused {
            command: format!("a region of {width} x {height} pixels"),
            reason,
        });
    }
    Ok(())
}

/// Takes everything automatic out of the way, and the gain to its smallest value; gives what was set.
fn take_over(camera: &Camera, name: &str) -> Result<Vec<String>, DeviceError> {
    let mut settings = Vec::new();
    let available =
        |feature: &str| guarded(|| camera.is_feature_available(feature)).is_ok_and(|r| r == Ok(true));
    if guarded(|| camera.is_exposure_auto_available()).is_ok_and(|r| r == Ok(true)) {
        tell(name, "automatic exposure off", guarded(|| camera.set_exposure_time_auto(Auto::Off)))?;
        let mode = tell(name, "its exposure mode", guarded(|| camera.exposure_time_auto()))?;
        if mode != Auto::Off {
            let reason =
                format!("its exposure stays automatic ({mode:?}); use a camera with manual exposure");
            return Err(DeviceError::Refused { command: format!("manual settings of {name}"), reason });
        }
        settings.push("ExposureAuto Off".to_owned());
    }
    for feature in ["GainAuto", "BlackLevelAuto", "BalanceWhiteAuto", "GammaEnable"] {
        if !available(feature) {
            continue;
        }
        let set = match feature {
            "GammaEnable" => guarded(|| camera.set_boolean(feature, false)),
            _ => guarded(|| camera.set_string(feature, "Off")),
        };
        match set {
            Ok(Ok(())) => settings.push(format!("{feature} off")),
            Ok(Err(e)) => tracing::warn!("{name}: {feature} cannot be switched off: {}", e.message()),
            Err(words) => tracing::warn!("{name}: {feature} cannot be switched off: {words}"),
        }
    }
    if guarded(|| camera.is_gain_available()).is_ok_and(|r| r == Ok(true)) {
        let (lowest, _) = tell(name, "the range of its gain", guarded(|| camera.gain_bounds()))?;
        tell(name, "setting its gain", guarded(|| camera.set_gain(lowest)))?;
        let taken = tell(name, "its gain", guarded(|| camera.gain()))?;
        settings.push(format!("gain {taken}"));
    }
    if !guarded(|| camera.is_exposure_time_available()).is_ok_and(|r| r == Ok(true)) {
        let reason = "it has no exposure time that can be set; use a camera with manual exposure".to_owned();
        return Err(DeviceError::Refused { command: format!("manual settings of {name}"), reason });
    }
    Ok(settings)
}
