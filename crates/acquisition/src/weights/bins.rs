//! Bins of directions: which one a direction falls into.

use gonio_brdf::Grid;
use gonio_optics::Vec3;

/// Bins of one row θi of a grid.
pub(super) struct Bins {
    /// Descending cosines of the bounds of θo.
    pub(super) cos_bounds: Vec<f64>,
    /// Ascending bounds of φ, radians.
    pub(super) phi_bounds: Vec<f64>,
    /// Their cosines and sines.
    phi_directions: Vec<[f64; 2]>,
    /// Whether θo = 0 is one cap shared by all φ, kept in φ bin 0.
    pub(super) has_cap: bool,
    /// Whether all bounds of φ but the outermost lie within the half turn, where a half-plane tells on which side of one a direction is.
    by_half_planes: bool,
    pub(super) cells: usize,
    pub(super) narrowest_rad: f64,
}

/// A bin, and what it is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Side, θo and φ in one number.
    pub(super) bin: u32,
    /// Whether φ < 0.
    other_side: bool,
    theta_o: usize,
    phi: usize,
}

/// The few bins about a pixel, for many points of it.
pub(super) struct Nearby<'a> {
    bins: &'a Bins,
    /// Lowest bin of θo, and the cosines of the bounds between it and the highest.
    lowest: usize,
    bounds: [f64; 3],
    phi: usize,
    /// Bound of φ within the pixel: cosine and sine.
    across: Option<[f64; 2]>,
    other_side: bool,
}

impl Bins {
    pub(super) fn new(grid: &Grid) -> Self {
        let [_, no, np] = grid.shape();
        let bounds = |n: usize, f: &dyn Fn(usize) -> (f64, f64)| -> Vec<f64> {
            (0..n).map(|k| f(k).0).chain(n.checked_sub(1).map(|k| f(k).1)).collect()
        };
        let theta = bounds(no, &|k| {
            let (a, b) = grid.theta_o_bounds(k);
            (a.radians(), b.radians())
        });
        let phi_bounds = bounds(np, &|k| {
            let (a, b) = grid.phi_bounds(k);
            (a.radians(), b.radians())
        });
        let narrowest_rad = theta.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let cos_bounds: Vec<f64> = theta.iter().map(|t| t.cos()).collect();
        let inner = phi_bounds.get(1..np).unwrap_or_default();
        Self {
            has_cap: cos_bounds.first().is_some_and(|c| *c >= 1.0 - 1e-15),
            by_half_planes: inner.iter().all(|b| *b > 0.0 && *b < std::f64::consts::PI),
            phi_directions: phi_bounds.iter().map(|b| [b.cos(), b.sin()]).collect(),
            cos_bounds,
            phi_bounds,
            cells: no * np,
            narrowest_rad,
        }
    }

    /// Bin of a direction in the sample frame (any length).
    pub(super) fn locate(&self, d: Vec3) -> Option<Place> {
        let z = d.z / d.norm();
        let (no, np) = (self.cos_bounds.len() - 1, self.phi_bounds.len() - 1);
        // cosines descend; a bound belongs to the bin outside it, the horizon to the last
        let below = self.cos_bounds.partition_point(|&c| c >= z);
        if below == 0 || below > no {
            return None;
        }
        let theta_o = below - 1;
        let phi = if theta_o == 0 && self.has_cap {
            0
        } else {
            let azimuth = d.y.abs().atan2(d.x);
            self.phi_bounds.partition_point(|&b| b <= azimuth).clamp(1, np) - 1
        };
        self.place(d.y < 0.0, theta_o, phi)
    }

    fn place(&self, other_side: bool, theta_o: usize, phi: usize) -> Option<Place> {
        let bin = self.number(other_side, theta_o, phi)?;
        Some(Place { bin, other_side, theta_o, phi })
    }

    fn number(&self, other_side: bool, theta_o: usize, phi: usize) -> Option<u32> {
        let azimuths = self.phi_bounds.len() - 1;
        u32::try_from(usize::from(other_side) * self.cells + theta_o * azimuths + phi).ok()
    }

    /// The same, `guess` first.
    pub(super) fn locate_near(&self, d: Vec3, guess: Option<Place>) -> Option<Place> {
        match guess {
            Some(place) if self.holds(&place, d) => guess,
            _ => self.locate(d),
        }
    }

