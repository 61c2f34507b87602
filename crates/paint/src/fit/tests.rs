//! Paints made up, measured and fitted.

use std::sync::Arc;

use gonio_brdf::{Brdf as _, Flag};
use gonio_brdf::{Grid, Measured, Scattered, ScatteredPoint};
use gonio_fitter::{CoatChoice, Options, Weights};
use gonio_optics::{Angle, Geometry};

use super::{PaintFitError, PaintOptions, Subject, fit_paint, judge};
use crate::FlakeBtf;
use crate::car_paint::{CarPaint, CarPaintParts, FlakeSlices, Flakes, laws::sample_paint};

fn grid() -> Grid {
    Grid {
        theta_i_deg: (0..10).map(|k| 8.0 * f64::from(k)).collect(),
        theta_o_deg: (0..16).map(|k| 5.0 * f64::from(k)).collect(),
        phi_deg: (0..19).map(|k| 10.0 * f64::from(k)).collect(),
    }
}

fn options(coat: CoatChoice) -> PaintOptions {
    PaintOptions {
        lobes: Options { coat, weights: Weights::LogRelative, ..Options::default() },
        colour_nodes: Some([12, 8]),
        lobe_count: 2,
        ..PaintOptions::default()
    }
}

/// Two lobes of one colour and a smooth change of colour over them.
fn truth() -> CarPaint {
    let mut parts = sample_paint(true).into_parts();
    parts.lobes.truncate(2);
    parts.flakes = None;
    CarPaint::new(parts).expect("sound")
}

#[test]
fn a_paint_that_was_measured_comes_back_far_closer_than_its_lobes_alone() {
    let table = Measured::sampled(grid(), &truth());
    let subject = Subject::Table(&table);
    let fit = fit_paint(&subject, &options(CoatChoice::Index(1.5))).expect("fitted");
    let plain = fit_paint(&subject, &PaintOptions { colour_nodes: None, ..options(CoatChoice::Index(1.5)) })
        .expect("fitted");
    let mean = |a: &gonio_fitter::Assessment| a.delta_e.all.expect("cells").mean;
    let (with, without) = (mean(&fit.errors), mean(&plain.errors));
    assert!(with < 0.4 && with < 0.3 * without, "{with} against {without}");
    assert!(fit.nodes_seen > 0.5 && plain.nodes_seen == 0.0 && plain.paint.parts().colour.is_none());
}

#[test]
fn what_flakes_add_on_average_is_not_fitted_twice() {
    let mut parts = truth().into_parts();
    parts.flakes = sample_paint(true).into_parts().flakes;
    let paint = CarPaint::new(parts).expect("sound");
    let table = Measured::sampled(grid(), &paint);
    let with = PaintOptions { flakes: paint.parts().flakes.clone(), ..options(CoatChoice::Index(1.5)) };
    let fit = fit_paint(&Subject::Table(&table), &with).expect("fitted");
    let error = fit.errors.delta_e.all.expect("cells").mean;
    assert!(error < 0.5, "{error}");
    assert_eq!(fit.paint.parts().flakes, paint.parts().flakes);
    let open = PaintOptions { flakes: paint.parts().flakes.clone(), ..options(CoatChoice::Fitted) };
    assert!(matches!(fit_paint(&Subject::Table(&table), &open), Err(PaintFitError::FlakesNeedIndex)));
}

