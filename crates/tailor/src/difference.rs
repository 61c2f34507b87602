//! How far colours are off: CIEDE2000 over weighted geometries, within and beyond 15° of the mirror direction.

use gonio_brdf::{Rgb, maps::Sample};
use gonio_optics::{Angle, Vec3, colour};
use serde::Serialize;

/// Half angle of the cone about the mirror direction that is told apart.
const CONE: Angle = Angle::from_degrees(15.0);

/// Colour differences of one set of geometries.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColourSpread {
    /// Weighted mean.
    pub mean: f64,
    /// What 95 % of the weight does not exceed.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Number of geometries.
    pub count: usize,
}

/// CIEDE2000 on Lab of R = π f.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Farther than 15° from the mirror direction; absent where no geometry lies there.
    pub beyond_15_deg: Option<ColourSpread>,
    /// Within 15°.
    pub within_15_deg: Option<ColourSpread>,
}

/// Angle between the view and the mirror direction of the light.
pub(crate) fn from_mirror(light: Vec3, view: Vec3) -> Angle {
    view.angle_to(Vec3::new(-light.x, -light.y, light.z))
}

impl ColourSpread {
    /// Of (difference, weight); weights not negative. `None` where nothing counts.
    #[must_use]
    pub fn of(mut values: Vec<(f64, f64)>) -> Option<Self> {
        values.retain(|v| v.1 > 0.0 && v.0.is_finite());
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        let max = values.last()?.0;
        let total: f64 = values.iter().map(|v| v.1).sum();
        let mean = values.iter().map(|v| v.0 * v.1).sum::<f64>() / total;
        let mut passed = 0.0;
        let p95 = values
            .iter()
            .find(|v| {
                passed += v.1;
                passed >= 0.95 * total * (1.0 - 1e-12)
            })
            .map_or(max, |v| v.0);
        Some(Self { mean, p95, max, count: values.len() })
    }
}

/// Differences gathered one geometry at a time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gathered {
    /// (difference, weight) within and beyond the cone.
    sets: [Vec<(f64, f64)>; 2],
}

impl Gathered {
    /// Takes what a representation says of the geometry of `sample`.
    pub(crate) fn add(&mut self, sample: &Sample, said: Rgb) {
        let d = colour::ciede2000(colour::lab_from_brdf(sample.value), colour::lab_from_brdf(said));
        let beyond = from_mirror(sample.light, sample.view) > CONE;
        self.sets[usize::from(beyond)].push((d, sample.weight));
    }

    pub(crate) fn finish(self) -> Difference {
        let [within, beyond] = self.sets;
        Difference { beyond_15_deg: ColourSpread::of(beyond), within_15_deg: ColourSpread::of(within) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Geometry;

    #[test]
    fn weights_count_as_repeats_would() {
        let weighted = ColourSpread::of(vec![(1.0, 3.0), (5.0, 1.0), (9.0, 0.0)]).unwrap();
        let repeated = ColourSpread::of(vec![(1.0, 1.0), (1.0, 1.0), (1.0, 1.0), (5.0, 1.0)]).unwrap();
        assert_eq!((weighted.mean, weighted.p95, weighted.max), (repeated.mean, repeated.p95, repeated.max));
        assert_eq!((weighted.mean, weighted.p95, weighted.max, weighted.count), (2.0, 5.0, 5.0, 2));
        let even = ColourSpread::of((1..=100).map(|k| (f64::from(k), 0.1)).collect()).unwrap();
        assert_eq!(even.p95, 95.0);
        assert_eq!(ColourSpread::of(vec![(1.0, 0.0)]), None);
    }

    #[test]
    fn geometries_are_told_apart_by_their_distance_from_the_mirror_direction() {
        let at = |to: f64, phi: f64| {
            let (light, view) = Geometry::from_degrees(45.0, to, phi).directions();
            Sample { light, view, value: [0.1; 3], sigma: [0.0; 3], weight: 1.0 }
        };
        let mut g = Gathered::default();
        g.add(&at(40.0, 180.0), [0.1; 3]);
        g.add(&at(20.0, 180.0), [0.2; 3]);
        g.add(&at(45.0, 0.0), [0.1; 3]);
        let d = g.finish();
        assert_eq!(d.within_15_deg.unwrap().count, 1);
        let beyond = d.beyond_15_deg.unwrap();
        assert!(beyond.count == 2 && beyond.max > 5.0 && (beyond.mean - 0.5 * beyond.max).abs() < 1e-12);
    }
}