    /// Whether a direction lies in a bin.
    fn holds(&self, place: &Place, d: Vec3) -> bool {
        let z = d.z / d.norm();
        let np = self.phi_bounds.len() - 1;
        let in_ring = self.cos_bounds[place.theta_o] >= z && self.cos_bounds[place.theta_o + 1] < z;
        if !self.by_half_planes || !in_ring || place.other_side != (d.y < 0.0) {
            return false;
        }
        if place.theta_o == 0 && self.has_cap {
            return true;
        }
        (place.phi == 0 || reaches(d, self.phi_directions[place.phi]))
            && (place.phi + 1 == np || !reaches(d, self.phi_directions[place.phi + 1]))
    }

    /// The bins about a pixel whose corners fall into these; `None` where a few comparisons do not tell them apart: at the zenith, at the horizon, and
    /// where a pixel is large.
    pub(super) fn nearby(&self, corners: [Place; 4]) -> Option<Nearby<'_>> {
        let other_side = corners[0].other_side;
        let range = |of: fn(&Place) -> usize| {
            corners.iter().map(of).fold((usize::MAX, 0), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ((near, far), (left, right)) = (range(|c| c.theta_o), range(|c| c.phi));
        let clear = self.by_half_planes
            && corners.iter().all(|c| c.other_side == other_side)
            && near >= 2
            && far + 3 < self.cos_bounds.len()
            && far - near <= 1
            && right - left <= 1;
        // a ring is bent: within a pixel it may reach further than at the corners, by less than a bin
        clear.then(|| Nearby {
            bins: self,
            lowest: near - 1,
            bounds: [0, 1, 2].map(|k| self.cos_bounds[near + k]),
            phi: left,
            across: (right > left).then(|| self.phi_directions[right]),
            other_side,
        })
    }
}

impl Nearby<'_> {
    /// Bin of a direction within the pixel.
    pub(super) fn locate(&self, d: Vec3) -> Option<u32> {
        let z = d.z / d.norm();
        let theta_o = self.lowest + self.bounds.iter().map(|c| usize::from(*c >= z)).sum::<usize>();
        let phi = self.phi + usize::from(self.across.is_some_and(|across| reaches(d, across)));
        self.bins.number(self.other_side, theta_o, phi)
    }
}

/// Whether the azimuth |φ| of a direction has reached a bound, of which cosine and sine are given.
fn reaches(d: Vec3, [cos, sin]: [f64; 2]) -> bool {
    d.y.abs() * cos - d.x * sin >= 0.0
}

#[cfg(test)]
mod tests {
    use gonio_optics::Angle;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_guess_changes_nothing(theta in 0.0f64..91.0, phi in -180.0f64..180.0, step in 0.0f64..3.0, towards in 0.0f64..360.0) {
            let bins = Bins::new(&Grid::sopp());
            let d = Vec3::from_polar(Angle::from_degrees(theta), Angle::from_degrees(phi));
            let step = step.to_radians();
            let turned = towards.to_radians();
            let beside = d + Vec3::new(step * turned.cos(), step * turned.sin(), 0.3 * step * turned.sin());
            prop_assert_eq!(bins.locate_near(beside, bins.locate(d)), bins.locate(beside));
        }

        #[test]
        fn the_few_bins_about_a_pixel_tell_its_points_as_all_bins_do(
            theta in 2.0f64..88.0, phi in -180.0f64..180.0, size in 0.02f64..0.8, turn in 0.0f64..360.0,
            points in proptest::collection::vec((0.0f64..1.0, 0.0f64..1.0), 40)
        ) {
            let bins = Bins::new(&Grid::sopp());
            let d = Vec3::from_polar(Angle::from_degrees(theta), Angle::from_degrees(phi));
            let across = Vec3::new(-d.y, d.x, 0.0).normalized();
            let along = d.cross(across);
            let (sin, cos) = turn.to_radians().sin_cos();
            let half = 0.5 * size.to_radians();
            let (a, b) = (across * (half * cos) + along * (half * sin), along * (half * cos) - across * (half * sin));
            let corner = |s: f64, t: f64| (d + a * s + b * t).normalized();
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)];
            let places = corners.map(|c| bins.locate(c));
            if let [Some(p), Some(q), Some(r), Some(s)] = places
                && let Some(nearby) = bins.nearby([p, q, r, s])
            {
                for (x, y) in points {
                    let (left, right) = (corners[0] * (1.0 - y) + corners[2] * y, corners[1] * (1.0 - y) + corners[3] * y);
                    let point = left * (1.0 - x) + right * x;
                    prop_assert_eq!(nearby.locate(point), bins.locate(point).map(|p| p.bin));
                }
            }
        }
    }
}
