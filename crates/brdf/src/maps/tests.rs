//! Laws of the maps: identity in-plane, reciprocity, finite everywhere, recovery of what lives in flake space.

use gonio_optics::{Angle, Geometry, Vec3, flake, fresnel, isoline::Method};

use super::*;
use crate::{Brdf, Grid, Measured, Rgb, Scattered, models::Lambert};

/// A paint defined in flake space: flakes about the surface normal whose colour shifts with θ_inc, and for `azimuthal` > 0 a first
/// harmonic in φ_d.
struct FlakePaint {
    azimuthal: f64,
}

impl Brdf for FlakePaint {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let a = flake::flake_angles(light, view, 1.5);
        let (inc, tilt) = (a.theta_inc.sin(), a.theta_flake.sin());
        // sin θ_inc sin θ_flake cos φ_d = |d_z|/2
        let d = fresnel::refract(light, 1.5) - fresnel::refract(view, 1.5);
        let (p, q) = (inc * tilt, 0.5 * d.z);
        let azimuth = (self.azimuthal * (2.0 * q * q - p * p)).exp();
        [0.0, 0.4, 0.8].map(|c| azimuth * (0.05 + (-12.0 * tilt * tilt).exp() * (0.4 + c * inc * inc)))
    }
}

fn fitted(brdf: &dyn Brdf, options: &FlakeFitOptions) -> FlakeMap {
    FlakeMap::fit("test", &options.region.of_brdf(brdf, 6000, 0), options).unwrap()
}

fn options(harmonics: usize) -> FlakeFitOptions {
    FlakeFitOptions {
        harmonics,
        smoothness: Setting::Fixed(1e-5),
        edge: Setting::Fixed(0.0),
        ..FlakeFitOptions::default()
    }
}

/// Largest relative error over geometries that were not fitted.
fn worst(map: &FlakeMap, brdf: &dyn Brdf) -> f64 {
    errors(map, brdf).into_iter().fold(0.0, f64::max)
}

/// Relative errors of the worst channel.
fn errors(map: &FlakeMap, brdf: &dyn Brdf) -> Vec<f64> {
    let judged = map.region().of_brdf(brdf, 3000, 7);
    assert!(judged.len() == 3000);
    let one = |s: &Sample| {
        let f = map.eval(s.light, s.view);
        (0..3).map(|c| (f[c] / s.value[c] - 1.0).abs()).fold(0.0, f64::max)
    };
    judged.iter().map(one).collect()
}

#[test]
fn a_paint_that_lives_in_flake_space_is_reproduced_by_one_look_up() {
    let paint = FlakePaint { azimuthal: 0.0 };
    for transform in [Transform::Log, Transform::CubeRoot] {
        let of = |n| fitted(&paint, &FlakeFitOptions { transform, nodes: [n, n], ..options(0) });
        let mean = |n| errors(&of(n), &paint).iter().sum::<f64>() / 3000.0;
        let (coarse, fine) = (mean(20), mean(40));
        // what is left is the bilinear rule's, of second order in the step
        assert!(fine < 0.4 * coarse, "{transform:?}: {coarse} {fine}");
        let worst = worst(&of(40), &paint);
        assert!(worst < 0.02, "{transform:?}: {worst}");
    }
}

#[test]
fn a_harmonic_of_the_azimuth_needs_its_term() {
    let paint = FlakePaint { azimuthal: 6.0 };
    let (without, with) =
        (worst(&fitted(&paint, &options(0)), &paint), worst(&fitted(&paint, &options(1)), &paint));
    // what is left is the second harmonic of the exponential
    assert!(with < 0.15 * without && without > 0.05, "{without} {with}");
}

