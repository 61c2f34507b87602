//! What a pixel looks at on the sample, and how much of it the lamp's spot covers.
//!
//! A pixel sees the pupil's image at F1, drawn out along the line of sight on the sample: an ellipse about the place where the chief ray meets it. The
//! spot is another one: radius R across the plane of incidence, R/cos θi within. In units of the spot's half axes the spot is the unit circle and
//! the footprint `c + s a + t b` with (s, t) in the unit disc; a and b turned so that b points where it reaches farthest off, the chords along b are
//! cut exactly and added by Gauss–Chebyshev's rule.

use gonio_optics::{Rotation, Vec3};

use crate::optics::Optics;

/// Chords of a footprint that the spot cuts.
const CHORDS: usize = 24;
/// Steps towards the point of a footprint that lies farthest off.
const FARTHER: usize = 6;

/// The footprint of a pixel on the sample, in the sample frame's x and y, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Where the chief ray meets the sample, from F1: nowhere else than there on an aligned instrument, beside it (and further the more grazing the
    /// view) where mirror or camera stand off their places.
    pub place: [f64; 2],
    /// Conjugate half axes.
    pub radii: [[f64; 2]; 2],
    /// Unit direction of view, sample frame.
    pub view: Vec3,
}

impl Footprint {
    /// What is seen by way of a mirror point (lab frame, mm) in a direction (unit, lab frame, from the sample): the pupil's half axes, shortened by
    /// what the pupil is turned against the ray, mirrored and magnified by the ratio of the distances. `None` below the horizon.
    #[must_use]
    pub fn new(
        optics: &Optics,
        pupil_radius_mm: f64,
        mirror_mm: Vec3,
        direction: Vec3,
        sample_from_lab: &Rotation,
    ) -> Option<Self> {
        let (m, view) = (sample_from_lab.apply(mirror_mm), sample_from_lab.apply(direction));
        if view.z <= 1e-6 {
            return None;
        }
        let way = m.z / view.z;
        let from_pupil = mirror_mm - optics.pupil_mm();
        let ray = from_pupil.normalized();
        let normal = (-direction - ray).normalized();
        let magnified = -pupil_radius_mm * way / from_pupil.norm().max(1e-9);
        let radii = optics.pupil_axes().map(|axis| {
            let across = axis - ray * axis.dot(ray);
            let seen = sample_from_lab.apply((across - normal * (2.0 * across.dot(normal))) * magnified);
            let on = seen - view * (seen.z / view.z);
            [on.x, on.y]
        });
        Some(Self { place: [m.x - view.x * way, m.y - view.y * way], radii, view })
    }

    /// Unit vectors on the sample along the azimuth of view and across it.
    fn axes(&self) -> [[f64; 2]; 2] {
        let size = self.view.x.hypot(self.view.y);
        let (c, s) = if size > 1e-12 { (self.view.x / size, self.view.y / size) } else { (1.0, 0.0) };
        [[c, s], [-s, c]]
    }

    /// How far the chief ray passes F1, across the line of sight, mm: along the azimuth of view and across it.
    #[must_use]
    pub fn offset_mm(&self) -> [f64; 2] {
        let [along, across] = self.axes().map(|a| a[0] * self.place[0] + a[1] * self.place[1]);
        [along * self.view.z, across]
    }

    /// The same with that offset changed; along the azimuth it is 1/cos θo times as much on the sample.
    #[must_use]
    pub fn moved(mut self, by_mm: [f64; 2]) -> Self {
        let [along, across] = self.axes();
        let by = [by_mm[0] / self.view.z, by_mm[1]];
        self.place = [0, 1].map(|k| self.place[k] + by[0] * along[k] + by[1] * across[k]);
        self
    }

    /// How far the place lies off F1 in the measure of the lamp's spot, which is drawn out to 1/cos θi within the plane of incidence, mm.
    #[must_use]
    pub fn beside_mm(&self, cos_i: f64) -> f64 {
        (self.place[0] * cos_i).hypot(self.place[1])
    }

    /// How far from F1 it reaches at most, mm.
    #[must_use]
    pub fn reach_mm(&self) -> f64 {
        let [a, b] = self.radii;
        let square = a[0] * a[0] + a[1] * a[1] + b[0] * b[0] + b[1] * b[1];
        self.place[0].hypot(self.place[1]) + square.sqrt()
    }

