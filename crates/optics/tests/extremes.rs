//! Formulas at the extremes against fifty digits (`tests/golden/extremes.csv`, made by `tests/python/extremes.py`), and laws that hold there.

use gonio_optics::flake::flake_angles;
use gonio_optics::{Angle, Geometry, Vec3, fresnel};
use proptest::prelude::*;

const TABLE: &str = include_str!("../../../tests/golden/extremes.csv");
/// What the roundings of a dozen operations add up to.
const RELATIVE: f64 = 3e-15;

/// Inputs and value of a formula's rows.
fn rows(formula: &str) -> Vec<(Vec<f64>, f64)> {
    let rows: Vec<(Vec<f64>, f64)> = TABLE
        .lines()
        .filter_map(|line| line.strip_prefix(formula)?.strip_prefix(','))
        .map(|rest| {
            let mut numbers: Vec<f64> =
                rest.split(',').filter(|c| !c.is_empty()).map(|c| c.parse().expect("a number")).collect();
            let value = numbers.pop().expect("a value");
            (numbers, value)
        })
        .collect();
    assert!(rows.len() > 20, "{formula}: {} rows", rows.len());
    rows
}

/// The largest relative error over a formula's rows.
fn worst(formula: &str, f: impl Fn(&[f64]) -> f64) -> f64 {
    rows(formula)
        .iter()
        .map(|(x, want)| {
            let have = f(x);
            let off = if *want == 0.0 { have.abs() } else { (have / want - 1.0).abs() };
            assert!(off < RELATIVE, "{formula} {x:?}: {have:e} for {want:e}, off by {off:.1e}");
            off
        })
        .fold(0.0, f64::max)
}

fn vectors(x: &[f64]) -> (Vec3, Vec3) {
    (Vec3::new(x[0], x[1], x[2]), Vec3::new(x[3], x[4], x[5]))
}

#[test]
fn reflectance_keeps_its_digits_from_normal_to_grazing_and_down_to_an_index_of_one() {
    let off = worst("dielectric", |x| fresnel::dielectric(x[0], x[1]));
    eprintln!("dielectric: {off:.1e}");
}

#[test]
fn refraction_keeps_the_digits_of_a_grazing_direction() {
    let cos = worst("refracted-cos", |x| fresnel::refracted_cos(x[0], x[1]));
    let z = worst("refract-z", |x| fresnel::refract(Vec3::new(x[0], x[1], x[2]), x[3]).z);
    eprintln!("refracted_cos: {cos:.1e}, refract: {z:.1e}");
}

/// An angle between vectors that are unit to a rounding is as good as they are: 2e-16 of a radian, and relative to itself beyond.
#[test]
fn flake_angles_keep_their_digits_where_light_and_view_nearly_meet() {
    for (formula, inc) in [("theta-inc", true), ("theta-flake", false)] {
        let mut most = 0.0f64;
        for (x, want) in rows(formula) {
            let (l, v) = vectors(&x);
            let a = flake_angles(l, v, x[6]);
            let have = if inc { a.theta_inc } else { a.theta_flake }.radians();
            // vectors that all but cancel leave the sum's direction to the roundings of their components
            let sum = (fresnel::refract(l, x[6]) + fresnel::refract(v, x[6])).norm();
            let bound = 4e-16 * (1.0 + 2.0 / sum.max(1e-3)) + 2e-15 * want.abs();
            assert!((have - want).abs() <= bound, "{formula} {x:?}: {have:e} for {want:e}");
            most = most.max((have - want).abs());
        }
        eprintln!("{formula}: {most:.1e} rad");
    }
}

proptest! {
    #[test]
    fn reflectance_lies_between_none_and_all_and_grows_towards_grazing(
        c in 0.0f64..1.0, step in 1e-12f64..0.5, n in 1.0f64..4.0,
    ) {
        let (f, steeper) = (fresnel::dielectric(c, n), fresnel::dielectric((c + step).min(1.0), n));
        prop_assert!((0.0..=1.0).contains(&f));
        // the unpolarised curve falls from grazing to its least value and rises by less than a tenth of r0 from there
        prop_assert!(steeper <= f + 0.1 * fresnel::r0_from_index(n) + 1e-15);
    }

    #[test]
    fn a_refracted_direction_is_unit_and_a_grazing_one_comes_back(
        exponent in -12.0f64..0.0, phi in 0.0f64..360.0, n in 1.0f64..3.0,
    ) {
        let z = 10f64.powf(exponent);
        let across = ((1.0 - z) * (1.0 + z)).sqrt();
        let (s, c) = phi.to_radians().sin_cos();
        let d = Vec3::new(across * c, across * s, z);
        let t = fresnel::refract(d, n);
        prop_assert!((t.norm() - 1.0).abs() < 1e-15);
        // n² (1 − sin²) = n² − 1 + z²: what came in can be told from what goes on as far as the coat leaves it
        let back = (n * t.z).powi(2) - (n - 1.0) * (n + 1.0);
        prop_assert!((back - z * z).abs() < 4e-15 * (n * n - 1.0 + z * z));
    }

    #[test]
    fn geometries_come_back_from_their_directions_at_every_edge(
        ti in prop_oneof![Just(0.0), Just(90.0), 0.0..90.0f64, 89.999999..90.0f64, 0.0..1e-9f64],
        to in prop_oneof![Just(0.0), Just(90.0), 0.0..90.0f64, 89.999999..90.0f64, 0.0..1e-9f64],
        phi in prop_oneof![Just(0.0), Just(180.0), 0.0..180.0f64, 179.999999..180.0f64, 0.0..1e-9f64],
    ) {
        let g = Geometry::from_degrees(ti, to, phi);
        let (l, v) = g.directions();
        let back = Geometry::from_directions(l, v);
        let near = |a: Angle, b: Angle| (a.radians() - b.radians()).abs() < 1e-15 + 1e-15 * b.radians();
        prop_assert!(near(back.theta_i, g.theta_i) && near(back.theta_o, g.theta_o));
        // an azimuth is known as well as there is a direction to have one
        if ti > 0.0 && to > 0.0 {
            prop_assert!((back.phi.radians() - g.phi.radians()).abs() < 2e-15);
        }
        let a = flake_angles(l, v, 1.5);
        prop_assert!(a.theta_inc.radians().is_finite() && a.theta_flake.radians().is_finite());
        prop_assert!((0.0..=90.0 + 1e-9).contains(&a.theta_inc.degrees()));
    }
}