#[test]
fn a_coat_over_a_diffuser_is_followed_once_its_transmittance_is_divided_out() {
    struct Coated(crate::Coat);
    impl Brdf for Coated {
        fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
            self.0.base_through(&Lambert { diffuse: [0.5; 3] }, light, view)
        }
    }
    let paint = Coated(crate::Coat { index: 1.5 });
    let error = |edge| worst(&fitted(&paint, &FlakeFitOptions { edge, ..options(0) }), &paint);
    let (with, without) = (error(Setting::Fixed(-1.0)), error(Setting::Fixed(0.0)));
    assert!(with < 0.5 * without, "{without} {with}");
    assert!(error(Setting::Chosen) <= with, "{}", error(Setting::Chosen));
}

#[test]
fn exchanging_light_and_view_changes_no_bit() {
    // what is fitted is not reciprocal itself
    struct Skewed;
    impl Brdf for Skewed {
        fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
            [0.1, 0.2, 0.3].map(|c| c * (1.0 + light.z - 0.5 * view.z))
        }
    }
    let map = fitted(&Skewed, &options(3));
    let colour = ColourMap::from_brdf(&Skewed, 1.5, Method::Clip, Angle::from_degrees(75.0), 32);
    let everywhere = Region { largest: Angle::RIGHT, from_mirror: Angle::ZERO };
    for (l, v) in everywhere.directions(5000, 2) {
        assert_eq!(map.eval(l, v), map.eval(v, l));
        for (_, method) in Method::ALL {
            let colour = colour.clone().with_method(method);
            let (a, b) = (colour.eval(l, v), colour.eval(v, l));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-6), "{method} {a:?} {b:?}");
        }
    }
}

#[test]
fn in_plane_geometries_map_to_themselves() {
    let paint = FlakePaint { azimuthal: 6.0 };
    let map = ColourMap::from_brdf(&paint, 1.5, Method::Clip, Angle::from_degrees(75.0), 128);
    for (ti, to, phi) in
        [(45.0, 20.0, 180.0), (20.0, 45.0, 180.0), (70.0, 30.0, 0.0), (15.0, 60.0, 0.0), (60.0, 5.0, 180.0)]
    {
        let g = Geometry::from_degrees(ti, to, phi);
        let (l, v) = g.directions();
        let e = map.equivalent(l, v).geometry();
        let (high, low) = (ti.max(to), ti.min(to));
        assert!((e.theta_i.degrees() - high).abs() < 1e-9 && (e.theta_o.degrees() - low).abs() < 1e-9);
        assert!((e.phi.degrees() - phi).abs() < 1e-12);
        let (f, want) = (map.eval(l, v), paint.eval(l, v));
        assert!((0..3).all(|c| (f[c] / want[c] - 1.0).abs() < 0.01), "{ti} {to} {phi}: {f:?} {want:?}");
    }
}

#[test]
fn every_geometry_has_a_finite_answer() {
    let paint = FlakePaint { azimuthal: 6.0 };
    let flakes: Vec<FlakeMap> = [(1.0, 3), (1.5, 0), (1.5, 3), (2.5, 1)]
        .map(|(index, harmonics)| {
            fitted(
                &paint,
                &FlakeFitOptions {
                    index,
                    edge: Setting::Fixed(-f64::from(harmonics == 1)),
                    ..options(harmonics)
                },
            )
        })
        .into();
    let colour = ColourMap::from_brdf(&paint, 1.5, Method::MapVectorParallel, Angle::from_degrees(75.0), 16);
    let aspecular = Aspecular::from_brdf(&paint, Angle::from_degrees(45.0), Angle::from_degrees(75.0));
    let table = LookupTable::from_brdf(&paint, [19, 37, 36]);
    let check = |l: Vec3, v: Vec3, all: bool| {
        for map in &flakes {
            let f = map.eval(l, v);
            assert!(f.iter().all(|x| x.is_finite() && *x >= 0.0), "{l:?} {v:?} {f:?}");
        }
        if all {
            for other in [&colour as &dyn Brdf, &aspecular, &table] {
                let f = other.eval(l, v);
                assert!(f.iter().all(|x| x.is_finite() && *x >= 0.0), "{l:?} {v:?} {f:?}");
            }
        }
    };
    let everywhere = Region { largest: Angle::RIGHT, from_mirror: Angle::ZERO };
    for (i, (l, v)) in everywhere.directions(1_000_000, 5).enumerate() {
        check(l, v, i % 50 == 0);
    }
    let edges = [0.0, 1e-12, 1e-6, 41.8103, 45.0, 89.999_999, 90.0];
    for ti in edges {
        for to in edges {
            for phi in [0.0, 1e-9, 90.0, 179.999_999, 180.0] {
                let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
                check(l, v, true);
            }
        }
    }
    assert_eq!(flakes[0].eval(-Vec3::Z, Vec3::Z), [0.0; 3]);
}

