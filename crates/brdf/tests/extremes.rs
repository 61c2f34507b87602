//! Lobes at the extremes against fifty digits (`tests/golden/extremes.csv`), and laws that hold there.

use gonio_brdf::Brdf as _;
use gonio_brdf::models::{AshikhminShirleySimplified, Coat};
use gonio_optics::{Angle, COS_FLOOR, Geometry, Vec3};
use proptest::prelude::*;

const TABLE: &str = include_str!("../../../tests/golden/extremes.csv");

#[test]
fn a_lobe_of_exponent_a_million_keeps_its_digits() {
    let (mut checked, mut most) = (0, 0.0f64);
    for line in TABLE.lines().filter_map(|l| l.strip_prefix("lobe,")) {
        let x: Vec<f64> = line.split(',').map(|c| c.parse().expect("a number")).collect();
        let (l, v) = (Vec3::new(x[0], x[1], x[2]), Vec3::new(x[3], x[4], x[5]));
        let (exponent, want) = (x[6], x[7]);
        let have = AshikhminShirleySimplified::lobe(exponent, l, v);
        checked += 1;
        if want < 1e-290 {
            assert!(have < 1e-280, "{x:?}: {have:e}");
            continue;
        }
        // the half vector of two that nearly cancel is theirs to lose, and an exponential has the error of its argument
        let half = l + v;
        let tilt2 = (half.x * half.x + half.y * half.y) / half.norm_squared();
        let argument = 0.5 * exponent * tilt2;
        let bound = 2e-15 * (2.0 + 1.0 / half.norm()) * (1.0 + argument);
        let off = (have / want - 1.0).abs();
        assert!(off < bound, "{x:?}: {have:e} for {want:e}, off by {off:.1e}, bound {bound:.1e}");
        most = most.max(off / bound);
    }
    assert!(checked > 40, "{checked}");
    eprintln!("lobe: {most:.2} of the bound at most, {checked} geometries");
}

fn edge() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(90.0), 0.0..90.0f64, 89.9999..90.0f64, 0.0..1e-6f64]
}

proptest! {
    #[test]
    fn a_lobe_and_a_gloss_are_finite_reciprocal_and_not_negative_at_every_edge(
        ti in edge(),
        to in edge(),
        phi in prop_oneof![Just(0.0), Just(180.0), 0.0..180.0f64],
        exponent in prop_oneof![Just(0.0), Just(1.0), Just(1e6), 1.0..1e6f64],
    ) {
        let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
        let m = AshikhminShirleySimplified { diffuse: [0.1; 3], specular: [0.5; 3], exponent };
        let (there, back) = (m.eval(l, v)[0], m.eval(v, l)[0]);
        prop_assert!(there.is_finite() && there >= 0.0, "{}", there);
        prop_assert!((there - back).abs() <= 1e-13 * there, "{} {}", there, back);
        let coat = Coat { index: 1.5 };
        for c in [l.z, v.z] {
            prop_assert!((0.0..=1.0).contains(&coat.reflectance(c)));
            let level = coat.gloss_level(c.max(COS_FLOOR), Angle::from_degrees(0.5));
            prop_assert!(level.is_finite() && level >= 0.0);
        }
    }
}
