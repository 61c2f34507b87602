//! Functions at the edge of their domain, one helper each: rounding must not turn a right answer into NaN.

/// Square root with negative rounding residue taken as zero.
#[must_use]
pub fn safe_sqrt(x: f64) -> f64 {
    x.max(0.0).sqrt()
}

/// Arc cosine with the argument clamped to [-1, 1].
#[must_use]
pub fn safe_acos(x: f64) -> f64 {
    x.clamp(-1.0, 1.0).acos()
}

/// Arc sine with the argument clamped to [-1, 1].
#[must_use]
pub fn safe_asin(x: f64) -> f64 {
    x.clamp(-1.0, 1.0).asin()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_stay_finite() {
        assert!(safe_sqrt(-1e-17) == 0.0);
        assert!(safe_acos(1.0 + 1e-15) == 0.0);
        assert!((safe_asin(-1.0 - 1e-15) + std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    }
}
