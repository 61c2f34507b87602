//! Isolated hot pixels take the value of their neighbours of the same colour.

use super::Merged;

/// Offsets of the neighbours that are asked, in columns and rows.
pub(crate) const ASKED: [(isize, isize); 8] =
    [(0, -4), (0, -2), (-4, 0), (-2, 0), (2, 0), (4, 0), (0, 2), (0, 4)];

/// The value for pixel `p` from those that `at` gives: along the row or the column, whichever runs smoother, by the cubic through four
/// neighbours, else the mean of two; `None` where there are none.
pub(crate) fn from_neighbours(
    p: usize,
    w: usize,
    h: usize,
    at: &mut impl FnMut(usize) -> Merged,
) -> Option<Merged> {
    let (x, y) = (p % w, p / w);
    let mut line = |step: usize, place: usize, n: usize| -> Option<(f64, Merged)> {
        if place < 2 || place + 2 >= n {
            return None;
        }
        let (a, b) = (at(p - 2 * step), at(p + 2 * step));
        if !a.is_valid() || !b.is_valid() {
            return None;
        }
        let mut m = a;
        let half = |f: fn(&Merged) -> f32| 0.5 * (f(&a) + f(&b));
        m.rate = half(|m| m.rate);
        (m.shot, m.read, m.dark) = (half(|m| m.shot), half(|m| m.read), half(|m| m.dark));
        m.exposure = half(|m| m.exposure);
        if place >= 4 && place + 4 < n {
            let (c, d) = (at(p - 4 * step), at(p + 4 * step));
            if c.is_valid() && d.is_valid() {
                m.rate += (2.0 * m.rate - c.rate - d.rate) / 6.0;
            }
        }
        Some((f64::from((a.rate - b.rate).abs()), m))
    };
    match (line(1, x, w), line(w, y, h)) {
        (Some(a), Some(b)) => Some(if b.0 < a.0 { b.1 } else { a.1 }),
        (a, b) => a.or(b).map(|v| v.1),
    }
}
