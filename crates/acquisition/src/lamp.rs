//! How well the lamp monitor knows the lamp, from the readings themselves: what scatters from pose to pose about a steady drift is its noise.

/// How much one reading scatters, and how well that is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Relative standard deviation of one reading; 0 where nothing tells it.
    pub sigma: f64,
    /// Degrees of freedom from which it is known.
    pub freedom: f64,
}

impl Scatter {
    /// That of readings in the order they were taken; nothing is told by fewer than three.
    ///
    /// Second differences know neither level nor drift, and their variance is 6 σ²; the uncertainty that is left of a lamp that really jumps from pose to
    /// pose is in it too. Neighbours among them share readings (covariances 6, −4, 1), so that m of them are worth about m/2.
    #[must_use]
    pub fn of(readings: &[f64]) -> Self {
        let n = readings.len();
        let mean = readings.iter().sum::<f64>() / n.max(1) as f64;
        if n < 3 || mean.is_nan() || mean <= 0.0 {
            return Self::default();
        }
        let sum: f64 = readings.windows(3).map(|v| (v[0] - 2.0 * v[1] + v[2]).powi(2)).sum();
        let m = (n - 2) as f64;
        let covariances = 36.0 * m + 32.0 * (m - 1.0) + 2.0 * (m - 2.0).max(0.0);
        Self { sigma: (sum / (6.0 * m)).sqrt() / mean, freedom: 36.0 * m * m / covariances }
    }

    /// What two series of one monitor tell together.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        let freedom = self.freedom + other.freedom;
        let sum = self.freedom * self.sigma.powi(2) + other.freedom * other.sigma.powi(2);
        Self { sigma: if freedom > 0.0 { (sum / freedom).sqrt() } else { 0.0 }, freedom }
    }
}

/// [`Scatter::of`] without how well it is known.
#[must_use]
pub fn scatter(readings: &[f64]) -> f64 {
    Scatter::of(readings).sigma
}

/// Change from the first reading to the last by the straight line through all of them, relative to their mean; 0 where there are fewer than two.
#[must_use]
pub fn drift(readings: &[f64]) -> f64 {
    let n = readings.len() as f64;
    let mean = readings.iter().sum::<f64>() / n.max(1.0);
    if readings.len() < 2 || mean.is_nan() || mean <= 0.0 {
        return 0.0;
    }
    let middle = 0.5 * (n - 1.0);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (k, r) in readings.iter().enumerate() {
        let x = k as f64 - middle;
        xy += x * (r - mean);
        xx += x * x;
    }
    xy / xx * (n - 1.0) / mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_is_no_scatter_and_scatter_is_found() {
        let drifting: Vec<f64> = (0..40).map(|k| 1.0 - 1e-3 * f64::from(k)).collect();
        assert!(scatter(&drifting) < 1e-12);
        assert!((drift(&drifting) + 0.039 / 0.9805).abs() < 1e-12 && drift(&[1.0]) == 0.0);
        // ± 1 % in a pattern whose second differences have the mean square of noise: 1, 1, −1, −1
        let pattern = [1.0, 1.0, -1.0, -1.0];
        let noisy: Vec<f64> = (0..402).map(|k| 1.0 + 0.01 * pattern[k % 4]).collect();
        let expected = 0.01 * (4.0f64 / 6.0).sqrt();
        assert!((scatter(&noisy) / expected - 1.0).abs() < 1e-3, "{}", scatter(&noisy));
    }

    #[test]
    fn too_few_readings_tell_nothing() {
        assert_eq!([scatter(&[]), scatter(&[1.0, 2.0]), scatter(&[0.0; 5])], [0.0; 3]);
        let (known, nothing) = (Scatter { sigma: 2e-3, freedom: 10.0 }, Scatter::of(&[1.0, 1.1]));
        assert_eq!((known.with(nothing), nothing.with(nothing)), (known, Scatter::default()));
        let both = known.with(Scatter { sigma: 4e-3, freedom: 5.0 });
        assert!((both.sigma - 8e-6f64.sqrt()).abs() < 1e-12 && both.freedom == 15.0);
    }

    #[test]
    fn the_degrees_of_freedom_are_those_that_chance_shows() {
        // variances of series of normal deviates scatter by 2 σ⁴/ν
        let mut word = 1u64;
        let mut even = || {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (word >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut normal = || (-2.0 * (1.0 - even()).ln()).sqrt() * (std::f64::consts::TAU * even()).cos();
        for n in [3, 5, 40] {
            let all: Vec<Scatter> = (0..20_000)
                .map(|_| Scatter::of(&(0..n).map(|_| 1.0 + 1e-3 * normal()).collect::<Vec<_>>()))
                .collect();
            let (mean, square) = all.iter().fold((0.0, 0.0), |s, v| {
                let v = v.sigma.powi(2) * 1e6;
                (s.0 + v / all.len() as f64, s.1 + v * v / all.len() as f64)
            });
            let freedom = 2.0 * mean * mean / (square - mean * mean);
            assert!((mean - 1.0).abs() < 0.05, "{n}: {mean}");
            assert!((freedom / all[0].freedom - 1.0).abs() < 0.1, "{n}: {freedom} {}", all[0].freedom);
        }
    }
}
