//! Which candidates nothing else beats in both respects.

/// Whether each (cost, error) stands on the front: no other is better in one of them and at least as good in the other. Entries that are not
/// finite never do.
#[must_use]
pub fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let usable = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    points
        .iter()
        .map(|p| {
            let beats = |q: &&(f64, f64)| q.0 <= p.0 && q.1 <= p.1 && (q.0 < p.0 || q.1 < p.1);
            usable(p) && !points.iter().filter(|q| usable(q)).any(|q| beats(&q))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_beaten_in_both_respects_is_left_out() {
        let points =
            [(1.0, 5.0), (2.0, 2.0), (3.0, 3.0), (9.0, 0.1), (2.0, 2.0), (f64::NAN, 0.0), (0.5, 6.0)];
        assert_eq!(front(&points), [true, true, false, true, true, false, true]);
        assert!(front(&[]).is_empty());
    }
}
