//! A number for every pixel in two bytes: a whole number of steps. What a pass over the frames reads besides them is half as much so.

/// The finest step there is.
const FINEST: f32 = 1.0 / (1u64 << 40) as f32;

/// Numbers in steps of a power of two, so that a step's multiples are exact.
#[derive(Clone, Debug)]
pub(crate) struct Steps {
    counts: Vec<i16>,
    step: f32,
}

impl Steps {
    /// Zero everywhere.
    pub(crate) fn none(pixels: usize) -> Self {
        Self { counts: vec![0; pixels], step: FINEST }
    }

    /// Numbers in the finest steps that reach all those which `counts` says are used; the others are cut off.
    pub(crate) fn of(values: &[f32], counts: impl Fn(usize) -> bool) -> Self {
        let most =
            values.iter().enumerate().filter(|(p, v)| counts(*p) && v.is_finite()).map(|(_, v)| v.abs());
        let most = most.fold(0.0, f32::max);
        let finest = FINEST.log2() as i32;
        let step = 2f32.powi(((most / f32::from(i16::MAX)).log2().ceil() as i32).max(finest));
        // the cast holds what is cut off at its ends, and nothing finite becomes 0
        Self { counts: values.iter().map(|v| (v / step).round() as i16).collect(), step }
    }

    /// The number of a pixel.
    pub(crate) fn at(&self, pixel: usize) -> f32 {
        f32::from(self.counts[pixel]) * self.step
    }

    /// The steps as they lie, and how large one is.
    pub(crate) fn parts(&self) -> (&[i16], f32) {
        (&self.counts, self.step)
    }

    /// Variance of what rounding to steps does to a number.
    pub(crate) fn variance(&self) -> f64 {
        f64::from(self.step).powi(2) / 12.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_to_half_a_step_and_what_is_not_used_does_not_coarsen_them() {
        let values = [0.0, 1.5, -2.25, 3.999, 4000.0, f32::NAN];
        let steps = Steps::of(&values, |p| p != 4);
        let (_, step) = steps.parts();
        assert!(step <= 4.0 / 32768.0 * 2.0 && step.log2().fract() == 0.0, "{step}");
        for (p, v) in values.iter().enumerate().take(4) {
            assert!((steps.at(p) - v).abs() <= 0.5 * step, "{v}: {}", steps.at(p));
        }
        // cut off, not wrapped
        assert!(steps.at(4) > 3.9 && steps.at(5) == 0.0);
        // a rectangle as wide as a step
        assert!((steps.variance().sqrt() - f64::from(step) / 12f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn nothing_and_extremes_are_numbers_too() {
        assert_eq!(Steps::of(&[], |_| true).parts().0.len(), 0);
        assert!(Steps::of(&[0.0; 3], |_| true).at(1) == 0.0 && Steps::none(2).at(1) == 0.0);
        let far = Steps::of(&[1e30, 1e-30, -1e30], |_| true);
        assert!((far.at(0) / 1e30 - 1.0).abs() < 1e-4 && far.at(1) == 0.0 && far.at(2) < 0.0);
        assert!((Steps::of(&[1e-38], |_| true).at(0) - 1e-38).abs() <= 0.5 * FINEST);
    }
}
