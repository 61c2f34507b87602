//! What holds for every paint: reciprocity, no light from nowhere, nothing negative, the mean of its places.

use std::sync::Arc;

use gonio_brdf::{Brdf as _, Coat, models::CookTorranceLobe};
use gonio_optics::{Angle, Geometry, Vec3};

use super::{CarPaint, CarPaintParts, ColourTable, FlakeSlices, Flakes, Through};
use crate::FlakeBtf;

fn angles(deg: &[f64]) -> Vec<Angle> {
    deg.iter().map(|&d| Angle::from_degrees(d)).collect()
}

/// A paint with everything in it.
pub(crate) fn sample_paint(two_way: bool) -> CarPaint {
    let lobe = |s: f64, alpha, r0| CookTorranceLobe { specular: [s, 0.8 * s, 0.3 * s], alpha, r0 };
    let (half, incidence) = (angles(&[0.0, 8.0, 20.0, 41.0]), angles(&[0.0, 15.0, 40.0]));
    let chi = (0..12).map(|k| [0.9, 1.0 - 0.03 * k as f32, 0.5 + 0.04 * k as f32]).collect();
    let texels =
        (0..12 * 16).map(|k| if k % 7 == 0 { [0.4, 0.3, 0.1] } else { [0.01, 0.0, -0.001] }).collect();
    let btf = FlakeBtf::new(half.clone(), incidence.clone(), [4, 4], texels).expect("sound");
    CarPaint::new(CarPaintParts {
        name: "sample".to_owned(),
        coat: Some(Coat { index: 1.5 }),
        through: if two_way { Through::TwoWay } else { Through::RefractedOnly },
        diffuse: [0.02, 0.05, 0.1],
        lobes: vec![lobe(0.5, 0.4, 0.9), lobe(0.2, 0.2, 0.5), lobe(0.05, 0.08, 0.1)],
        colour: Some(ColourTable::new(half, incidence, chi).expect("sound")),
        flakes: Some(Flakes::Slices(FlakeSlices::new(Arc::new(btf), 0.05).expect("sound"))),
    })
    .expect("sound")
}

fn directions() -> impl Iterator<Item = (Vec3, Vec3)> {
    let polar = [0.0, 7.0, 33.0, 60.0, 75.0, 89.0, 90.0];
    polar.into_iter().flat_map(move |i| {
        polar.into_iter().flat_map(move |o| {
            [0.0, 50.0, 121.0, 180.0].into_iter().map(move |p| Geometry::from_degrees(i, o, p).directions())
        })
    })
}

#[test]
fn light_and_view_may_be_exchanged() {
    for paint in [sample_paint(true), sample_paint(false)] {
        for (l, v) in directions() {
            for (a, b) in [
                (paint.eval(l, v), paint.eval(v, l)),
                (paint.eval_at(l, v, [0.3, 0.1]), paint.eval_at(v, l, [0.3, 0.1])),
            ] {
                assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-12 * a[c].abs().max(1e-12)), "{l:?} {v:?}");
            }
        }
    }
}

#[test]
fn nothing_is_negative_infinite_or_below_the_horizon() {
    let paint = sample_paint(true);
    for (l, v) in directions() {
        assert!(paint.eval(l, v).iter().all(|f| f.is_finite() && *f >= 0.0), "{l:?} {v:?}");
        assert_eq!(paint.eval(l, Vec3::new(v.x, v.y, -0.1)), [0.0; 3]);
    }
    assert_eq!(paint.eval(Vec3::new(f64::NAN, 0.0, f64::NAN), Vec3::Z), [0.0; 3]);
}

/// ∫ f cos θo dωo by a product rule fine enough for the lobes used.
fn albedo(paint: &CarPaint, theta_i: f64) -> [f64; 3] {
    let (n, m) = (360, 120);
    let mut sum = [0.0; 3];
    for a in 0..n {
        let theta = (f64::from(a) + 0.5) * 90.0 / f64::from(n);
        let weight = (90.0 / f64::from(n)).to_radians() * theta.to_radians().sin() * theta.to_radians().cos();
        for b in 0..m {
            let phi = (f64::from(b) + 0.5) * 180.0 / f64::from(m);
            let (l, v) = Geometry::from_degrees(theta_i, theta, phi).directions();
            let f = paint.eval(l, v);
            for c in 0..3 {
                sum[c] += f[c] * weight * 2.0 * std::f64::consts::PI / f64::from(m);
            }
        }
    }
    sum
}

