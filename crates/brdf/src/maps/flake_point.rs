//! A geometry's place in flake space, in f32 and without a trigonometric function.
//!
//! With the refracted directions, `s = l + v` and `d = l − v` (|s|² + |d|² = 4):
//!
//! ```text
//! sin θ_inc = |d|/2      sin θ_flake = |s_xy|/|s|      sin θ_inc sin θ_flake cos φ_d = |d_z|/2
//! ```
//!
//! The last because d is perpendicular to s: only its part along the meridian of s rises out of the horizontal.

use gonio_optics::Vec3;

use super::flake_lanes::{above, next_harmonic};

/// p² = sin² θ_inc sin² θ_flake at which a harmonic has half its amplitude: 13.5° of each, inside the coat. Without a half-way point P_k grows
/// like p^2k up to the edge of the map, and the coefficients that serve there and nearer the lobe differ by orders of magnitude.
const HALF_WAY: f32 = 0.003;

/// Place of a pair of directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlakePoint {
    /// sin θ_inc.
    pub(super) sin_inc: f32,
    /// √(sin θ_flake).
    pub(super) root_flake: f32,
    /// sin² θ_inc sin² θ_flake.
    pub(super) p2: f32,
    /// p² cos 2φ_d.
    pub(super) p2_cos2: f32,
}

impl FlakePoint {
    /// Of unit directions above the surface; `inverse_index` is 1/n. Exchanging them changes no bit.
    #[inline(always)]
    pub(super) fn new(l: [f32; 3], v: [f32; 3], inverse_index: f32) -> Self {
        let (l, v) = (refract(l, inverse_index), refract(v, inverse_index));
        let s = [l[0] + v[0], l[1] + v[1], l[2] + v[2]];
        let d = [l[0] - v[0], l[1] - v[1], l[2] - v[2]];
        let inc2 = 0.25 * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        let flat = s[0] * s[0] + s[1] * s[1];
        // opposite grazing directions without a coat have no sum: their flake lies flat
        let flake2 = flat / above(flat + s[2] * s[2], 1e-30);
        let p2 = inc2 * flake2;
        let q2 = 0.25 * d[2] * d[2];
        Self { sin_inc: inc2.sqrt(), root_flake: flake2.sqrt().sqrt(), p2, p2_cos2: 2.0 * q2 - p2 }
    }

    /// P_1 and the square of its amplitude.
    #[inline(always)]
    pub(super) fn first_harmonic(&self) -> [f32; 2] {
        let share = 1.0 / (self.p2 + HALF_WAY);
        let amplitude = self.p2 * share;
        [self.p2_cos2 * share, amplitude * amplitude]
    }

    /// P_0 … P_(N−1).
    pub(super) fn harmonics<const N: usize>(&self) -> [f32; N] {
        let [first, square] = self.first_harmonic();
        let mut out = [1.0; N];
        for k in 1..N {
            out[k] = next_harmonic(k, first, square, &out);
        }
        out
    }
}

/// Into the coat.
#[inline(always)]
fn refract(d: [f32; 3], inverse_index: f32) -> [f32; 3] {
    let (x, y) = (d[0] * inverse_index, d[1] * inverse_index);
    [x, y, above(1.0 - x * x - y * y, 0.0).sqrt()]
}

/// Components as the look-up takes them.
#[inline]
pub(super) fn single(d: Vec3) -> [f32; 3] {
    [d.x as f32, d.y as f32, d.z as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::{Geometry, flake, fresnel};

    #[test]
    fn the_place_is_that_of_the_stable_formulas_and_the_azimuth_that_of_the_difference() {
        for (ti, to, phi) in
            [(10.0, 60.0, 35.0), (80.0, 85.0, 120.0), (45.0, 20.0, 179.0), (75.0, 75.0, 90.0)]
        {
            let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
            let p = FlakePoint::new(single(l), single(v), 1.0 / 1.5);
            let a = flake::flake_angles(l, v, 1.5);
            assert!((f64::from(p.sin_inc) - a.theta_inc.sin()).abs() < 1e-6);
            assert!((f64::from(p.root_flake).powi(2) - a.theta_flake.sin()).abs() < 1e-6);
            // φ_d by construction: d against the meridian of s
            let (l, v) = (fresnel::refract(l, 1.5), fresnel::refract(v, 1.5));
            let (h, d) = ((l + v).normalized(), (l - v).normalized());
            let across = Vec3::Z.cross(h).normalized();
            let along = across.cross(h);
            let azimuth = d.dot(across).atan2(d.dot(along));
            let want = (a.theta_inc.sin() * a.theta_flake.sin()).powi(2) * (2.0 * azimuth).cos();
            assert!((f64::from(p.p2_cos2) - want).abs() < 1e-6, "{want} {p:?}");
        }
    }
}
