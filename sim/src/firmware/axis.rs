//! One axis: trapezoid moves of a motor, and a sample behind gears with play.
//!
//! A leg is up to three pieces of constant acceleration: with distance d, speed v and acceleration a it accelerates for
//! `t₁ = min(v/a, √(d/a))`, cruises for `d/(a t₁) − t₁`, and decelerates for t₁. Play: the sample follows the motor only at the ends
//! of the gap, `sample ∈ [motor, motor + backlash]`; upward moves push it along at its lower end. A move ends upwards: a
//! downward one goes past its target by twice the play and comes back.

use std::collections::VecDeque;

/// Speed and acceleration, micro-degrees and instrument seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kinetics {
    pub speed: f64,
    pub acceleration: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    start: f64,
    from: f64,
    velocity: f64,
    /// Duration and acceleration of each piece.
    pieces: [(f64, f64); 3],
    /// Exact end, free of rounding.
    to: f64,
}

impl Leg {
    fn travel(start: f64, from: f64, to: f64, kinetics: Kinetics) -> Leg {
        let distance = (to - from).abs();
        let sign = (to - from).signum();
        let (v, a) = (kinetics.speed, kinetics.acceleration);
        let ramp = (v / a).min((distance / a).sqrt());
        let cruise = if ramp > 0.0 { distance / (a * ramp) - ramp } else { 0.0 };
        let pieces = [(ramp, sign * a), (cruise.max(0.0), 0.0), (ramp, -sign * a)];
        Leg { start, from, velocity: 0.0, pieces, to }
    }

    fn brake(start: f64, from: f64, velocity: f64, acceleration: f64) -> Leg {
        let time = velocity.abs() / acceleration;
        let to = from + 0.5 * velocity * time;
        let pieces = [(time, -velocity.signum() * acceleration), (0.0, 0.0), (0.0, 0.0)];
        Leg { start, from, velocity, pieces, to }
    }

    fn end(&self) -> f64 {
        self.start + self.pieces.iter().map(|piece| piece.0).sum::<f64>()
    }

    /// Position and velocity.
    fn at(&self, t: f64) -> (f64, f64) {
        if t >= self.end() {
            return (self.to, 0.0);
        }
        let mut left = (t - self.start).max(0.0);
        let (mut position, mut velocity) = (self.from, self.velocity);
        for (duration, acceleration) in self.pieces {
            let dt = left.min(duration);
            position += (velocity + 0.5 * acceleration * dt) * dt;
            velocity += acceleration * dt;
            left -= dt;
        }
        (position, velocity)
    }
}

/// Motor, encoder and sample.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// Where the motor is, true micro-degrees.
    motor: f64,
    velocity: f64,
    /// True position of the encoder's zero.
    zero: f64,
    sample: f64,
    backlash: f64,
    leg: Option<Leg>,
    then: VecDeque<f64>,
    kinetics: Kinetics,
}

impl Axis {
    pub fn new(motor: f64, backlash: f64) -> Axis {
        Axis {
            motor,
            velocity: 0.0,
            zero: motor,
            sample: motor,
            backlash,
            leg: None,
            then: VecDeque::new(),
            kinetics: Kinetics { speed: 1.0, acceleration: 1.0 },
        }
    }

    /// Stops where it is; the encoder counts from here.
    pub fn power_on(&mut self, t: f64) {
        self.jam(t);
        self.zero = self.motor;
    }

    /// Starts a move to a position of the encoder.
    pub fn go(&mut self, t: f64, to: f64, kinetics: Kinetics) {
        let to = to + self.zero;
        self.kinetics = kinetics;
        self.then.clear();
        if to < self.motor {
            self.then.extend([to - 2.0 * self.backlash, to]);
        } else {
            self.then.push_back(to);
        }
        self.start_next(t);
    }

    /// Starts looking for the true zero; the encoder counts from there when it is found.
    pub fn home(&mut self, t: f64, kinetics: Kinetics) {
        self.kinetics = kinetics;
        self.then.clear();
        self.then.extend([-2.0 * self.backlash, 0.0]);
        self.start_next(t);
    }

    /// The zero has been found.
    pub fn homed(&mut self) {
        self.zero = 0.0;
    }

