//! Laws of the flake paint: its texels average to Beckmann, a flake lives as long as it should, the seed decides.

use std::sync::Arc;

use gonio_brdf::Brdf as _;
use gonio_optics::{Geometry, Vec3};

use super::{Field, FlakePaint};

const SILVER: &str = r#"
format = "gonio-flake-paint"
version = 1
name = "silver"
seed = 7
coat_index = 1.5
diffuse = [0.02, 0.03, 0.05]
absorption_per_mm = [2.0, 5.0, 1.0]
tile_mm = 4.0
texel_mm = 0.02

[[flakes]]
density_per_mm2 = 900.0
size_mm = 0.03
size_spread = 0.3
spread_deg = 9.0
depth_mm = [0.002, 0.03]
reflectance = [0.85, 0.86, 0.88]

[[flakes]]
density_per_mm2 = 300.0
size_mm = 0.04
spread_deg = 5.0
depth_mm = [0.005, 0.02]
reflectance = [1.0, 1.0, 1.0]
film_nm = 90.0
film_spread_nm = 8.0
"#;

fn field(text: &str) -> Arc<Field> {
    Arc::new(Field::new(FlakePaint::from_toml(text).expect("readable")).expect("sound"))
}

#[test]
fn the_mean_of_all_texels_is_the_mean_paint() {
    let f = field(SILVER);
    let mean = f.mean();
    for (i, o, phi) in [(20.0, 20.0, 180.0), (30.0, 10.0, 180.0), (45.0, 20.0, 150.0), (10.0, 35.0, 60.0)] {
        let (l, v) = Geometry::from_degrees(i, o, phi).directions();
        let texels = f.texels([0, 0], [f.side(), f.side()], l, v);
        let expected = mean.eval(l, v);
        for c in 0..3 {
            let found = texels.iter().map(|t| f64::from(t[c])).sum::<f64>() / texels.len() as f64;
            // some thousand flakes are lit at once: the draw itself departs by its root
            assert!((found / expected[c] - 1.0).abs() < 0.06, "{i} {o} {phi} {c}: {found} {}", expected[c]);
        }
    }
}

#[test]
fn a_footprint_over_the_whole_tile_is_the_mean_of_its_texels() {
    let f = field(SILVER);
    let (l, v) = Geometry::from_degrees(35.0, 20.0, 170.0).directions();
    let texels = f.texels([0, 0], [f.side(), f.side()], l, v);
    let mean = texels.iter().map(|t| f64::from(t[0])).sum::<f64>() / texels.len() as f64;
    // an ellipse of many tiles
    let over = f.over(l, v, [1.0, 2.0], [[40.0, 3.0], [-2.0, 30.0]])[0];
    assert!((over / mean - 1.0).abs() < 0.02, "{over} {mean}");
}

#[test]
fn small_footprints_differ_and_the_same_one_is_the_same() {
    let f = field(SILVER);
    let (l, v) = Geometry::from_degrees(30.0, 30.0, 160.0).directions();
    let at = |x: f64| f.over(l, v, [x, 0.5], [[0.3, 0.0], [0.0, 0.3]])[1];
    let values: Vec<f64> = (0..40).map(|k| at(0.37 * f64::from(k))).collect();
    let mean = values.iter().sum::<f64>() / 40.0;
    let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 39.0).sqrt() / mean;
    assert!(spread > 0.02 && spread < 0.6, "{spread}");
    assert_eq!(at(0.37).to_bits(), at(0.37).to_bits());
    assert!((at(0.1) - at(0.1 + 4.0)).abs() < 1e-9, "the tile repeats");
}

#[test]
fn a_flake_lives_six_to_seven_degrees() {
    let text = SILVER
        .replace("density_per_mm2 = 900.0", "density_per_mm2 = 4.0")
        .replace("density_per_mm2 = 300.0", "density_per_mm2 = 0.0");
    let f = field(&text.replace("diffuse = [0.02, 0.03, 0.05]", "diffuse = [0.0, 0.0, 0.0]"));
    // half angles in the plane of incidence at a fixed angle between light and view
    let seen = |h_deg: f64, texel: usize| {
        // inside the coat light and view stand 20° to either side of the half vector
        let inside = |deg: f64| {
            let s = (h_deg + deg).to_radians().sin() * 1.5;
            Vec3::new(s, 0.0, (1.0 - s * s).max(0.0).sqrt())
        };
        let (l, v) = (inside(12.0), inside(-12.0));
        let s = f.seen(l, v).expect("above the horizon");
        f.texel_seen(texel % f.side(), texel / f.side(), &s)[0] / s.factor / s.scale
    };
    let mut lives = Vec::new();
    for texel in 0..f.side() * f.side() {
        let levels: Vec<f64> = (-140..=140).map(|k| seen(0.2 * f64::from(k), texel)).collect();
        let top = levels.iter().copied().fold(0.0, f64::max);
        // flakes whose tilt is in the plane and inside the sweep
        if top > 1e-3 && levels[0] < 0.1 * top && levels[280] < 0.1 * top {
            lives.push(0.2 * levels.iter().filter(|l| **l > 0.5 * top).count() as f64);
        }
        if lives.len() > 60 {
            break;
        }
    }
    lives.sort_by(f64::total_cmp);
    let median = lives[lives.len() / 2];
    assert!((6.0..=7.0).contains(&median), "{median}");
}

