//! What maps say about themselves: undetermined harmonics, a coat that is not there, places without data, uncertainties; and cell means.

use gonio_optics::{Angle, Geometry, Vec3, flake};

use super::*;
use crate::{Brdf, Flag, Grid, Meaning, Measured, Rgb, average};

/// Flakes under a coat of `index`; their lobe is the sharper the larger `sharp`.
struct Paint {
    index: f64,
    sharp: f64,
}

impl Brdf for Paint {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let a = flake::flake_angles(light, view, self.index);
        let (inc, tilt) = (a.theta_inc.sin() * self.index, a.theta_flake.sin());
        [0.0, 0.4, 0.8].map(|c| 0.05 + (-self.sharp * tilt * tilt).exp() * (0.4 + c * inc * inc))
    }
}

const COATED: Paint = Paint { index: 1.5, sharp: 12.0 };

fn options(harmonics: usize) -> FlakeFitOptions {
    FlakeFitOptions { harmonics, nodes: [24, 24], ..FlakeFitOptions::default() }
}

fn sample(brdf: &dyn Brdf, ti: f64, to: f64, phi: f64) -> Sample {
    let (light, view) = Geometry::from_degrees(ti, to, phi).directions();
    Sample { light, view, value: brdf.eval(light, view), sigma: [0.0; 3], weight: 1.0 }
}

#[test]
fn harmonics_that_in_plane_geometries_cannot_tell_are_left_out_and_said() {
    let mut all = Vec::new();
    for ti in 0..15 {
        for to in 0..15 {
            for phi in [0.0, 180.0] {
                all.push(sample(&COATED, 5.0 * f64::from(ti), 5.0 * f64::from(to), phi));
            }
        }
    }
    let map = FlakeMap::fit("in-plane", &all, &options(2)).unwrap();
    assert_eq!(map.harmonics(), 0);
    assert!(map.findings().contains(&Finding::AllInPlane { asked: 2 }), "{:?}", map.findings());
    assert!(map.findings()[0].to_string().contains("plane of incidence"));
    let (l, v) = Geometry::from_degrees(40.0, 30.0, 90.0).directions();
    let (f, exact) = (map.eval(l, v), COATED.eval(l, v));
    assert!((0..3).all(|c| (f[c] / exact[c] - 1.0).abs() < 0.03), "{f:?} {exact:?}");
    // one row out of the plane is enough to have them back
    all.extend((0..15).map(|k| sample(&COATED, 60.0, 5.0 * f64::from(k), 90.0)));
    assert_eq!(FlakeMap::fit("and out", &all, &options(2)).unwrap().harmonics(), 2);
}

#[test]
fn a_coat_that_is_not_there_is_noticed_and_one_that_is_is_not() {
    let of = |index: f64, forced: f64| {
        // flat flakes: where the lobe is wide, either index serves
        let paint = Paint { index, sharp: 40.0 };
        let options = FlakeFitOptions { index: forced, ..options(0) };
        FlakeMap::fit("coat", &Region::default().of_brdf(&paint, 3000, 0), &options).unwrap()
    };
    let said = |m: &FlakeMap| m.findings().iter().any(|f| matches!(f, Finding::CoatNotSeen { .. }));
    assert!(said(&of(1.0, 1.5)), "{:?}", of(1.0, 1.5).findings());
    assert!(!said(&of(1.5, 1.5)) && !said(&of(1.0, 1.0)));
}

#[test]
fn what_stands_behind_an_answer_is_said() {
    let few: Vec<Sample> = (0..8).map(|k| sample(&COATED, 45.0, 5.0 * f64::from(k), 0.0)).collect();
    let map = FlakeMap::fit("few", &few, &options(0)).unwrap();
    assert!(map.findings().iter().any(|f| matches!(f, Finding::MostlyContinued { .. })));
    let at = |ti, to, phi| {
        let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
        map.standing(l, v)
    };
    assert_eq!(at(45.0, 10.0, 0.0), Standing::Measured);
    assert_eq!(at(5.0, 60.0, 180.0), Standing::Continued);
    assert_eq!(at(45.0, 40.0, 180.0), Standing::Gloss);
    assert_eq!(at(80.0, 10.0, 90.0), Standing::BeyondLargest);
    assert_eq!(map.standing(-Vec3::Z, Vec3::Z), Standing::BelowHorizon);
}

