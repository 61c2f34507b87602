//! Laws every model keeps: reciprocity, no NaN, infinity or negative value up to grazing angles, energy.

use std::f64::consts::{FRAC_1_PI, TAU};

use gonio_optics::{Angle, Geometry, Vec3, quadrature::gauss_legendre};
use proptest::prelude::*;

use super::*;
use crate::average::{adaptive_cell_mean, cell_mean};
use crate::{Brdf, Grid, Meaning, Rgb};

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
        Model::AshikhminShirleyAnisotropic(AshikhminShirleyAnisotropic {
            diffuse,
            specular,
            exponent_u: exponent,
            exponent_v: 0.3 * exponent,
            r0,
        }),
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
fn the_energy_bounds_of_the_ward_forms_hold_where_they_are_said_to_and_end_there() {
    // the largest albedo over all widths
    let largest = |make: &dyn Fn(f64) -> Model, deg: f64| {
        let widths = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 4.0];
        widths.iter().map(|&a| albedo(make(a).brdf(), Angle::from_degrees(deg))).fold(0.0, f64::max)
    };
    let (diffuse, specular) = ([0.0; 3], [1.0; 3]);
    let ward = |alpha| Model::Ward(Ward { diffuse, specular, alpha });
    let duer = |alpha| Model::WardDuer(WardDuer { diffuse, specular, alpha });
    for deg in [0.0, 30.0, 60.0, 75.0, 80.0] {
        assert!(largest(&duer, deg) <= 1.0 + 1e-4, "ward-duer at {deg}");
    }
    for deg in [0.0, 45.0, 80.0, 88.0, 89.0, 89.5] {
        assert!(largest(&ward, deg) <= 1.0 + 1e-4, "ward at {deg}");
    }
    assert!(largest(&duer, 88.0) > 2.0 && largest(&ward, 89.95) > 1.5);
    // and what Ward's form loses: a narrow lobe returns cs cos θi, which is what Dür mends
    for deg in [0.0, 30.0, 60.0] {
        let theta = Angle::from_degrees(deg);
        let got = [ward(0.02), duer(0.02)].map(|m| albedo(m.brdf(), theta));
        assert!((got[0] - theta.cos()).abs() < 2e-3 && (got[1] - 1.0).abs() < 2e-3, "{deg}: {got:?}");
    }
}

#[test]
fn a_rough_diffuser_gives_back_at_most_what_its_bound_says() {
    let largest = [0, 5, 9, 11, 13, 20, 45, 90].map(|sigma| {
        let m = OrenNayar { diffuse: [1.0; 3], sigma_deg: f64::from(sigma) };
        [0.0, 30.0, 60.0, 80.0, 89.0, 89.999].map(|deg| albedo(&m, Angle::from_degrees(deg)))
    });
    let largest = largest.into_iter().flatten().fold(0.0, f64::max);
    assert!((1.012..=1.016).contains(&largest), "{largest}");
    let smooth = OrenNayar { diffuse: [1.0; 3], sigma_deg: 0.0 };
    for deg in [0.0, 37.0, 80.0] {
        assert!((albedo(&smooth, Angle::from_degrees(deg)) - 1.0).abs() < 1e-12);
    }
    // brighter towards the light than away from it
    let rough = OrenNayar { diffuse: [1.0; 3], sigma_deg: 30.0 };
    let at = |phi| {
        let (l, v) = Geometry::from_degrees(60.0, 60.0, phi).directions();
        rough.eval(l, v)[0]
    };
    assert!(at(0.0) > 1.5 * at(180.0));
}

#[test]
fn the_facets_a_ggx_surface_shows_have_the_area_of_its_outline() {
    // ∫ D ⟨h·v⟩ G1(v) dω_h = n·v: distribution and masking belong together; D is read from the lobe's own value
    let (alpha, rule) = (0.4, gauss_legendre(64));
    let lobe = GgxLobe { specular: [1.0; 3], alpha, r0: 1.0 };
    let density = |h: Vec3| {
        // retroreflection: l = v = h has h·v = 1, G = 1/(1 + 2Λ) = 1/√(1 + α² tan²)
        let tan2 = (1.0 - h.z * h.z) / (h.z * h.z);
        lobe.value(h, h) * 4.0 * h.z * h.z * (1.0 + alpha * alpha * tan2).sqrt()
    };
    for deg in [0.0, 40.0, 75.0, 85.0] {
        let v = Vec3::from_polar(Angle::from_degrees(deg), Angle::ZERO);
        let tan2 = (1.0 - v.z * v.z) / (v.z * v.z);
        let masking = 2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt());
        let mut sum = 0.0;
        for &(x, wx) in &rule {
            for k in 0..720 {
                let phi = (f64::from(k) + 0.5) * TAU / 720.0;
                let (s, c) = ((1.0 - x * x).sqrt(), x);
                let h = Vec3::new(s * phi.cos(), s * phi.sin(), c);
                sum += wx * TAU / 720.0 * density(h) * h.dot(v).max(0.0) * masking;
            }
        }
        assert!((sum / v.z - 1.0).abs() < 1e-3, "{deg}: {}", sum / v.z);
    }
}

#[test]
fn lafortune_with_mirrored_tangents_is_phong_and_leans_as_its_weights_say() {
    let (diffuse, specular) = ([0.1; 3], [0.4; 3]);
    for exponent in [0.0, 3.0, 80.0, 1e4] {
        let phong = Phong { diffuse, specular, exponent };
        let same = lafortune(diffuse, specular, -1.0, 1.0, exponent);
        for (ti, to, phi) in [(0.0, 0.0, 0.0), (30.0, 31.0, 179.0), (70.0, 65.0, 180.0), (45.0, 80.0, 20.0)] {
            let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
            let (a, b) = (same.eval(l, v)[0], phong.eval(l, v)[0]);
            assert!((a / b - 1.0).abs() < 1e-10, "n {exponent} at {ti} {to} {phi}: {a} {b}");
        }
    }
    let peak = |cxy: f64, cz: f64| {
        let m = lafortune([0.0; 3], specular, cxy, cz, 50.0);
        let at = |to: u32| {
            let (l, v) = Geometry::from_degrees(45.0, 0.1 * f64::from(to), 180.0).directions();
            m.eval(l, v)[0]
        };
        0.1 * f64::from((0..900).max_by(|&a, &b| at(a).total_cmp(&at(b))).unwrap())
    };
    // tan θ_peak = |Cxy|/Cz tan θi
    assert!((peak(-1.0, 0.8) - 1.25f64.atan().to_degrees()).abs() < 0.06);
    assert!((peak(-0.8, 1.0) - 0.8f64.atan().to_degrees()).abs() < 0.06);
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
fn the_sharpness_asks_for_the_nodes_that_a_cell_mean_needs() {
    let grid = Grid::sopp();
    let lamp = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    for (exponent, alpha) in [(0.0, 1.0), (21.0, 0.3), (300.0, 0.08)] {
        for m in all(0.2, 0.3, exponent, alpha, 0.1) {
            // at the peak, beside it, and far from it; row and column 6 and 12 hold θo = θi
            for cell in [[0, 0, 0], [6, 12, 35], [6, 14, 35], [12, 26, 34], [9, 18, 10], [12, 20, 0]] {
                let got = adaptive_cell_mean(m.brdf(), &grid, lamp, cell)[0];
                let want = cell_mean(m.brdf(), &grid, lamp, cell, 16, 4)[0];
                assert!((got / want - 1.0).abs() < 2e-4, "{m:?} {cell:?}: {got} {want}");
            }
        }
    }
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
