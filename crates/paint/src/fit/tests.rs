//! Paints made up, measured and fitted.

use gonio_brdf::{Brdf as _, Flag};
use gonio_brdf::{Grid, Measured, Scattered, ScatteredPoint};
use gonio_fitter::{CoatChoice, Options, Weights};
use gonio_optics::Geometry;

use super::{PaintFitError, PaintOptions, Subject, fit_paint, judge};
use crate::car_paint::{CarPaint, CarPaintParts, laws::sample_paint};

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