#[test]
fn an_estimate_from_a_handful_is_sure_where_it_was_measured_and_says_where_not() {
    let given: Vec<Sample> = portable_geometries()
        .iter()
        .map(|g| sample(&COATED, g.theta_i.degrees(), g.theta_o.degrees(), g.phi.degrees()))
        .collect();
    let map = FlakeMap::from_multi_angle("eight", &given, 1.5).unwrap();
    assert!(map.has_sigma() && map.findings().contains(&Finding::Estimated { measured: 8 }));
    let relative = |l, v| {
        let (f, s) = (map.eval(l, v), map.sigma(l, v).unwrap());
        s[1] / f[1]
    };
    let mut surest = 0.0f64;
    for s in &given {
        surest = surest.max(relative(s.light, s.view));
        let f = map.eval(s.light, s.view);
        assert!(
            (0..3).all(|c| (f[c] / s.value[c]).ln().abs() < 3.0 * relative(s.light, s.view)),
            "{f:?} {s:?}"
        );
    }
    let (l, v) = Geometry::from_degrees(75.0, 75.0, 20.0).directions();
    assert!(relative(l, v) > 1.5 * surest, "{} {surest}", relative(l, v));
    // noise is part of it
    let noisy: Vec<Sample> = given.iter().map(|s| Sample { sigma: s.value.map(|f| 0.3 * f), ..*s }).collect();
    let loose = FlakeMap::from_multi_angle("noisy", &noisy, 1.5).unwrap();
    let (l, v) = (given[3].light, given[3].view);
    assert!(loose.sigma(l, v).unwrap()[1] > 1.2 * map.sigma(l, v).unwrap()[1]);

    let text = map.to_json().unwrap();
    assert_eq!(FlakeMap::from_json(&text).unwrap(), map);
    let error = FlakeMap::from_multi_angle("two", &given[..2], 1.5).unwrap_err().to_string();
    assert!(error.contains("geometries = 2"), "{error}");
    assert!(FlakeMap::from_multi_angle("no coat", &given, f64::NAN).is_err());
}

#[test]
fn a_colour_outside_the_primaries_stays_there_and_noise_about_zero_is_not_negative() {
    struct Blue;
    impl Brdf for Blue {
        fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
            let [_, g, b] = COATED.eval(light, view);
            // the second channel is noise about zero, negative in one of twelve
            let noise = if (1e4 * light.x + 1e3 * view.y).fract().abs() < 1.0 / 12.0 { -1e-4 } else { 1e-4 };
            [-0.1 * g, noise, b]
        }
    }
    let map = FlakeMap::fit("blue", &Region::default().of_brdf(&Blue, 3000, 0), &options(0)).unwrap();
    let mut mean = 0.0;
    for (l, v) in Region::default().directions(500, 4) {
        let (f, exact) = (map.eval(l, v), Blue.eval(l, v));
        assert!(f[0] < 0.0 && f[1] >= 0.0, "{f:?} {exact:?}");
        mean += (f[0] / exact[0] - 1.0).abs() / 500.0;
    }
    assert!(mean < 0.02, "{mean}");
}

#[test]
fn cell_means_are_met_by_means_of_the_map_over_the_cell() {
    // a lobe that bends within a cell, and cells of 10°
    let paint = Paint { index: 1.5, sharp: 60.0 };
    let axis = |n: usize, to: f64| (0..n).map(|k| to * k as f64 / (n - 1) as f64).collect();
    let grid = Grid { theta_i_deg: axis(19, 90.0), theta_o_deg: axis(10, 90.0), phi_deg: axis(13, 180.0) };
    let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let mut table = Measured::empty(grid, meaning);
    for i in 0..table.values.len() {
        let cell = table.grid.coordinates(i);
        table.values[i] = average::cell_mean(&paint, &table.grid, meaning, cell, 5, 0).map(|f| f as f32);
        table.flag[i] = Flag::Measured;
    }
    let options =
        FlakeFitOptions { smoothness: Setting::Fixed(1e-4), edge: Setting::Fixed(0.0), ..options(0) };
    let error = |map: &FlakeMap| {
        let judged = Region::default().of_brdf(&paint, 2000, 3);
        let one = |s: &Sample| (map.eval(s.light, s.view)[1] / s.value[1] - 1.0).abs();
        judged.iter().map(one).sum::<f64>() / judged.len() as f64
    };
    let means = error(&FlakeMap::fit_table("means", &table, &options).unwrap());
    let nodes = error(&FlakeMap::fit("nodes", &Region::default().of_table(&table), &options).unwrap());
    assert!(means < 0.5 * nodes, "{means} {nodes}");
}