/// A paint whose textures show too few flakes: the mean of each slice is off by chance, the BRDF is not.
#[test]
fn textures_of_few_flakes_are_brought_to_the_level_of_the_measurement() {
    let mut parts = truth().into_parts();
    let angles = |deg: &[f64]| deg.iter().map(|&d| Angle::from_degrees(d)).collect::<Vec<_>>();
    let (half, incidence) = (angles(&[0.0, 8.0, 20.0, 41.0]), angles(&[0.0, 15.0, 40.0]));
    // flakes that outshine the base, the less the steeper
    let texels = (0..12 * 16)
        .map(|k| if k % 7 == 0 { [8.0, 6.0, 2.0].map(|v| v / (1 + k / 48) as f32) } else { [0.0; 3] });
    let btf = &FlakeBtf::new(half, incidence, [4, 4], texels.collect()).expect("sound");
    parts.flakes = Some(Flakes::Slices(FlakeSlices::new(Arc::new(btf.clone()), 0.02).expect("sound")));
    let paint = CarPaint::new(parts).expect("sound");
    let table = Measured::sampled(grid(), &paint);
    let chance = |k: usize| 0.6 + 0.8 * (k as f64 * 0.754_877_666).fract();
    // what a texture camera sees: the whole paint below the coat, each slice at a level of its own
    let base =
        CarPaint::new(CarPaintParts { flakes: None, coat: None, ..paint.parts().clone() }).expect("sound");
    let (mut texels, mut floors) = (Vec::new(), Vec::new());
    for (k, slice) in btf.slices().enumerate() {
        let (h, i) = (btf.half()[k / btf.incidence().len()], btf.incidence()[k % btf.incidence().len()]);
        // light and view in one plane, about the flake's normal
        let at = |a: f64| gonio_optics::Vec3::new(a.sin(), 0.0, a.cos());
        let (l, v) = (at(h.radians() + i.radians()), at(h.radians() - i.radians()));
        let floor = if l.z > 0.0 && v.z > 0.0 { base.eval(l, v) } else { [0.0; 3] };
        texels.extend(slice.iter().map(|t| t.map(|t| t * chance(k) as f32)));
        floors.push(floor.map(|f| f * chance(k)));
    }
    let seen =
        FlakeBtf::new(btf.half().to_vec(), btf.incidence().to_vec(), btf.size(), texels).expect("sound");
    let flakes = Some(Flakes::Slices(FlakeSlices::new(Arc::new(seen), 0.02).expect("sound")));
    let kept = PaintOptions { flakes, ..options(CoatChoice::Index(1.5)) };
    let brought = PaintOptions { flake_floors: Some(floors), ..kept.clone() };
    let fit = |o: &PaintOptions| fit_paint(&Subject::Table(&table), o).expect("fitted");
    let (kept, brought) = (fit(&kept), fit(&brought));
    let mean = |f: &super::PaintFit| f.errors.delta_e.all.expect("cells").mean;
    assert!(
        mean(&brought) < 1.0 && mean(&brought) < 0.5 * mean(&kept),
        "{} against {}",
        mean(&brought),
        mean(&kept)
    );
    let level = brought.flake_level.expect("told");
    assert!(level.p5 < 0.85 && level.p95 > 1.2 && kept.flake_level.is_none(), "{level:?}");
}

#[test]
fn scattered_points_serve_as_well_and_nothing_is_refused_in_words() {
    let paint = truth();
    let mut points = Vec::new();
    for k in 0..1500u32 {
        // low discrepancy over polar angles up to 70°
        let u = |base: f64| (f64::from(k) * base).fract();
        let geometry =
            Geometry::from_degrees(70.0 * u(0.754_877_666), 70.0 * u(0.569_840_29), 180.0 * u(0.381_966_011));
        let (l, v) = geometry.directions();
        points.push(ScatteredPoint { geometry, value: paint.eval(l, v), sigma: None, flag: Flag::Measured });
    }
    let data = Scattered { points };
    let subject = Subject::Scattered(&data);
    let fit = fit_paint(&subject, &options(CoatChoice::Index(1.5))).expect("fitted");
    let error = judge(&subject, &Options::default(), &fit.paint).delta_e.all.expect("points").mean;
    assert!(error < 0.6, "{error}");
    let empty = Scattered::default();
    let refused =
        fit_paint(&Subject::Scattered(&empty), &PaintOptions::default()).expect_err("no data").to_string();
    assert!(refused.contains("nothing was fitted"), "{refused}");
}

#[test]
fn a_black_paint_is_no_reason_to_fail_without_words() {
    let black = CarPaint::new(CarPaintParts::default()).expect("sound");
    let table = Measured::sampled(grid(), &black);
    match fit_paint(&Subject::Table(&table), &options(CoatChoice::None)) {
        Ok(fit) => {
            assert!(fit.paint.eval(gonio_optics::Vec3::Z, gonio_optics::Vec3::Z).iter().all(|v| *v < 1e-6));
        }
        Err(e) => assert!(e.to_string().contains("fitted"), "{e}"),
    }
}