    /// Share of it within the lamp's spot, 0…1.
    #[must_use]
    pub fn lit_share(&self, spot_mm: f64, cos_i: f64) -> f64 {
        if self.reach_mm() <= spot_mm {
            return 1.0;
        }
        let in_spots = |[x, y]: [f64; 2]| [x * cos_i / spot_mm, y / spot_mm];
        let c = in_spots(self.place);
        let [p, q] = self.radii.map(in_spots);
        let dot = |p: [f64; 2], q: [f64; 2]| p[0] * q[0] + p[1] * q[1];
        // chords run to where it reaches farthest off the spot's middle: there it is cut first, and every chord is cut a little
        let own = 0.5 * (2.0 * dot(p, q)).atan2(dot(p, p) - dot(q, q));
        let (mut sin, mut cos) = own.sin_cos();
        if dot(c, p) * cos + dot(c, q) * sin < 0.0 {
            (sin, cos) = (-sin, -cos);
        }
        for _ in 0..FARTHER {
            let at = [0, 1].map(|k| c[k] + cos * p[k] + sin * q[k]);
            let (x, y) = (dot(at, p), dot(at, q));
            let size = x.hypot(y).max(1e-30);
            (sin, cos) = (y / size, x / size);
        }
        let b = [cos * p[0] + sin * q[0], cos * p[1] + sin * q[1]];
        let a = [cos * q[0] - sin * p[0], cos * q[1] - sin * p[1]];
        let sum: f64 = (1..=CHORDS)
            .map(|i| {
                let (half, s) = (std::f64::consts::PI * i as f64 / (CHORDS + 1) as f64).sin_cos();
                let o = [c[0] + s * a[0], c[1] + s * a[1]];
                let (bb, ob, oo) = (dot(b, b).max(1e-30), dot(o, b), dot(o, o) - 1.0);
                let disc = ob * ob - bb * oo;
                if disc <= 0.0 {
                    return 0.0;
                }
                let root = disc.sqrt();
                let (low, high) = (((-ob - root) / bb).max(-half), ((-ob + root) / bb).min(half));
                half * (high - low).max(0.0)
            })
            .sum();
        (sum / (CHORDS + 1) as f64).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;
    use gonio_optics::Angle;

    /// A footprint of radius 0.42 mm across a line of sight.
    fn seen(theta_deg: f64, phi_deg: f64, place: [f64; 2]) -> Footprint {
        let view = Vec3::from_polar(Angle::from_degrees(theta_deg), Angle::from_degrees(phi_deg));
        let (s, c) = phi_deg.to_radians().sin_cos();
        let (r, long) = (0.42, 0.42 / view.z);
        Footprint { place, radii: [[-s * r, c * r], [c * long, s * long]], view }
    }

    #[test]
    fn the_lit_share_is_that_by_counting_points() {
        for (theta, phi, place, cos_i) in [
            (60.0, 20.0, [2.6, 0.3], 0.9),
            (80.0, 120.0, [-1.0, 0.8], 0.7),
            (87.0, 40.0, [1.5, 2.0], 0.4),
            (20.0, 0.0, [0.0, 3.0], 1.0),
        ] {
            let f = seen(theta, phi, place);
            let n = 1500;
            let (mut inside, mut all) = (0.0, 0.0);
            for k in 0..n * n {
                let at = |i: i32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
                let (s, t) = (at(k % n), at(k / n));
                if s * s + t * t <= 1.0 {
                    all += 1.0;
                    let p = [0, 1].map(|i| f.place[i] + s * f.radii[0][i] + t * f.radii[1][i]);
                    inside += f64::from(u8::from((p[0] * cos_i / 3.0).powi(2) + (p[1] / 3.0).powi(2) <= 1.0));
                }
            }
            let (found, counted) = (f.lit_share(3.0, cos_i), inside / all);
            assert!((found - counted).abs() < 4e-3, "{theta} {phi}: {found} {counted}");
            // whichever conjugate half axes describe it
            let (s, c) = 0.7f64.sin_cos();
            let turned = [0, 1].map(|i| {
                let (p, q) = (f.radii[0], f.radii[1]);
                if i == 0 {
                    [c * p[0] + s * q[0], c * p[1] + s * q[1]]
                } else {
                    [c * q[0] - s * p[0], c * q[1] - s * p[1]]
                }
            });
            let same = Footprint { radii: turned, ..f }.lit_share(3.0, cos_i);
            assert!((same - found).abs() < 1e-9, "{same} {found}");
        }
    }

    #[test]
    fn steep_views_are_over_filled_and_grazing_ones_fade() {
        let at = |deg| seen(deg, 90.0, [0.0; 2]).lit_share(3.0, 1.0);
        assert!(at(0.0) == 1.0 && at(76.0) == 1.0);
        assert!(at(85.0) < 1.0 && at(89.0) < at(85.0) && at(89.999) < 1e-3);
    }

    #[test]
    fn an_aligned_instrument_looks_at_the_focus_and_the_pupil_is_shortened_by_its_turn() {
        let d = builtin::description("reference").expect("built in").expect("readable");
        let optics = Optics::new(&d);
        let (rotation, _) = optics.frame(Angle::from_degrees(30.0));
        let radius = 0.5 * d.camera.pupil_diameter_mm;
        let mut most: f64 = 0.0;
        for [u, v] in [[640.0, 500.0], [300.0, 400.0], [900.0, 700.0]] {
            let view = optics.view(u, v).expect("meets the mirror");
            let Some(f) = Footprint::new(&optics, radius, view.mirror_mm, view.direction, &rotation) else {
                continue;
            };
            assert!(f.place[0].hypot(f.place[1]) < 1e-6, "{:?}", f.place);
            // its area across the line of sight is the pupil's, magnified, times the cosine of its turn against the ray
            let [a, b] = f.radii;
            let area = (a[0] * b[1] - a[1] * b[0]).abs() * f.view.z;
            let from_pupil = view.mirror_mm - optics.pupil_mm();
            let magnified = radius * view.mirror_mm.norm() / from_pupil.norm();
            let cos = area / (magnified * magnified);
            assert!(cos < 1.0 + 1e-9 && cos > 0.5, "{cos}");
            most = most.max(1.0 - cos);
        }
        assert!(most > 0.01, "{most}");
    }
}
