//! A grid of half angles and angles of incidence that the recorded slices cover.
//!
//! Tilts and heads reach pairs of angles that lie on no grid: refraction bends their rows. Each node takes the slice nearest to it; the grid is the largest
//! block of nodes, a step apart, that all have one near enough.

use gonio_optics::Angle;

use super::TextureError;

/// A grid and the slice of each of its nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct GridChoice {
    /// Half angles, rising.
    pub half: Vec<Angle>,
    /// Angles of incidence, rising.
    pub incidence: Vec<Angle>,
    /// Place of each node's slice, in order of half angle, then angle of incidence.
    pub picks: Vec<usize>,
    /// Root mean square distance of a node from its slice.
    pub rms: Angle,
    /// Largest distance.
    pub largest: Angle,
}

/// Chooses a grid with nodes `step` apart, each with a slice within `tolerance`, from the (half, incidence) of the slices.
///
/// # Errors
/// [`TextureError::NoGrid`] where not even 2 × 2 nodes are covered.
pub fn choose(slices: &[(Angle, Angle)], step: Angle, tolerance: Angle) -> Result<GridChoice, TextureError> {
    let none = || TextureError::NoGrid {
        slices: slices.len(),
        step_deg: step.degrees(),
        tolerance_deg: tolerance.degrees(),
    };
    if step.degrees() < 0.1 || step.degrees() > 90.0 {
        return Err(none());
    }
    let last = |f: fn(&(Angle, Angle)) -> Angle| {
        let most = slices.iter().map(|s| f(s).degrees()).fold(0.0, f64::max);
        ((most / step.degrees()).ceil() as usize).min(900)
    };
    let (nh, ni) = (last(|s| s.0) + 1, last(|s| s.1) + 1);
    let node = |k: usize| step * k as f64;
    // the nearest slice of each node with its distance
    let nearest: Vec<Option<(usize, f64)>> = (0..nh * ni)
        .map(|k| {
            let (h, i) = (node(k / ni).degrees(), node(k % ni).degrees());
            let off = |s: &(Angle, Angle)| (s.0.degrees() - h).hypot(s.1.degrees() - i);
            let best = slices.iter().map(off).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
            (best.1 <= tolerance.degrees()).then_some(best)
        })
        .collect();
    let (h, i) = largest_block(&nearest, nh, ni).ok_or_else(none)?;
    let mut picks = Vec::new();
    let (mut squares, mut largest) = (0.0f64, 0.0f64);
    for a in h.0..h.1 {
        for b in i.0..i.1 {
            let (pick, off) = nearest[a * ni + b].unwrap_or((0, 0.0));
            picks.push(pick);
            squares += off * off;
            largest = largest.max(off);
        }
    }
    let rms = (squares / picks.len() as f64).sqrt();
    Ok(GridChoice {
        half: (h.0..h.1).map(node).collect(),
        incidence: (i.0..i.1).map(node).collect(),
        picks,
        rms: Angle::from_degrees(rms),
        largest: Angle::from_degrees(largest),
    })
}

type Span = (usize, usize);

/// The largest rectangle of nodes that all have a slice; of two alike the one nearer to 0°.
fn largest_block(nodes: &[Option<(usize, f64)>], nh: usize, ni: usize) -> Option<(Span, Span)> {
    let mut best: Option<(usize, Span, Span)> = None;
    for top in 0..nh {
        // for each column, how far down from `top` it is covered
        let depth: Vec<usize> =
            (0..ni).map(|i| (top..nh).take_while(|h| nodes[h * ni + i].is_some()).count()).collect();
        for left in 0..ni {
            let mut least = usize::MAX;
            for right in left..ni {
                least = least.min(depth[right]);
                let area = least * (right + 1 - left);
                if least >= 2 && right > left && best.is_none_or(|b| area > b.0) {
                    best = Some((area, (top, top + least), (left, right + 1)));
                }
            }
        }
    }
    best.map(|b| (b.1, b.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_covered_block_is_taken_and_each_node_its_nearest_slice() {
        let deg = Angle::from_degrees;
        // 4 × 3 nodes two degrees apart, each half a degree off, and one slice far away
        let mut slices: Vec<(Angle, Angle)> = (0..12)
            .map(|k| (deg(2.0 * f64::from(k / 3) + 0.3), deg(4.0 + 2.0 * f64::from(k % 3) - 0.4)))
            .collect();
        slices.push((deg(30.0), deg(30.0)));
        let g = choose(&slices, deg(2.0), deg(0.6)).expect("covered");
        assert_eq!(g.half.len(), 4);
        assert_eq!(g.incidence.iter().map(|a| a.degrees().round()).collect::<Vec<_>>(), [4.0, 6.0, 8.0]);
        assert_eq!(g.picks, (0..12).collect::<Vec<_>>());
        assert!((g.largest.degrees() - 0.5).abs() < 1e-9 && (g.rms.degrees() - 0.5).abs() < 1e-9);
    }

    #[test]
    fn too_few_slices_are_no_grid() {
        let deg = Angle::from_degrees;
        for slices in
            [vec![], vec![(deg(2.0), deg(2.0)); 5], vec![(deg(0.0), deg(0.0)), (deg(2.0), deg(0.0))]]
        {
            assert!(choose(&slices, deg(2.0), deg(0.5)).is_err());
        }
        assert!(choose(&[(deg(1.0), deg(1.0))], deg(f64::NAN), deg(1.0)).is_err());
    }
}