    /// Decelerates from whatever it does.
    pub fn stop(&mut self, t: f64, acceleration: f64) {
        self.advance(t);
        self.then.clear();
        if self.leg.is_some() {
            self.leg = Some(Leg::brake(t, self.motor, self.velocity, acceleration));
        }
    }

    /// Stops dead.
    pub fn jam(&mut self, t: f64) {
        self.advance(t);
        self.then.clear();
        self.leg = None;
        self.velocity = 0.0;
    }

    /// Brings motor and sample up to `t`.
    pub fn advance(&mut self, t: f64) {
        while let Some(leg) = self.leg {
            let end = leg.end();
            (self.motor, self.velocity) = leg.at(t);
            self.follow();
            if t < end {
                return;
            }
            self.leg = None;
            self.start_next(end);
        }
    }

    pub fn is_moving(&self) -> bool {
        self.leg.is_some()
    }

    /// End of the leg under way; a downward move has two.
    pub fn ends_at(&self) -> Option<f64> {
        self.leg.map(|leg| leg.end())
    }

    /// By the encoder.
    pub fn readback_udeg(&self) -> f64 {
        self.motor - self.zero
    }

    /// Where the sample is.
    pub fn sample_udeg(&self) -> f64 {
        self.sample
    }

    fn start_next(&mut self, t: f64) {
        self.leg = self.then.pop_front().map(|to| Leg::travel(t, self.motor, to, self.kinetics));
    }

    fn follow(&mut self) {
        // Legs turn only at their ends, where this is called, so no turning point is missed.
        self.sample = self.sample.clamp(self.motor, self.motor + self.backlash);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FAST: Kinetics = Kinetics { speed: 20e6, acceleration: 100e6 };

    #[test]
    fn a_long_move_cruises_and_lasts_as_long_as_the_formula_says() {
        let mut axis = Axis::new(0.0, 40e3);
        axis.go(0.0, 45e6, FAST);
        // d/v + v/a
        let end = 45.0 / 20.0 + 20.0 / 100.0;
        assert!((axis.ends_at().expect("moving") - end).abs() < 1e-9);
        axis.advance(end / 2.0);
        assert!((axis.readback_udeg() - 22.5e6).abs() < 1.0);
        assert!((axis.velocity - 20e6).abs() < 1e-3);
        axis.advance(end);
        assert_eq!((axis.readback_udeg(), axis.is_moving()), (45e6, false));
    }

    #[test]
    fn play_does_not_show_after_a_move_and_does_after_a_stop_on_the_way_down() {
        let mut axis = Axis::new(0.0, 40e3);
        axis.go(0.0, 45e6, FAST);
        axis.advance(10.0);
        axis.go(10.0, 20e6, FAST);
        axis.advance(10.8);
        axis.stop(10.8, FAST.acceleration);
        axis.advance(20.0);
        assert!((axis.sample_udeg() - axis.motor - 40e3).abs() < 1e-6);
        axis.go(20.0, 20e6, FAST);
        axis.advance(30.0);
        assert_eq!(axis.sample_udeg(), 20e6);
    }

    proptest! {
        #[test]
        fn no_move_is_faster_than_asked_or_misses_its_target(
            from in -90e6..90e6_f64, to in -90e6..90e6_f64, speed in 1e5..1e8_f64, acceleration in 1e6..1e9_f64,
        ) {
            let kinetics = Kinetics { speed, acceleration };
            let mut axis = Axis::new(from, 40e3);
            axis.zero = 0.0;
            axis.go(0.0, to, kinetics);
            let mut t = 0.0;
            let mut last = from;
            while axis.is_moving() {
                t += 0.01;
                axis.advance(t);
                prop_assert!((axis.motor - last).abs() <= speed * 0.01 * (1.0 + 1e-9));
                prop_assert!(axis.velocity.abs() <= speed * (1.0 + 1e-9));
                last = axis.motor;
            }
            prop_assert_eq!(axis.readback_udeg(), to);
        }

        #[test]
        fn a_stop_takes_no_longer_than_speed_over_acceleration(at in 0.0..3.0_f64) {
            let mut axis = Axis::new(0.0, 40e3);
            axis.go(0.0, 45e6, FAST);
            axis.stop(at, FAST.acceleration);
            axis.advance(at + FAST.speed / FAST.acceleration + 1e-9);
            prop_assert!(!axis.is_moving());
        }
    }
}
