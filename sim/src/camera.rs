//! The virtual camera: raw frames of whatever the world's state makes of the sample, behind [`gonio_instrument::Camera`].
//!
//! The map of a pose is traced once and kept; each exposure scales it by the lamp's output (0 behind the shutter) and adds noise. Waiting
//! takes the exposure divided by the world's time scale. Noise depends on seed, sample, pose read back, exposure, shutter and on how many
//! such frames this camera took since the axes were homed and the shutter was last opened: a scan that is resumed, or takes a spoilt frame
//! again, sees at a pose what the uninterrupted one sees there, even from an instrument that has lived on.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gonio_instrument::{Camera, CameraInfo, Cancel, Description, DeviceError, Frame, Misalignment};
use serde::{Deserialize, Serialize};

use crate::optics::sensor::{Conditions, NoiseKey};
use crate::optics::{RateMap, Sample, Sensor, TextureOptics, VirtualOptics};
use crate::world::{State, World};

/// The sensor is this much warmer than the air, K.
const SELF_HEATING_K: f64 = 12.0;
/// Longest sleep between two looks at the stop request.
const NAP: Duration = Duration::from_millis(20);
/// The camera sets its exposure in steps of this.
const EXPOSURE_STEP_S: f64 = 1e-6;

/// What goes wrong with the camera: probabilities per frame, 0 to 1. All zero is a camera without faults. Read from the faults file here, acted
/// on by whoever wraps a camera in faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraFaults {
    /// A frame is exposed and lost on its way; the next one comes, and its sequence number shows the gap.
    pub dropped: f64,
    /// The lower rows are those of the frame before.
    pub torn: f64,
    /// The pixels are those of the frame before, under a new sequence number.
    pub frozen: f64,
    /// The frame comes so late that its capture has been given up; the next capture gets it.
    pub late: f64,
    /// How long a late frame is waited for, real milliseconds.
    pub late_by_ms: f64,
    /// The frame before comes once more, sequence number and all.
    pub duplicated: f64,
    /// The camera is unplugged after so many frames.
    pub unplugged_after: Option<u64>,
}

/// A camera that looks into the virtual instrument.
#[derive(Debug)]
pub struct VirtualCamera {
    world: World,
    optics: Arc<VirtualOptics>,
    /// In place of the optics where the frames are those of the texture camera.
    textures: Option<TextureOptics>,
    sample: Arc<Sample>,
    sensor: Arc<Sensor>,
    info: CameraInfo,
    exposure_limits_s: [f64; 2],
    /// Temperature of the air in place of the world's.
    ambient_c: Option<f64>,
    opened: Instant,
    sequence: u64,
    taken: HashMap<NoiseKey, u64>,
    /// Homings and openings of the shutter when `taken` was begun.
    since: (u32, u32),
    map: Option<(MapKey, Arc<RateMap>)>,
}

/// What a map depends on, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MapKey {
    tilt: u64,
    spin: u64,
    height: u64,
}

impl MapKey {
    fn of(state: &State) -> Self {
        Self {
            tilt: state.actual.tilt.radians().to_bits(),
            spin: state.actual.spin.radians().to_bits(),
            height: state.sample_height_mm.to_bits(),
        }
    }
}

impl CameraFaults {
    /// The first probability outside 0 to 1, with its name.
    #[must_use]
    pub fn out_of_range(&self) -> Option<(&'static str, f64)> {
        let late_and_more = [("late", self.late), ("duplicated", self.duplicated)];
        [("dropped", self.dropped), ("torn", self.torn), ("frozen", self.frozen)]
            .into_iter()
            .chain(late_and_more)
            .find(|(_, p)| !(0.0..=1.0).contains(p))
    }
}

impl VirtualCamera {
    /// A camera in `world` that sees `sample` in an instrument with errors.
    #[must_use]
    pub fn new(
        world: World,
        instrument: &Description,
        errors: &Misalignment,
        sample: Sample,
        seed: u64,
    ) -> Self {
        let c = &instrument.camera;
        Self {
            world,
            optics: Arc::new(VirtualOptics::new(instrument, errors)),
            textures: TextureOptics::new(instrument, errors),
            sample: Arc::new(sample),
            sensor: Arc::new(match &errors.radiometry {
                Some(i) => Sensor::new(instrument, seed).with_imperfections(i),
                None => Sensor::new(instrument, seed),
            }),
            ambient_c: errors.radiometry.as_ref().and_then(|i| i.ambient_c),
            info: CameraInfo {
                name: "virtual camera".to_owned(),
                serial: format!("virtual-{seed}"),
                width: c.size[0],
                height: c.size[1],
                bits: c.bits,
            },
            exposure_limits_s: c.exposure_s,
            opened: Instant::now(),
            sequence: 0,
            taken: HashMap::new(),
            since: (0, 0),
            map: None,
        }
    }