#[test]
fn no_more_light_leaves_than_came() {
    // white to the limit: what lobes and Lambert may add up to
    let paint = CarPaint::new(CarPaintParts {
        coat: Some(Coat { index: 1.5 }),
        diffuse: [0.3; 3],
        lobes: vec![
            CookTorranceLobe { specular: [0.5; 3], alpha: 0.5, r0: 1.0 },
            CookTorranceLobe { specular: [0.2; 3], alpha: 0.1, r0: 1.0 },
        ],
        ..CarPaintParts::default()
    })
    .expect("sound");
    for theta_i in [0.0, 30.0, 60.0, 80.0] {
        let a = albedo(&paint, theta_i)[0];
        // what the surface reflects has not reached the base
        let entered = 1.0 - paint.parts().coat.expect("coated").reflectance(theta_i.to_radians().cos());
        assert!(a > 0.1 * entered && a < entered, "{theta_i}: {a} of {entered}");
    }
}

#[test]
fn the_form_of_the_coat_is_a_factor_alone() {
    let (two_way, refracted) = (sample_paint(true), sample_paint(false));
    let coat = two_way.parts().coat.expect("coated");
    for (l, v) in directions() {
        let k = (1.0 - coat.reflectance(l.z)) * (1.0 - coat.reflectance(v.z)) / 2.25;
        let (a, b) = (two_way.eval(l, v), refracted.eval(l, v));
        assert!((0..3).all(|c| (a[c] - k * b[c]).abs() <= 1e-13 * b[c]), "{l:?} {v:?}");
    }
}

#[test]
fn without_tables_it_is_the_coated_cook_torrance_model() {
    let mut parts = sample_paint(true).into_parts();
    (parts.colour, parts.flakes) = (None, None);
    let paint = CarPaint::new(parts).expect("sound");
    let p = paint.parts();
    let model = gonio_brdf::models::CookTorrance { diffuse: p.diffuse, lobes: p.lobes.clone() };
    let coat = p.coat.expect("coated");
    for (l, v) in directions() {
        let (a, b) = (paint.eval(l, v), coat.base_through(&model, l, v));
        assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-13 * b[c].abs()), "{l:?} {v:?}");
    }
}

#[test]
fn the_mean_of_all_places_is_the_value_without_place() {
    // without negative texels, which are cut off place by place
    let mut parts = sample_paint(true).into_parts();
    let (half, incidence) = (angles(&[0.0, 20.0]), angles(&[0.0, 40.0]));
    let texels: Vec<[f32; 3]> = (0..4 * 6).map(|k| [0.1 * k as f32, 0.5, 0.0]).collect();
    let btf = FlakeBtf::new(half, incidence, [3, 2], texels).expect("sound");
    parts.flakes = Some(Flakes::Slices(FlakeSlices::new(Arc::new(btf), 0.05).expect("sound")));
    let paint = CarPaint::new(parts).expect("sound");
    let (l, v) = Geometry::from_degrees(20.0, 35.0, 140.0).directions();
    let mut sum = 0.0;
    for x in 0..3 {
        for y in 0..2 {
            sum += paint.eval_at(l, v, [0.05 * (f64::from(x) + 0.5), 0.05 * (f64::from(y) + 0.5)])[0] / 6.0;
        }
    }
    assert!((sum / paint.eval(l, v)[0] - 1.0).abs() < 1e-6, "the texels are single precision");
}

#[test]
fn parts_out_of_bounds_are_named() {
    let tell = |change: &dyn Fn(&mut CarPaintParts)| {
        let mut parts = sample_paint(true).into_parts();
        change(&mut parts);
        CarPaint::new(parts).expect_err("unsound").to_string()
    };
    for (message, word) in [
        (tell(&|p| p.coat = Some(Coat { index: 1.0 })), "coat.index = 1"),
        (tell(&|p| p.diffuse[1] = -0.1), "diffuse = -0.1"),
        (tell(&|p| p.lobes[2].alpha = 0.0), "lobes[2].alpha = 0"),
        (tell(&|p| p.lobes[1].r0 = f64::NAN), "lobes[1].r0 = NaN"),
        (tell(&|p| p.lobes.push(p.lobes[0])), "at most 3"),
    ] {
        assert!(message.contains(word), "{message}");
    }
}
