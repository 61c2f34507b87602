//! Laws every model keeps: reciprocity, no NaN, infinity or negative value up to grazing angles, energy.

use std::f64::consts::{FRAC_1_PI, TAU};

use gonio_optics::{Angle, Geometry, Vec3, quadrature::gauss_legendre};
use proptest::prelude::*;

use super::*;
use crate::{Brdf, Rgb};

/// Every model with the given sharpness, colours 1 and no diffuse part unless asked for.
fn all(diffuse: f64, specular: f64, exponent: f64, alpha: f64, r0: f64) -> Vec<Model> {
    let (diffuse, specular) = ([diffuse; 3], [specular; 3]);
    vec![
        Model::Lambert(Lambert { diffuse }),
        Model::Phong(Phong { diffuse, specular, exponent }),
        Model::BlinnPhong(BlinnPhong { diffuse, specular, exponent }),
        Model::AshikhminShirleySimplified(AshikhminShirleySimplified { diffuse, specular, exponent }),
        Model::LambertAshikhminShirley(LambertAshikhminShirley { diffuse, specular, exponent, r0: Some(r0) }),
        Model::LambertAshikhminShirley(LambertAshikhminShirley { diffuse, specular, exponent, r0: None }),
        Model::AshikhminShirley(AshikhminShirley { diffuse, specular, exponent, r0 }),
        Model::CookTorrance(CookTorrance { diffuse, lobes: vec![CookTorranceLobe { specular, alpha, r0 }] }),
        Model::Ggx(Ggx { diffuse, lobes: vec![GgxLobe { specular, alpha, r0 }] }),
        Model::Ward(Ward { diffuse, specular, alpha }),
        Model::WardDuer(WardDuer { diffuse, specular, alpha }),
        Model::Lafortune(lafortune(diffuse, specular, -1.0, 1.0, exponent)),
        Model::Lafortune(lafortune(diffuse, specular, -1.0, 0.9, exponent)),
        Model::Lafortune(lafortune(diffuse, specular, 0.8, 1.0, exponent)),
        Model::OrenNayar(OrenNayar { diffuse, sigma_deg: alpha.atan().to_degrees() }),
    ]
}

fn lafortune(diffuse: Rgb, specular: Rgb, cxy: f64, cz: f64, exponent: f64) -> Lafortune {
    Lafortune { diffuse, lobes: vec![LafortuneLobe { specular, cxy, cz, exponent }] }
}

/// ∫ f cos θo dω for light at `theta`: the rule is laid over the lobe by cutting the hemisphere at the mirror direction.
fn albedo(brdf: &dyn Brdf, theta: Angle) -> f64 {
    let light = Vec3::from_polar(theta, Angle::ZERO);
    let rule = gauss_legendre(16);
    let width = 3.0 / (brdf.sharpness() + 4.0).sqrt();
    // cut points around the mirror direction, in units of the lobe's width
    let cuts = |peak: f64, low: f64, high: f64, width: f64| {
        let mut c = vec![low, high];
        for k in [-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0] {
            c.push((peak + k * width).clamp(low, high));
        }
        c.sort_by(f64::total_cmp);
        c
    };
    let polar = cuts(theta.radians(), 0.0, std::f64::consts::FRAC_PI_2, width);
    let azimuth =
        cuts(0.0, 0.0, std::f64::consts::PI, width * 2.0 * theta.cos().max(0.05) / theta.sin().max(0.05));
    let mut sum = 0.0;
    for p in polar.windows(2) {
        for a in azimuth.windows(2) {
            for &(x, wx) in &rule {
                let (s, c) = (p[0] + (p[1] - p[0]) * x).sin_cos();
                for &(y, wy) in &rule {
                    let (sp, cp) = (a[0] + (a[1] - a[0]) * y).sin_cos();
                    let view = Vec3::new(-s * cp, s * sp, c);
                    sum += wx * wy * (p[1] - p[0]) * (a[1] - a[0]) * s * c * brdf.eval(light, view)[0];
                }
            }
        }
    }
    2.0 * sum
}

#[test]
fn no_model_reflects_more_than_it_receives() {
    for (exponent, alpha) in [(0.0, 1.0), (1.0, 0.7), (2.0, 0.5), (21.0, 0.3), (120.0, 0.12), (1300.0, 0.04)]
    {
        for deg in [0.0, 20.0, 45.0, 70.0, 80.0] {
            for m in all(0.0, 1.0, exponent, alpha, 1.0) {
                // exact at normal incidence, where it is largest: (n + 8)(n + 2^(−n/2))/((n + 2)(n + 4)) for Blinn–Phong
                let n = exponent;
                let blinn = (n + 8.0) * (n + (-0.5 * n).exp2()) / ((n + 2.0) * (n + 4.0));
                let bound = if m.name() == "blinn-phong" { blinn.max(1.0) } else { 1.0 };
                let a = albedo(m.brdf(), Angle::from_degrees(deg));
                assert!(a <= bound + 1e-4, "{} n {exponent} alpha {alpha} at {deg}: {a}", m.name());
            }
            for m in all(1.0, 0.0, exponent, alpha, 0.0) {
                let a = albedo(m.brdf(), Angle::from_degrees(deg));
                let bound = if m.name() == "oren-nayar" { 1.016 } else { 1.0 };
                assert!(a <= bound + 1e-9, "{} diffuse at {deg}: {a}", m.name());
            }
        }
    }
}

