//! How much of a pixel's footprint on the sample is lit.
//!
//! The mirror images the entrance pupil onto the sample: a pupil point off the centre by δ (δ⊥ its part normal to the ray) reaches the
//! sample off the chief ray by `−R(δ⊥) r1/r2`, R the reflection at the mirror, r2 and r1 the ways before and after it. Projected along
//! the view onto the surface this is an ellipse; the lit part of the surface is the beam's cylinder cut by the sample's rim. Their common
//! area is integrated by chords of the pupil (Gauss–Chebyshev of the second kind), each cut exactly. The chords run in the direction in which
//! the spot's edge cuts hardest, so that the cut changes smoothly from chord to chord.
//!
//! The lens is taken as focused so that a pixel's bundle arrives parallel at the sample: the finite pupil spreads places on the sample,
//! not directions.

use gonio_optics::Vec3;

/// Chords of the pupil.
const CHORDS: usize = 24;

/// The footprint of one pixel: centre and half axes, from unit disc to the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// Centre relative to F1, mm.
    pub centre: Vec3,
    /// Image of the pupil's two radii, mm.
    pub radii: [Vec3; 2],
}

/// The lit part of the sample surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LitZone {
    /// Unit direction of the beam, which passes through F1.
    pub beam: Vec3,
    /// Radius of the beam, mm.
    pub beam_radius_mm: f64,
    /// Centre of the sample.
    pub sample_centre: Vec3,
    /// Radius of the sample, mm.
    pub sample_radius_mm: f64,
}

impl Footprint {
    /// Image of the pupil: `pupil` are its two radius vectors, `ray` the unit chief ray to the mirror, `normal` the mirror's, `view` the unit
    /// direction after it, `surface` the sample's normal, `magnification` = r1/r2.
    pub fn new(
        centre: Vec3,
        pupil: (Vec3, Vec3),
        ray: Vec3,
        normal: Vec3,
        view: Vec3,
        surface: Vec3,
        magnification: f64,
    ) -> Self {
        let slope = view.dot(surface);
        let image = |delta: Vec3| {
            let across = delta - ray * delta.dot(ray);
            let offset = (across - normal * (2.0 * across.dot(normal))) * -magnification;
            offset - view * (offset.dot(surface) / slope)
        };
        Self { centre, radii: [image(pupil.0), image(pupil.1)] }
    }

    /// Lit share of the footprint, 0…1.
    pub fn lit(&self, zone: &LitZone) -> f64 {
        let across = |v: Vec3| v - zone.beam * v.dot(zone.beam);
        let limits = [
            Limit::new([self.centre, self.radii[0], self.radii[1]].map(across), zone.beam_radius_mm),
            Limit::new(
                [self.centre - zone.sample_centre, self.radii[0], self.radii[1]],
                zone.sample_radius_mm,
            ),
        ];
        if limits.iter().all(Limit::surely_inside) {
            return 1.0;
        }
        if limits.iter().any(Limit::surely_outside) {
            return 0.0;
        }
        let Some(cutting) = limits.iter().find(|l| !l.surely_inside()) else { return 1.0 };
        let along = cutting.hardest_direction();
        let limits = limits.map(|l| l.turned(along));
        let mut sum = 0.0;
        for i in 1..=CHORDS {
            let (sin, cos) = (std::f64::consts::PI * i as f64 / (CHORDS + 1) as f64).sin_cos();
            let (mut low, mut high) = (-sin, sin);
            for limit in &limits {
                let (a, b) = limit.chord(cos);
                low = low.max(a);
                high = high.min(b);
            }
            // weight π/(n+1) sin², chord fraction over 2 sin, disc area π
            sum += sin * (high - low).max(0.0);
        }
        (sum / (CHORDS + 1) as f64).min(1.0)
    }
}

/// |c + s a + t b| ≤ radius.
struct Limit {
    c: Vec3,
    a: Vec3,
    b: Vec3,
    radius: f64,
}

impl Limit {
    fn new([c, a, b]: [Vec3; 3], radius: f64) -> Self {
        Self { c, a, b, radius }
    }

    fn spread(&self) -> f64 {
        (self.a.norm_squared() + self.b.norm_squared()).sqrt()
    }

    fn surely_inside(&self) -> bool {
        self.c.norm() + self.spread() <= self.radius
    }

