//! Chains of lines cut at a frame.

use super::canvas::{Area, At};

/// The parts of a chain that lie inside a box; chains break where a place is not a number.
pub(crate) fn clipped(path: &[At], area: Area) -> Vec<Vec<At>> {
    let mut runs: Vec<Vec<At>> = Vec::new();
    let mut open = false;
    for w in path.windows(2) {
        let [a, b] = *w else { continue };
        // −∞ (a zero on a logarithmic axis) is far below; NaN breaks the chain
        let low = |p: At| (p.0, if p.1 == f64::INFINITY { area.bottom() + 1e6 } else { p.1 });
        let Some((p, q)) = clip_segment(low(a), low(b), area) else {
            open = false;
            continue;
        };
        match runs.last_mut() {
            Some(run) if open && run.last() == Some(&p) => run.push(q),
            _ => runs.push(vec![p, q]),
        }
        open = true;
    }
    runs
}

/// Liang–Barsky.
fn clip_segment(a: At, b: At, area: Area) -> Option<(At, At)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    if !(a.0.is_finite() && a.1.is_finite() && dx.is_finite() && dy.is_finite()) {
        return None;
    }
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for (p, q) in
        [(-dx, a.0 - area.x), (dx, area.right() - a.0), (-dy, a.1 - area.y), (dy, area.bottom() - a.1)]
    {
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            t0 = t0.max(q / p);
        } else {
            t1 = t1.min(q / p);
        }
    }
    // ends inside stay exactly what they are, so that chains join
    let at = |t: f64| (a.0 + dx * t, a.1 + dy * t);
    (t0 <= t1).then(|| (if t0 == 0.0 { a } else { at(t0) }, if t1 == 1.0 { b } else { at(t1) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_are_cut_at_the_frame_and_joined_inside() {
        let area = Area::new(0.0, 0.0, 10.0, 10.0);
        let runs =
            clipped(&[(-5.0, 5.0), (5.0, 5.0), (6.0, 6.0), (6.0, 20.0), (8.0, 20.0), (8.0, 2.0)], area);
        assert_eq!(
            runs,
            vec![vec![(0.0, 5.0), (5.0, 5.0), (6.0, 6.0), (6.0, 10.0)], vec![(8.0, 10.0), (8.0, 2.0)]]
        );
        assert!(clipped(&[(f64::NAN, 1.0), (2.0, 2.0)], area).is_empty());
    }
}