    /// Puts another sample on the holder. Its [`Sample::noise_key`] should differ from the former one's.
    pub fn set_sample(&mut self, sample: Sample) {
        self.sample = Arc::new(sample);
        self.map = None;
    }

    /// The traced optics, for whoever wants to compare with the truth.
    #[must_use]
    pub fn optics(&self) -> &VirtualOptics {
        &self.optics
    }

    /// The sensor with its fixed pattern.
    #[must_use]
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The noise-free electron rates at nominal lamp output for where the sample stands now.
    #[must_use]
    pub fn rates_now(&mut self) -> Arc<RateMap> {
        let state = self.world.state();
        self.map_of(&state)
    }

    fn map_of(&mut self, state: &State) -> Arc<RateMap> {
        let key = MapKey::of(state);
        if let Some((k, map)) = &self.map
            && *k == key
        {
            return Arc::clone(map);
        }
        let map = Arc::new(match &self.textures {
            Some(t) => t.rate_map(state.actual, &self.sample),
            None => self.optics.rate_map(state.actual, state.sample_height_mm, &self.sample),
        });
        self.map = Some((key, Arc::clone(&map)));
        map
    }

    /// The exposure the camera takes when asked for one: within its limits, in its steps.
    fn settable(&self, asked: Duration) -> Duration {
        let [low, high] = self.exposure_limits_s;
        let s = asked.as_secs_f64().clamp(low, high);
        Duration::from_micros((s / EXPOSURE_STEP_S).round() as u64)
    }

    /// Exposes one frame and counts it.
    fn expose(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        let state = self.world.state();
        let stamp = seconds(self.opened.elapsed().as_secs_f64() * state.time_scale);
        let light = state.shutter_open && state.lamp > 0.0;
        let map = if light { Some(self.map_of(&state)) } else { None };
        let started = Instant::now();
        if self.since != (state.homings, state.openings) {
            self.since = (state.homings, state.openings);
            self.taken.clear();
        }
        let mut key = NoiseKey {
            sample: self.sample.noise_key,
            pose: state.pose_key(),
            exposure_ns: exposure.as_nanos() as u64,
            shutter_open: light,
            repeat: 0,
        };
        let repeat = self.taken.entry(key).or_insert(0);
        key.repeat = *repeat;
        *repeat += 1;
        let temperature_c = self.ambient_c.unwrap_or(state.ambient_c) + SELF_HEATING_K;
        let conditions = Conditions {
            exposure_s: exposure.as_secs_f64(),
            lamp: if light { state.lamp } else { 0.0 },
            temperature_c,
        };
        let rates = map.as_ref().map_or(&[][..], |m| &m.rates);
        let pixels = self.sensor.expose(rates, conditions, key);
        // computing the frame is part of the exposure's time
        wait(seconds(exposure.as_secs_f64() / state.time_scale), started, cancel)?;
        let frame = Frame {
            width: self.info.width,
            height: self.info.height,
            pixels,
            exposure,
            sequence: self.sequence,
            stamp,
            sensor_temperature_c: Some(temperature_c),
        };
        self.sequence += 1;
        Ok(frame)
    }
}

impl Camera for VirtualCamera {
    fn info(&self) -> CameraInfo {
        self.info.clone()
    }

    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        if cancel.is_raised() {
            return Err(DeviceError::Cancelled);
        }
        let exposure = self.settable(exposure);
        self.expose(exposure, cancel)
    }
}

/// A duration from seconds; zero for what is none, the longest for what is too long.
fn seconds(s: f64) -> Duration {
    if s > 0.0 { Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX) } else { Duration::ZERO }
}

/// Waits until `time` after `started` unless a stop is asked for.
fn wait(time: Duration, started: Instant, cancel: &Cancel) -> Result<(), DeviceError> {
    loop {
        if cancel.is_raised() {
            return Err(DeviceError::Cancelled);
        }
        let rest = time.saturating_sub(started.elapsed());
        if rest.is_zero() {
            return Ok(());
        }
        std::thread::sleep(rest.min(NAP));
    }
}