    fn surely_outside(&self) -> bool {
        self.c.norm() - self.spread() >= self.radius
    }

    /// The direction (s, t) in the pupil along which the limited distance grows most, of sixteen.
    fn hardest_direction(&self) -> [f64; 2] {
        let mut best = ([0.0, 1.0], f64::MIN);
        for i in 0..16 {
            let (t, s) = (std::f64::consts::PI * f64::from(i) / 16.0).sin_cos();
            let step = self.a * s + self.b * t;
            let growth = 2.0 * self.c.dot(step).abs() + step.norm_squared();
            if growth > best.1 {
                best = ([s, t], growth);
            }
        }
        best.0
    }

    /// The same limit with the second pupil coordinate along `d`.
    fn turned(&self, d: [f64; 2]) -> Self {
        let along = self.a * d[0] + self.b * d[1];
        let across = self.a * d[1] - self.b * d[0];
        Self { c: self.c, a: across, b: along, radius: self.radius }
    }

    /// Interval of t that fulfils the limit at `s`; empty as (0, 0).
    fn chord(&self, s: f64) -> (f64, f64) {
        let o = self.c + self.a * s;
        let (qa, qb, qc) =
            (self.b.norm_squared(), o.dot(self.b), o.norm_squared() - self.radius * self.radius);
        let disc = qb * qb - qa * qc;
        if disc <= 0.0 || qa == 0.0 {
            return if qa == 0.0 && qc <= 0.0 { (-1.0, 1.0) } else { (0.0, 0.0) };
        }
        let root = disc.sqrt();
        ((-qb - root) / qa, (-qb + root) / qa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(beam_radius_mm: f64) -> LitZone {
        LitZone { beam: Vec3::Z, beam_radius_mm, sample_centre: Vec3::ZERO, sample_radius_mm: 12.0 }
    }

    /// Area common to two circles of radii r and 1 at distance d, over π.
    fn lens_area(r: f64, d: f64) -> f64 {
        let a = ((d * d + 1.0 - r * r) / (2.0 * d)).acos();
        let b = ((d * d + r * r - 1.0) / (2.0 * d * r)).acos();
        (a - 0.5 * (2.0 * a).sin() + r * r * (b - 0.5 * (2.0 * b).sin())) / std::f64::consts::PI
    }

    #[test]
    fn a_round_footprint_on_a_round_spot_has_the_area_of_two_circles() {
        for d in [2.2, 2.7, 3.0, 3.4, 3.9] {
            for turn in [0.0f64, 0.7, 1.6] {
                let centre = Vec3::new(d * turn.cos(), d * turn.sin(), 0.0);
                let f = Footprint { centre, radii: [Vec3::X, Vec3::Y] };
                let (got, exact) = (f.lit(&zone(3.0)), lens_area(3.0, d));
                assert!((got - exact).abs() < 2e-3, "{d} {turn}: {got} against {exact}");
            }
        }
    }

    #[test]
    fn well_inside_everything_is_lit_and_well_outside_nothing() {
        let at = |x: f64| Footprint { centre: Vec3::new(x, 0.0, 0.0), radii: [Vec3::X, Vec3::Y] };
        assert_eq!(at(1.0).lit(&zone(3.0)), 1.0);
        assert_eq!(at(5.0).lit(&zone(3.0)), 0.0);
    }

    #[test]
    fn a_footprint_larger_than_the_spot_is_lit_by_the_ratio_of_areas() {
        let f = Footprint { centre: Vec3::ZERO, radii: [Vec3::X * 10.0, Vec3::Y] };
        // the strip |x| ≤ 3, nearly the whole height: ∫ over |s| ≤ 0.3 of the unit disc, limited by the circle of radius 3
        let exact = {
            let s = 0.3f64;
            // circle x² + y² ≤ 9 in scaled coordinates cuts only the corners: t² ≤ 9 − 100 s² and t² ≤ 1 − s²
            let n = 200_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let x = -s + 2.0 * s * (f64::from(i) + 0.5) / f64::from(n);
                    2.0 * (1.0 - x * x).min(9.0 - 100.0 * x * x).max(0.0).sqrt()
                })
                .sum();
            sum * 2.0 * s / f64::from(n) / std::f64::consts::PI
        };
        let got = f.lit(&zone(3.0));
        assert!((got / exact - 1.0).abs() < 0.02, "{got} against {exact}");
    }
}
