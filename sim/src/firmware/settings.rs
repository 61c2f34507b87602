//! What the virtual controller and its mechanics are like.

use super::axis::Kinetics;
use gonio_instrument::{Description, Misalignment, Plan};
use gonio_protocol::hello::{Serial, Version};
use gonio_protocol::{LAMP_LEASE, MOTION_LEASE};
use std::time::Duration;

/// Constants of a virtual controller. Times ending in `_s` are instrument time; durations are real time.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Seed of everything drawn.
    pub seed: u64,
    /// How much faster than real time the instrument runs.
    pub time_scale: f64,
    /// Starts so far, the first one included.
    pub boot: u32,
    /// Serial number told in the hello.
    pub serial: Serial,
    /// Version told in the hello.
    pub version: Version,
    /// Lower and upper limit of the tilt axis.
    pub tilt_limits_udeg: [i32; 2],
    /// Lower and upper limit of the spin axis.
    pub spin_limits_udeg: [i32; 2],
    /// Where the axes stand at power-on, which nobody knows before homing.
    pub power_on_udeg: [f64; 2],
    /// Largest speed of an axis.
    pub max_speed_udeg_s: u32,
    /// Largest acceleration of an axis.
    pub max_accel_udeg_s2: u32,
    /// Speed of homing.
    pub home_speed_udeg_s: u32,
    /// Play of the gears; every position is approached from below, so that it does not show.
    pub backlash_udeg: f64,
    /// Travel of the shutter.
    pub shutter_travel_s: f64,
    /// Time constant of the lamp's warm-up.
    pub warm_up_s: f64,
    /// Relative change of the lamp from the first to the last pose of the plan.
    pub lamp_drift: f64,
    /// The plan's poses in micro-degrees, for the drift: a pose has the same lamp whenever it is visited.
    pub plan_udeg: Vec<(i64, i64)>,
    /// Standard deviation of the lamp monitor, relative, drawn once per pose.
    pub monitor_noise: f64,
    /// Added to the encoder's tilt to give the true one, degrees.
    pub tilt_zero_deg: f64,
    /// Standard deviation of the true tilt about that, drawn once per pose, degrees.
    pub tilt_repeatability_deg: f64,
    /// Height of the sample above F1, mm.
    pub sample_height_mm: f64,
    /// Temperature of the lamp's housing at which it is switched off, °C.
    pub lamp_limit_c: f64,
    /// Motion lease.
    pub motion_lease: Duration,
    /// Lamp lease.
    pub lamp_lease: Duration,
}

impl Settings {
    /// The controller of an instrument, with the instrument's own plan.
    pub fn new(instrument: &Description, seed: u64, time_scale: f64) -> Settings {
        let [low, high] = instrument.holder.tilt_limits_deg;
        Settings {
            seed,
            time_scale,
            boot: 1,
            serial: Serial::new("GONIO-SIM"),
            version: program_version(),
            tilt_limits_udeg: [udeg(low), udeg(high)],
            spin_limits_udeg: [-2_000_000_000, 2_000_000_000],
            power_on_udeg: [13_370_000.0, 123_456_000.0],
            max_speed_udeg_s: 120_000_000,
            max_accel_udeg_s2: 400_000_000,
            home_speed_udeg_s: 40_000_000,
            backlash_udeg: 40_000.0,
            shutter_travel_s: 0.06,
            warm_up_s: 20.0,
            lamp_drift: 0.0,
            plan_udeg: Vec::new(),
            monitor_noise: 1e-4,
            tilt_zero_deg: 0.0,
            tilt_repeatability_deg: 0.0,
            sample_height_mm: 0.0,
            lamp_limit_c: 85.0,
            motion_lease: MOTION_LEASE,
            lamp_lease: LAMP_LEASE,
        }
        .with_plan(&instrument.plan)
    }

    /// The same with the poses of another plan.
    #[must_use]
    pub fn with_plan(mut self, plan: &Plan) -> Settings {
        let key = |angle: gonio_optics::Angle| i64::from(udeg(angle.degrees()));
        self.plan_udeg = plan.poses().iter().map(|pose| (key(pose.tilt), key(pose.spin))).collect();
        self
    }

    /// The same with the errors of a real instrument that are the controller's: tilt zero, repeatability, lamp drift, height of the
    /// sample.
    #[must_use]
    pub fn with_misalignment(mut self, errors: &Misalignment) -> Settings {
        self.tilt_zero_deg = errors.tilt_zero_deg;
        self.tilt_repeatability_deg = errors.tilt_repeatability_deg;
        self.lamp_drift = errors.lamp_drift;
        self.sample_height_mm = errors.sample_height_mm;
        self
    }

    pub(super) fn fastest(&self) -> Kinetics {
        Kinetics { speed: f64::from(self.max_speed_udeg_s), acceleration: f64::from(self.max_accel_udeg_s2) }
    }

    /// Place of a pose in the plan, 0 at its first and 1 at its last; `None` for a pose outside the plan.
    pub(super) fn place(&self, pose: (i64, i64)) -> Option<f64> {
        let index = self.plan_udeg.iter().position(|&known| known == pose)?;
        Some(index as f64 / (self.plan_udeg.len().saturating_sub(1)).max(1) as f64)
    }
}

/// Degrees to whole micro-degrees; saturates far beyond any axis.
fn udeg(degrees: f64) -> i32 {
    (degrees * 1e6).round() as i32
}

fn program_version() -> Version {
    let mut parts = env!("CARGO_PKG_VERSION").split('.').map(|part| part.parse().unwrap_or(0));
    let mut next = || parts.next().unwrap_or(0);
    Version { major: next(), minor: next(), patch: next() }
}
