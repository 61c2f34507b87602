//! Whatever is in a table, a fit ends with a status.

use gonio_brdf::{
    Flag, Grid, Meaning, Measured, Scattered, ScatteredPoint, models::AshikhminShirleySimplified,
};
use gonio_fitter::{ModelChoice, Observations, Options, Status, Weights, fit};
use gonio_optics::{Angle, Geometry};
use proptest::prelude::*;

fn filled(value: f32, sigma: f32) -> Measured {
    let grid = Grid {
        theta_i_deg: vec![0.0, 45.0],
        theta_o_deg: vec![0.0, 30.0, 45.0, 60.0],
        phi_deg: vec![0.0, 90.0, 180.0],
    };
    let mut m = Measured::empty(grid, Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) });
    m.values.fill([value; 3]);
    m.sigma.fill([sigma; 3]);
    m.flag.fill(Flag::Measured);
    m
}

/// Every model, the commonest with every weight, the others with Ngan's; the reports must be writable, too.
fn statuses(obs: &Observations) -> Vec<Status> {
    let mut out = Vec::new();
    for (name, model) in ModelChoice::ALL {
        let common = name.contains("ashikhmin") || name == "lambert";
        for (_, weights) in Weights::ALL {
            if (!common && weights != Weights::Ngan) || model == ModelChoice::AshikhminShirleyAnisotropic {
                continue;
            }
            let f = fit(obs, &Options { model, weights, ..Options::default() });
            f.model.check().unwrap();
            let text = f.to_model_file().to_json().unwrap();
            assert_eq!(gonio_brdf::ModelFile::from_json(&text).unwrap().model.name(), f.model.name());
            assert!(f.sentence().len() > 20 && !f.status.name().is_empty());
            out.push(f.status);
        }
    }
    out
}

#[test]
fn an_anisotropic_model_says_what_it_lacks() {
    let f = fit(
        &Observations::from_measured(&filled(0.1, 0.01)),
        &Options { model: ModelChoice::AshikhminShirleyAnisotropic, ..Options::default() },
    );
    assert_eq!(f.status.name(), "not-applicable");
    assert!(!f.status.is_fitted() && f.sentence().contains("azimuths"));
    assert!(f.parameters.iter().all(|p| p.value.is_nan() && p.sigma.is_none()));
}

#[test]
fn no_data_is_a_status() {
    let empty = Measured::empty(Grid::sopp(), Meaning::Node);
    assert!(statuses(&Observations::from_measured(&empty)).iter().all(|s| *s == Status::NoData));
    assert!(
        statuses(&Observations::from_measured(&filled(f32::NAN, 1.0))).iter().all(|s| *s == Status::NoData)
    );
    assert!(
        statuses(&Observations::from_scattered(&Scattered::default())).iter().all(|s| *s == Status::NoData)
    );
}

#[test]
fn all_zero_and_all_negative_end_at_the_bounds() {
    for value in [0.0, -0.5] {
        for s in statuses(&Observations::from_measured(&filled(value, 0.1))) {
            // a logarithm has nothing to fit here
            assert!(matches!(s, Status::AtBound(_) | Status::NoData), "{value}: {s:?}");
        }
    }
}

#[test]
fn weights_by_sigma_need_a_sigma() {
    let m = filled(0.1, 0.0);
    let f = fit(&Observations::from_measured(&m), &Options { weights: Weights::Sigma, ..Options::default() });
    assert_eq!((f.status, f.cells_left_out), (Status::NoData, 20));
    assert_ne!(fit(&Observations::from_measured(&m), &Options::default()).status, Status::NoData);
}

#[test]
fn enormous_values_do_not_break_anything() {
    let f = statuses(&Observations::from_measured(&filled(f32::MAX, 1.0)));
    assert_eq!(f.len(), 35);
    // too large to square even in f64
    let huge = ScatteredPoint {
        geometry: Geometry::from_degrees(10.0, 20.0, 30.0),
        value: [1e300; 3],
        sigma: None,
        flag: Flag::Measured,
    };
    let obs = Observations::from_scattered(&Scattered { points: vec![huge; 9] });
    assert_eq!(fit(&obs, &Options::default()).status, Status::NonFinite);
}