#[test]
fn the_quadrature_of_the_energy_test_sees_the_whole_lobe() {
    // at normal incidence Phong's and Ashikhmin–Shirley's factors are exact in the limit of a narrow lobe
    for exponent in [120.0, 1300.0] {
        let every = all(0.0, 1.0, exponent, (2.0 / exponent).sqrt(), 1.0);
        // what has no lobe, or looks elsewhere than along the mirror direction, is not meant
        let aside = ["lambert", "oren-nayar", "lafortune"];
        for m in every.iter().filter(|m| !aside.contains(&m.name())) {
            let a = albedo(m.brdf(), Angle::ZERO);
            assert!((0.9..1.05).contains(&a), "{} {a}", m.name());
        }
    }
}

#[test]
fn a_white_diffuser_in_a_white_furnace_disappears() {
    let m = Lambert { diffuse: [1.0; 3] };
    for deg in [0.0, 37.0, 80.0] {
        assert!((albedo(&m, Angle::from_degrees(deg)) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_coat_in_a_white_furnace_gives_back_no_more_than_it_gets() {
    // single passage: what is reflected at the coat plus what comes out of a white base stays below 1
    let coat = Coat { index: 1.5 };
    for deg in [0.0, 30.0, 60.0, 80.0] {
        let theta = Angle::from_degrees(deg);
        let file =
            ModelFile { coat: Some(coat), ..ModelFile::from(Model::Lambert(Lambert { diffuse: [1.0; 3] })) };
        let total = coat.reflectance(theta.cos()) + albedo(&file, theta);
        assert!(total < 1.0 && total > 0.3, "{deg}: {total}");
    }
}

#[test]
fn the_gloss_returns_the_fresnel_reflectance() {
    let coat = Coat { index: 1.567 };
    let alpha = Angle::from_degrees(0.5);
    for deg in [0.0, 40.0, 70.0] {
        let theta = Angle::from_degrees(deg);
        let light = Vec3::from_polar(theta, Angle::ZERO);
        let image = gonio_optics::quadrature::cone(Vec3::from_polar(theta, Angle::STRAIGHT), alpha, 20);
        let solid_angle = TAU * 2.0 * (alpha * 0.5).sin().powi(2);
        let inside = Angle::from_radians(alpha.radians() * (1.0 + 1e-9));
        let sum: f64 = image.iter().map(|&v| coat.gloss(light, v, inside) * v.z).sum();
        let got = sum / image.len() as f64 * solid_angle;
        let want = coat.reflectance(theta.cos());
        assert!((got / want - 1.0).abs() < 2e-3, "{deg}: {got} {want}");
    }
    // black glass under the lamp of the reference instrument, at normal incidence
    assert!((coat.gloss_level(1.0, alpha) - 204.0).abs() < 1.0);
}

#[test]
fn light_or_view_below_the_horizon_gives_nothing() {
    let (up, down) = (Vec3::Z, Vec3::new(0.6, 0.0, -0.8));
    for m in all(0.5, 0.5, 10.0, 0.3, 0.5) {
        assert_eq!((m.brdf().eval(up, down), m.brdf().eval(down, up)), ([0.0; 3], [0.0; 3]));
    }
}

#[test]
fn lambert_is_the_albedo_over_pi() {
    assert_eq!(
        Lambert { diffuse: [1.0, 0.5, 0.0] }.eval(Vec3::Z, Vec3::Z),
        [FRAC_1_PI, 0.5 * FRAC_1_PI, 0.0]
    );
}

/// Angles with the edges drawn often.
fn theta() -> impl Strategy<Value = f64> {
    prop_oneof![3 => 0.0..=90.0f64, 1 => Just(0.0), 1 => Just(90.0), 1 => Just(89.999_999)]
}

fn azimuth() -> impl Strategy<Value = f64> {
    prop_oneof![3 => 0.0..=180.0f64, 1 => Just(0.0), 2 => Just(180.0)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn values_are_finite_and_not_negative(ti in theta(), to in theta(), phi in azimuth(), log_n in -2.0..=6.0f64, log_a in -4.0..=0.5f64, r0 in 0.0..=1.0f64) {
        let (mut l, mut v) = Geometry::from_degrees(ti, to, phi).directions();
        // cos 90° is 6e-17 in f64; the exact edge must hold too
        for d in [&mut l, &mut v] {
            if d.z < 1e-12 { d.z = 0.0; }
        }
        for m in all(0.5, 0.5, 10f64.powf(log_n), 10f64.powf(log_a), r0) {
            let bare = m.brdf().eval(l, v)[0];
            prop_assert!(bare.is_finite() && bare >= 0.0, "{} {bare}", m.name());
            let coated = ModelFile { coat: Some(Coat { index: 1.5 }), ..ModelFile::from(m) };
            let f = coated.eval_with_lamp(l, v, Angle::from_degrees(0.5))[0];
            prop_assert!(f.is_finite() && f >= 0.0, "coated {f}");
        }
    }

    #[test]
    fn exchanging_light_and_view_changes_nothing(ti in theta(), to in theta(), phi in azimuth(), log_n in -2.0..=6.0f64, log_a in -4.0..=0.5f64, r0 in 0.0..=1.0f64) {
        let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
        for m in all(0.5, 0.5, 10f64.powf(log_n), 10f64.powf(log_a), r0) {
            let (a, b) = (m.brdf().eval(l, v)[0], m.brdf().eval(v, l)[0]);
            prop_assert!((a - b).abs() <= 1e-9 * a.abs().max(b.abs()), "{} {a} {b}", m.name());
            let coated = ModelFile { coat: Some(Coat { index: 1.5 }), ..ModelFile::from(m) };
            let (a, b) = (coated.eval(l, v)[0], coated.eval(v, l)[0]);
            prop_assert!((a - b).abs() <= 1e-9 * a.abs().max(b.abs()), "coated {a} {b}");
        }
    }
}
