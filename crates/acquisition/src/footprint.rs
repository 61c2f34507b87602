//! How much of a pixel's footprint on the sample the lamp's spot covers.
//!
//! A pixel sees the pupil's image at F1, a disc of radius ρ across the line of sight, drawn out to ρ/cos θo on the sample. The spot is an
//! ellipse: radius R across the plane of incidence, R/cos θi within. Along the azimuth of view the spot reaches
//! `s = R / sqrt(sin² φ + cos² θi cos² φ)`; a uniform disc drawn out to q = ρ/cos θo lies within ±s by
//! `(2/π)(asin u + u sqrt(1 − u²))`, u = s/q. Across it (ρ against R) it is always covered.

use gonio_optics::Vec3;

/// Share of the footprint within the spot, 0…1. `view` is a unit direction in the sample frame.
#[must_use]
pub fn lit_share(footprint_mm: f64, spot_mm: f64, cos_i: f64, view: Vec3) -> f64 {
    let across2 = view.x * view.x + view.y * view.y;
    if view.z <= 0.0 {
        return 0.0;
    }
    let (c2, s2) =
        if across2 > 0.0 { (view.x * view.x / across2, view.y * view.y / across2) } else { (1.0, 0.0) };
    let reach = spot_mm / (s2 + cos_i * cos_i * c2).sqrt().max(1e-6);
    let u = reach * view.z / footprint_mm.max(1e-9);
    if u >= 1.0 {
        return 1.0;
    }
    std::f64::consts::FRAC_2_PI * (u.asin() + u * (1.0 - u * u).sqrt())
}

/// A footprint nearer to F1 than this counts as centred on it, mm.
const CENTRED_MM: f64 = 0.02;
/// Chords of a footprint that is off the centre.
const CHORDS: usize = 24;

/// As [`lit_share`] for a footprint whose centre lies at `place` (x, y in the sample frame, mm) instead of F1.
///
/// In units of the spot's half axes the spot is the unit circle and the footprint `c + s a + t b` with (s, t) in the unit disc, a across
/// the azimuth of view and b along it; the chords along b are cut exactly and added by Gauss–Chebyshev's rule.
#[must_use]
pub fn lit_share_at(place: [f64; 2], footprint_mm: f64, spot_mm: f64, cos_i: f64, view: Vec3) -> f64 {
    if place[0].hypot(place[1]) < CENTRED_MM {
        return lit_share(footprint_mm, spot_mm, cos_i, view);
    }
    if view.z <= 0.0 {
        return 0.0;
    }
    let across = view.x.hypot(view.y);
    let (cos, sin) = if across > 0.0 { (view.x / across, view.y / across) } else { (1.0, 0.0) };
    let spot = |x: f64, y: f64| [x * cos_i / spot_mm, y / spot_mm];
    let c = spot(place[0], place[1]);
    let a = spot(-sin * footprint_mm, cos * footprint_mm);
    let b = spot(cos * footprint_mm / view.z, sin * footprint_mm / view.z);
    let dot = |p: [f64; 2], q: [f64; 2]| p[0] * q[0] + p[1] * q[1];
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

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Angle;

    #[test]
    fn steep_views_are_over_filled_and_grazing_ones_fade() {
        let at = |deg| {
            lit_share(0.42, 3.0, 1.0, Vec3::from_polar(Angle::from_degrees(deg), Angle::from_degrees(90.0)))
        };
        assert!(at(0.0) == 1.0 && at(76.0) == 1.0);
        assert!(at(85.0) < 1.0 && at(89.0) < at(85.0) && at(90.0) < 1e-6);
    }

    #[test]
    fn off_the_centre_the_share_goes_on_from_the_centred_one_and_falls_to_nothing() {
        for (theta, phi) in [(80.0, 90.0), (85.0, 20.0), (60.0, 0.0)] {
            let v = Vec3::from_polar(Angle::from_degrees(theta), Angle::from_degrees(phi));
            let at = |x: f64| lit_share_at([x, 0.0], 0.42, 3.0, 0.8, v);
            assert!((at(0.021) - lit_share(0.42, 3.0, 0.8, v)).abs() < 0.01, "{theta} {phi}");
            assert!(at(2.0) <= at(0.5) + 1e-9 && at(3.0 / 0.8 + 0.43 / v.z) < 1e-9, "{theta} {phi}");
        }
        // half of a small footprint whose centre lies on the edge of the spot
        let half = lit_share_at([0.0, 3.0], 0.05, 3.0, 1.0, Vec3::Z);
        assert!((half - 0.5).abs() < 0.01, "{half}");
    }
}