#[test]
fn one_angle_of_incidence_or_one_cell_is_fitted_as_far_as_it_goes() {
    let truth = AshikhminShirleySimplified { diffuse: [0.1; 3], specular: [0.1; 3], exponent: 50.0 };
    let grid = Grid { theta_i_deg: vec![30.0], ..Grid::sopp() };
    let f = fit(&Observations::from_measured(&Measured::sampled(grid, &truth)), &Options::default());
    assert!(f.status == Status::Converged && (f.parameters[0].value / 50.0 - 1.0).abs() < 1e-3, "{f:?}");
    let one = Grid { theta_i_deg: vec![30.0], theta_o_deg: vec![30.0], phi_deg: vec![180.0] };
    let f = fit(&Observations::from_measured(&Measured::sampled(one, &truth)), &Options::default());
    assert_ne!(f.status, Status::Converged);
    assert_eq!(f.cells_used, 1);
}

#[test]
fn filled_cells_and_cells_beyond_the_limit_stay_out_unless_asked_for() {
    let mut m = filled(0.1, 0.01);
    m.flag[3] = Flag::Filled;
    m.flag[4] = Flag::Extrapolated;
    let obs = Observations::from_measured(&m);
    let all = obs.len();
    assert_eq!(fit(&obs, &Options::default()).cells_used, all - 2);
    assert_eq!(fit(&obs, &Options { include_filled: true, ..Options::default() }).cells_used, all);
    let narrow = Options { max_angle: Angle::from_degrees(40.0), include_filled: true, ..Options::default() };
    // θi = 0 alone: the cap once and three azimuths at 30°
    assert_eq!(fit(&obs, &narrow).cells_used, 4);
}

#[test]
fn scattered_points_are_fitted_like_a_table() {
    let truth = AshikhminShirleySimplified { diffuse: [0.1, 0.2, 0.3], specular: [0.1; 3], exponent: 80.0 };
    let grid = Grid {
        theta_i_deg: vec![0.0, 20.0, 40.0, 60.0],
        theta_o_deg: (0..15).map(|k| 5.0 * f64::from(k)).collect(),
        phi_deg: (0..19).map(|k| 10.0 * f64::from(k)).collect(),
    };
    let m = Measured::sampled(grid, &truth);
    let points = (0..m.grid.len()).map(|i| {
        let [a, b, c] = m.grid.coordinates(i);
        ScatteredPoint {
            geometry: m.grid.geometry(a, b, c),
            value: m.values[i].map(f64::from),
            sigma: None,
            flag: Flag::Measured,
        }
    });
    let f = fit(&Observations::from_scattered(&Scattered { points: points.collect() }), &Options::default());
    assert!(
        f.status == Status::Converged && (f.parameters[0].value / 80.0 - 1.0).abs() < 1e-4,
        "{:?}",
        f.parameters
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn no_table_makes_a_fit_panic(values in proptest::collection::vec(prop_oneof![4 => -1.0..10.0f32, 1 => any::<f32>()], 24), sigma in prop_oneof![0.0..1.0f32, any::<f32>()], flags in proptest::collection::vec(0u8..4, 24), which in 0usize..100) {
        let mut m = filled(0.0, sigma);
        for (i, v) in values.into_iter().enumerate() {
            m.values[i] = [v, v * 0.5, 0.1];
            m.flag[i] = Flag::from_byte(flags[i]).unwrap();
        }
        let (_, model) = ModelChoice::ALL[which % ModelChoice::ALL.len()];
        let (_, weights) = Weights::ALL[which / ModelChoice::ALL.len() % Weights::ALL.len()];
        let f = fit(&Observations::from_measured(&m), &Options { model, weights, ..Options::default() });
        prop_assert!(f.model.check().is_ok(), "{:?}", f.model);
    }
}