#[test]
fn many_at_a_time_give_what_each_gives_alone() {
    let single = |d: Vec3| d.to_array().map(|x| x as f32);
    let everywhere = Region { largest: Angle::RIGHT, from_mirror: Angle::ZERO };
    let (mut light, view): (Vec<_>, Vec<_>) =
        everywhere.directions(101, 2).map(|(l, v)| (single(l), single(v))).unzip();
    light[40][2] = -0.1;
    for harmonics in 0..=3 {
        let map = fitted(&FlakePaint { azimuthal: 6.0 }, &options(harmonics));
        for count in [0, 1, 15, 16, 17, 101] {
            let mut out = vec![[-1.0; 3]; count];
            map.eval_many(&light, &view, &mut out);
            for (i, f) in out.iter().enumerate() {
                assert_eq!(*f, map.eval_single(light[i], view[i]), "{count} {i}");
            }
        }
    }
}

#[test]
fn a_map_is_read_back_as_it_was_and_a_damaged_one_is_refused() {
    let map = fitted(&FlakePaint { azimuthal: 6.0 }, &options(2));
    let text = map.to_json().unwrap();
    assert_eq!(FlakeMap::from_json(&text).unwrap(), map);
    for (from, to, says) in [
        ("\"version\":2", "\"version\":9", "version"),
        ("gonio-flake-map", "map", "format"),
        ("\"harmonics\":2", "\"harmonics\":1", "coefficients"),
        ("\"nodes\":[40,40]", "\"nodes\":[1,40]", "nodes"),
        ("\"index\":1.5", "\"index\":0.5", "index"),
    ] {
        assert!(text.contains(from));
        let error = FlakeMap::from_json(&text.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    assert!(FlakeMap::from_json(&text[..text.len() / 2]).is_err());
}

#[test]
fn a_table_of_the_size_of_real_measurements_serves_and_its_invalid_cells_do_not() {
    let paint = FlakePaint { azimuthal: 0.0 };
    let mut table = Measured::sampled(Grid::sopp(), &paint);
    for i in (0..table.values.len()).step_by(5) {
        table.values[i] = [1e3; 3];
        table.flag[i] = crate::Flag::Filled;
    }
    let map = FlakeMap::fit("table", &Region::default().of_table(&table), &options(0)).unwrap();
    let error = worst(&map, &paint);
    assert!(error < 0.02, "{error}");
}

#[test]
fn what_no_cell_covers_is_said_and_too_little_data_refused() {
    let narrow = Region { largest: Angle::from_degrees(40.0), ..Region::default() };
    let map = fitted(&FlakePaint { azimuthal: 0.0 }, &FlakeFitOptions { region: narrow, ..options(0) });
    let at = |ti, to, phi| Geometry::from_degrees(ti, to, phi).directions();
    let (l, v) = at(30.0, 10.0, 60.0);
    assert!(map.covers(l, v));
    let (l, v) = at(85.0, 85.0, 0.0);
    assert!(!map.covers(l, v));
    let none = Region::default().of_scattered(&Scattered::default());
    let error = FlakeMap::fit("none", &none, &options(1)).unwrap_err().to_string();
    assert!(error.contains("0 measured geometries") && error.contains("at least 6"), "{error}");
    let error = FlakeMap::fit("k", &none, &options(4)).unwrap_err().to_string();
    assert!(error.contains("harmonics = 4"), "{error}");
}
