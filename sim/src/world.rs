//! The room in which firmware and camera meet: what is physically the case in the virtual instrument right now.
//!
//! The firmware writes (it turns the axes, moves the shutter, heats the lamp), the virtual camera reads, and whoever runs
//! the instrument may throw switches (open the lid, jam an axis). Clones share one state.
//!
//! Two poses are kept apart: what the encoders say, which is all a host ever learns, and where the sample really
//! stands. The latter holds backlash, the error of the tilt zero and the tilt repeatability already; the camera takes it as it is.

use gonio_instrument::Pose;
use std::sync::{Arc, Mutex, PoisonError};

/// The state of the virtual instrument at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// What the encoders say.
    pub readback: Pose,
    /// Where the sample really stands.
    pub actual: Pose,
    /// An axis turns.
    pub moving: bool,
    /// The shutter is fully open; on its way it counts as closed for light.
    pub shutter_open: bool,
    /// Output of the lamp relative to nominal (1.0), with level, warm-up and drift; what E0 is multiplied by while the
    /// shutter is open.
    pub lamp: f64,
    /// Temperature of the lamp's housing, °C.
    pub lamp_temperature_c: f64,
    /// Temperature of the air beside the sample, °C.
    pub ambient_c: f64,
    /// Height of the sample's surface above F1 along its normal, mm.
    pub sample_height_mm: f64,
    /// Pulses given to the camera.
    pub triggers: u32,
    /// How often the axes have found their zeros.
    pub homings: u32,
    /// How often the shutter was opened.
    pub openings: u32,
    /// How much faster than real time motion, exposure, warm-up and drift run.
    pub time_scale: f64,
    /// Switches thrown from outside.
    pub switches: Switches,
}

/// What goes wrong from outside, for as long as the switch is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switches {
    /// The lid is open.
    pub interlock_open: bool,
    /// The tilt axis is jammed.
    pub tilt_jammed: bool,
    /// The spin axis is jammed.
    pub spin_jammed: bool,
    /// The lamp's housing is heated from outside, past its limit.
    pub overheated: bool,
    /// The firmware hears and says nothing.
    pub silent: bool,
}

impl State {
    fn new(time_scale: f64) -> State {
        State {
            readback: Pose::default(),
            actual: Pose::default(),
            moving: false,
            shutter_open: false,
            lamp: 0.0,
            lamp_temperature_c: AMBIENT_C,
            ambient_c: AMBIENT_C,
            sample_height_mm: 0.0,
            triggers: 0,
            homings: 0,
            openings: 0,
            time_scale,
            switches: Switches::default(),
        }
    }

    /// The pose in whole micro-degrees, as the wire has it: the key for noise that must not depend on time.
    pub fn pose_key(&self) -> (i64, i64) {
        let udeg = |angle: gonio_optics::Angle| (angle.degrees() * 1e6).round() as i64;
        (udeg(self.readback.tilt), udeg(self.readback.spin))
    }
}

/// Temperature of the virtual room, °C.
pub const AMBIENT_C: f64 = 23.0;

/// Shared handle to the state.
#[derive(Clone, Debug)]
pub struct World(Arc<Mutex<State>>);

impl World {
    /// A room with a cold lamp, a closed shutter and a closed lid, in which time runs `time_scale` times too fast.
    pub fn new(time_scale: f64) -> World {
        World(Arc::new(Mutex::new(State::new(time_scale))))
    }

    /// What is the case now.
    pub fn state(&self) -> State {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Changes what is the case.
    pub fn update<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Throws switches.
    pub fn switch(&self, change: impl FnOnce(&mut Switches)) {
        self.update(|state| change(&mut state.switches));
    }
}