#[test]
fn the_seed_decides_and_nothing_else() {
    let (l, v) = Geometry::from_degrees(25.0, 25.0, 180.0).directions();
    let of = |seed: &str| field(&SILVER.replace("seed = 7", seed)).texels([3, 5], [40, 30], l, v);
    assert_eq!(of("seed = 7"), of("seed = 7"));
    assert_ne!(of("seed = 7"), of("seed = 8"));
}

#[test]
fn the_mean_is_reciprocal_and_keeps_its_energy() {
    let text =
        SILVER.replace("[2.0, 5.0, 1.0]", "[0.0, 0.0, 0.0]").replace("[0.85, 0.86, 0.88]", "[1.0, 1.0, 1.0]");
    let mean = field(&text.replace("[0.02, 0.03, 0.05]", "[1.0, 1.0, 1.0]")).mean();
    for theta_i in [0.0f64, 30.0, 60.0, 80.0] {
        let (mut albedo, n, m) = (0.0, 200, 60);
        for a in 0..n {
            let theta = (f64::from(a) + 0.5) * 90.0 / f64::from(n);
            let w = (90.0 / f64::from(n)).to_radians() * theta.to_radians().sin() * theta.to_radians().cos();
            for b in 0..m {
                let (l, v) =
                    Geometry::from_degrees(theta_i, theta, (f64::from(b) + 0.5) * 180.0 / f64::from(m))
                        .directions();
                let f = mean.eval(l, v)[1];
                assert!((f - mean.eval(v, l)[1]).abs() <= 1e-12 * f);
                albedo += f * w * 2.0 * std::f64::consts::PI / f64::from(m);
            }
        }
        assert!(albedo > 0.1 && albedo < 1.0, "{theta_i}: {albedo}");
    }
    assert_eq!(mean.eval(Vec3::Z, Vec3::new(1.0, 0.0, -0.1)), [0.0; 3]);
}

#[test]
fn what_no_paint_can_be_is_named() {
    for (from, to, word) in [
        ("coat_index = 1.5", "coat_index = 1.0", "coat_index = 1"),
        ("spread_deg = 9.0", "spread_deg = -1.0", "flakes[0].spread_deg = -1"),
        ("depth_mm = [0.005, 0.02]", "depth_mm = [0.02, 0.005]", "flakes[1].depth_mm"),
        ("density_per_mm2 = 900.0", "density_per_mm2 = nan", "NaN"),
        ("tile_mm = 4.0", "tile_mm = 51.0", "tile_mm = 51"),
        ("version = 1", "version = 2", "version = 2"),
        ("name =", "nane =", "nane"),
    ] {
        let text = SILVER.replacen(from, to, 1);
        let e = FlakePaint::from_toml(&text).map(|p| p.tile_mm);
        let message = e.expect_err(to).to_string();
        assert!(message.contains(word), "{message}");
    }
    assert!(FlakePaint::is_one(SILVER) && !FlakePaint::is_one("format = \"gonio-plan\""));
}

#[test]
fn a_slice_is_what_its_directions_show() {
    let f = field(SILVER);
    let (l, v) = Geometry::from_degrees(35.0, 10.0, 180.0).directions();
    let inside = |d: Vec3| gonio_optics::fresnel::refract(d, 1.5);
    let polar = |d: Vec3| gonio_optics::Angle::from_radians(d.x.atan2(d.z));
    let (a, b) = (polar(inside(l)), polar(inside(v)));
    let slice = f.slice((a + b) * 0.5, (a - b) * 0.5, [7, 9], [20, 10]);
    let k = f.seen(l, v).expect("above").factor;
    for (s, t) in slice.iter().zip(f.texels([7, 9], [20, 10], l, v)) {
        assert!(
            (0..3).all(|c| (f64::from(s[c]) * k - f64::from(t[c])).abs() <= 1e-5 * f64::from(t[c])),
            "{s:?} {t:?}"
        );
    }
}

#[test]
fn a_mix_has_the_flakes_of_both_at_their_share() {
    let a = FlakePaint::from_toml(SILVER).expect("readable");
    let mut b = a.clone();
    b.flakes.truncate(1);
    b.diffuse = [0.1; 3];
    let half = FlakePaint::mixed(&a, &b, 0.5).expect("a share");
    assert_eq!(half.flakes.iter().map(|p| p.density_per_mm2).collect::<Vec<_>>(), [450.0, 150.0, 450.0]);
    assert!((half.diffuse[0] - 0.06).abs() < 1e-12 && half.check().is_ok());
    assert_eq!(FlakePaint::mixed(&a, &b, 0.0).expect("a share").flakes, a.flakes);
    assert!(FlakePaint::mixed(&a, &b, 1.5).is_err());
}
