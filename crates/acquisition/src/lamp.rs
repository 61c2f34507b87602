//! How well the lamp monitor knows the lamp, from the readings themselves: what scatters from pose to pose about a steady drift is its noise.

/// Relative standard deviation of one reading among `readings` in the order they were taken; 0 where there are fewer than three.
///
/// Second differences know neither level nor drift, and their variance is 6 σ²; the uncertainty that is left of a lamp that really jumps from pose to pose
/// is in it too.
#[must_use]
pub fn scatter(readings: &[f64]) -> f64 {
    let n = readings.len();
    let mean = readings.iter().sum::<f64>() / n.max(1) as f64;
    if n < 3 || mean.is_nan() || mean <= 0.0 {
        return 0.0;
    }
    let sum: f64 = readings.windows(3).map(|v| (v[0] - 2.0 * v[1] + v[2]).powi(2)).sum();
    (sum / (6.0 * (n - 2) as f64)).sqrt() / mean
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
    }
}
