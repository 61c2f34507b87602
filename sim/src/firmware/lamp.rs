//! The lamp: warm-up, drift, temperature of its housing.
//!
//! Output `= level · w(t) · (1 + drift · place)`, with `w = (1 − e^(−t/τ)) / (1 − e^(−7))` up to 7 τ and 1 from there on, so that a
//! warm lamp does not depend on when it was switched on; `place` is the pose's place in the plan, 0 to 1.

use super::settings::Settings;
use crate::world::AMBIENT_C;

/// Warm after this many time constants.
const WARM: f64 = 7.0;
/// Rise of the housing's temperature at nominal output, °C.
const RISE_C: f64 = 25.0;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lamp {
    time_constant_s: f64,
    drift: f64,
    place: f64,
    level: f64,
    since: f64,
}

impl Lamp {
    pub fn new(settings: &Settings) -> Lamp {
        Lamp {
            time_constant_s: settings.warm_up_s,
            drift: settings.lamp_drift,
            place: 0.0,
            level: 0.0,
            since: 0.0,
        }
    }

    /// Switches to a level, 0 for off. A burning lamp stays as warm as it is.
    pub fn switch(&mut self, t: f64, level: f64) {
        if self.level == 0.0 {
            self.since = t;
        }
        self.level = level;
    }

    pub fn set_place(&mut self, place: f64) {
        self.place = place;
    }

    pub fn is_on(&self) -> bool {
        self.level > 0.0
    }

    pub fn is_warm(&self, t: f64) -> bool {
        self.is_on() && self.warmth(t) >= 1.0
    }

    pub fn level(&self) -> f64 {
        self.level
    }

    /// Relative to nominal.
    pub fn output(&self, t: f64) -> f64 {
        self.level * self.warmth(t) * (1.0 + self.drift * self.place)
    }

    /// °C.
    pub fn temperature_c(&self, t: f64) -> f64 {
        AMBIENT_C + RISE_C * self.level * self.warmth(t)
    }

    fn warmth(&self, t: f64) -> f64 {
        let constants = (t - self.since) / self.time_constant_s;
        // Not a number when both are zero: a lamp without warm-up is warm.
        if constants < WARM { (-(-constants.max(0.0)).exp_m1()) / -(-WARM).exp_m1() } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instrument() -> gonio_instrument::Description {
        gonio_instrument::builtin::description("reference").expect("known").expect("valid")
    }

    fn settings() -> Settings {
        Settings { lamp_drift: 0.02, ..Settings::new(&instrument(), 1, 1.0) }
    }

    #[test]
    fn it_warms_up_like_an_exponential_and_is_then_steady() {
        let mut lamp = Lamp::new(&settings());
        assert_eq!(lamp.output(5.0), 0.0);
        lamp.switch(10.0, 0.5);
        let full = 0.5 / (1.0 - (-7.0_f64).exp());
        assert!((lamp.output(30.0) - full * (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        assert!(!lamp.is_warm(100.0));
        assert!((lamp.output(150.0 - 1e-9) - 0.5).abs() < 1e-6);
        assert_eq!((lamp.output(150.0), lamp.is_warm(150.0)), (0.5, true));
        assert_eq!(lamp.output(1000.0), 0.5);
    }

    #[test]
    fn it_drifts_with_the_place_in_the_plan_and_not_with_time() {
        let mut lamp = Lamp::new(&settings());
        lamp.switch(0.0, 1.0);
        lamp.set_place(0.5);
        assert_eq!(lamp.output(1000.0), 1.01);
        assert_eq!(lamp.output(2000.0), 1.01);
    }
}
