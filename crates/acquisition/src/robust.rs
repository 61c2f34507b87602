//! Middles and spreads that a few values out of all order do not move.

/// Standard deviation of normal deviates over their median distance from their median.
pub(crate) const SIGMA_OF_MEDIAN: f64 = 1.4826;

/// The middle one; the values are sorted. `None` of nothing.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
