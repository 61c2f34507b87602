//! A grid of half angles and angles of incidence for the recorded slices.
//!
//! Tilts and heads reach pairs of angles that lie on no grid: refraction bends their rows. The grid spans what was recorded, and each node takes the slice nearest
//! to it. Nodes whose sum of angles exceeds the steepest direction inside the coat are never asked for (a half angle θh and an incidence θi need a direction
//! at θh + θi); they only fill the rectangle. Of the others it is told how many have no slice near enough.

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
    /// Nodes that may be asked for and have a slice near enough.
    pub covered: usize,
    /// Nodes that may be asked for and have none: they take the nearest.
    pub filled: usize,
    /// Root mean square distance of a covered node from its slice.
    pub rms: Angle,
    /// Largest distance of a covered node.
    pub largest: Angle,
}

/// Chooses a grid with nodes `step` apart for the (half, incidence) of the slices; near enough is within `tolerance`, `steepest` the largest polar angle
/// inside the coat.
///
/// # Errors
/// [`TextureError::NoGrid`] where fewer than 2 × 2 nodes are covered.
pub fn choose(
    slices: &[(Angle, Angle)],
    step: Angle,
    tolerance: Angle,
    steepest: Angle,
) -> Result<GridChoice, TextureError> {
    let none = || TextureError::NoGrid {
        slices: slices.len(),
        step_deg: step.degrees(),
        tolerance_deg: tolerance.degrees(),
    };
    if !(0.1..=90.0).contains(&step.degrees()) || slices.is_empty() {
        return Err(none());
    }
    // nodes from the first that the smallest angle is near to, to the last that the largest is
    let axis = |f: fn(&(Angle, Angle)) -> Angle| -> Vec<Angle> {
        let deg = || slices.iter().map(|s| f(s).degrees());
        let (low, high) = (deg().fold(f64::INFINITY, f64::min), deg().fold(0.0, f64::max));
        let first = ((low - tolerance.degrees()) / step.degrees()).ceil().max(0.0) as usize;
        let last = ((high + tolerance.degrees()).min(90.0) / step.degrees()).floor().min(900.0) as usize;
        (first..=last.max(first)).map(|k| step * k as f64).collect()
    };
    let (half, incidence) = (axis(|s| s.0), axis(|s| s.1));
    let (mut picks, mut covered, mut filled) = (Vec::new(), 0, 0);
    let (mut squares, mut largest) = (0.0f64, 0.0f64);
    for h in &half {
        for i in &incidence {
            let off = |s: &(Angle, Angle)| (s.0.degrees() - h.degrees()).hypot(s.1.degrees() - i.degrees());
            let nearest = slices.iter().map(off).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            let (pick, off) = nearest.unwrap_or((0, f64::INFINITY));
            picks.push(pick);
            if (*h + *i) > steepest {
                continue;
            }
            if off <= tolerance.degrees() {
                covered += 1;
                squares += off * off;
                largest = largest.max(off);
            } else {
                filled += 1;
            }
        }
    }
    if covered < 4 || half.len() < 2 || incidence.len() < 2 {
        return Err(none());
    }
    Ok(GridChoice {
        half,
        incidence,
        picks,
        covered,
        filled,
        rms: Angle::from_degrees((squares / covered as f64).sqrt()),
        largest: Angle::from_degrees(largest),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_node_takes_its_nearest_slice_and_what_is_not_covered_is_told() {
        let deg = Angle::from_degrees;
        // 4 × 3 nodes two degrees apart, each half a degree off; one of them missing
        let mut slices: Vec<(Angle, Angle)> = (0..12)
            .map(|k| (deg(2.0 * f64::from(k / 3) + 0.3), deg(4.0 + 2.0 * f64::from(k % 3) - 0.4)))
            .collect();
        let whole = choose(&slices, deg(2.0), deg(0.6), deg(90.0)).expect("covered");
        assert_eq!((whole.half.len(), whole.incidence.len()), (4, 3));
        assert_eq!(whole.incidence.iter().map(|a| a.degrees().round()).collect::<Vec<_>>(), [4.0, 6.0, 8.0]);
        assert_eq!(whole.picks, (0..12).collect::<Vec<_>>());
        assert_eq!((whole.covered, whole.filled), (12, 0));
        assert!((whole.largest.degrees() - 0.5).abs() < 1e-9 && (whole.rms.degrees() - 0.5).abs() < 1e-9);
        slices.remove(4);
        let part = choose(&slices, deg(2.0), deg(0.6), deg(90.0)).expect("covered");
        assert_eq!((part.covered, part.filled), (11, 1));
        // beyond the steepest direction nothing is asked for
        let steep = choose(&slices, deg(2.0), deg(0.6), deg(9.0)).expect("covered");
        assert_eq!((steep.covered + steep.filled, steep.picks.len()), (6, 12));
    }

    #[test]
    fn too_few_slices_are_no_grid() {
        let deg = Angle::from_degrees;
        for slices in
            [vec![], vec![(deg(2.0), deg(2.0)); 5], vec![(deg(0.0), deg(0.0)), (deg(2.0), deg(0.0))]]
        {
            assert!(choose(&slices, deg(2.0), deg(0.5), deg(41.0)).is_err());
        }
        assert!(choose(&[(deg(1.0), deg(1.0))], deg(f64::NAN), deg(1.0), deg(41.0)).is_err());
    }
}
