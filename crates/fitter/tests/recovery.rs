//! Parameters come back from tables of cell means with noise; the stated uncertainties are true.
//!
//! The tables are made by a plain product rule over bin and lamp ([`gonio_brdf::average::cell_mean`]), not by the routine the fit uses.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};

mod noise;
use noise::Noise;

use gonio_brdf::{Flag, Grid, Meaning, Measured, average::cell_mean, models::AshikhminShirleySimplified};
use gonio_fitter::{Fit, ModelChoice, Observations, Options, Status, Weights, fit};
use gonio_optics::Angle;
use rayon::prelude::*;

/// Sopp's grid with every third angle of incidence: enough rows, a quick test.
fn grid() -> Grid {
    Grid { theta_i_deg: (0..6).map(|k| 15.0 * f64::from(k)).collect(), ..Grid::sopp() }
}

const LAMP: Meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };

/// Means of the lobe for cs = 1, kept per exponent.
fn lobe_means(exponent: f64) -> Vec<f64> {
    static MADE: OnceLock<Mutex<HashMap<u64, Vec<f64>>>> = OnceLock::new();
    let mut made = MADE.get_or_init(Mutex::default).lock().unwrap();
    made.entry(exponent.to_bits())
        .or_insert_with(|| {
            let grid = grid();
            let lobe = AshikhminShirleySimplified { diffuse: [0.0; 3], specular: [1.0; 3], exponent };
            (0..grid.len())
                .into_par_iter()
                .map(|i| {
                    let cell = grid.coordinates(i);
                    let g = grid.geometry(cell[0], cell[1], cell[2]);
                    // many nodes where the lobe is, few where it is nothing
                    let (l, v) = g.directions();
                    let near = (l + v).normalized().angle_to(gonio_optics::Vec3::Z).radians()
                        * exponent.sqrt()
                        < 9.0;
                    let (n, rings) = if near { (16, 4) } else { (3, 1) };
                    cell_mean(&lobe, &grid, LAMP, cell, n, rings)[0]
                })
                .collect()
        })
        .clone()
}

/// A table with noise of `relative` of the value plus `floor` in 1/sr, σ stated.
fn table(
    diffuse: [f64; 3],
    specular: [f64; 3],
    exponent: f64,
    relative: f64,
    floor: f64,
    seed: u64,
) -> Measured {
    let mut m = Measured::empty(grid(), LAMP);
    let mut noise = Noise(seed);
    for (i, lobe) in lobe_means(exponent).into_iter().enumerate() {
        for c in 0..3 {
            let f = diffuse[c] * std::f64::consts::FRAC_1_PI + specular[c] * lobe;
            let sigma = (relative * f).hypot(floor);
            m.values[i][c] = (f + sigma * noise.normal()) as f32;
            m.sigma[i][c] = sigma as f32;
        }
        m.flag[i] = Flag::Measured;
    }
    m
}

fn with(weights: Weights) -> Options {
    Options { weights, ..Options::default() }
}

fn value(f: &Fit, name: &str) -> f64 {
    f.parameter(name).unwrap().value
}

const NAMES: [&str; 3] = ["r", "g", "b"];

#[test]
fn parameters_are_recovered_from_noisy_cell_means() {
    for exponent in [21.0, 120.0, 410.0, 1300.0] {
        let (cd, cs) = ([0.03, 0.2, 0.5], [0.01, 0.1, 0.4]);
        let m = table(cd, cs, exponent, 0.02, 1e-4, 7);
        for (name, weights) in Weights::ALL {
            let f = fit(&Observations::from_measured(&m), &with(weights));
            assert_eq!(f.status, Status::Converged, "{name}");
            let n = value(&f, "exponent");
            assert!((n / exponent - 1.0).abs() < 0.02, "{name} {exponent}: {n}");
            for c in 0..3 {
                let (d, s) = (
                    value(&f, &format!("diffuse_{}", NAMES[c])),
                    value(&f, &format!("specular_{}", NAMES[c])),
                );
                assert!((s / cs[c] - 1.0).abs() < 0.03, "{name} {exponent} cs {}: {s}", cs[c]);
                assert!((d / cd[c] - 1.0).abs() < 0.01, "{name} {exponent} cd {}: {d}", cd[c]);
            }
        }
    }
}

#[test]
fn without_noise_the_truth_comes_back() {
    for exponent in [21.0, 410.0, 1300.0] {
        let m = table([0.1; 3], [0.1; 3], exponent, 0.0, 0.0, 1);
        let f = fit(&Observations::from_measured(&m), &Options::default());
        let n = value(&f, "exponent");
        assert!((n / exponent - 1.0).abs() < 1e-3, "{exponent}: {n}");
        assert!(
            (value(&f, "diffuse_g") - 0.1).abs() < 1e-4 && f.delta_e.all.unwrap().max < 0.05,
            "{:?}",
            f.delta_e
        );
    }
}

#[test]
fn fitting_cell_means_as_node_values_would_be_wrong() {
    for (exponent, at_least) in [(120.0, 0.03), (1300.0, 0.1)] {
        let mut m = table([0.1; 3], [0.1; 3], exponent, 0.0, 0.0, 1);
        m.meaning = Meaning::Node;
        let n = value(&fit(&Observations::from_measured(&m), &Options::default()), "exponent");
        assert!((n / exponent - 1.0).abs() > at_least, "{exponent}: {n}");
    }
}

#[test]
fn hard_pairs_lie_inside_the_stated_intervals() {
    let mut outside = 0;
    let mut total = 0;
    for exponent in [21.0, 120.0, 410.0, 1300.0] {
        for (cd, cs) in [(0.5, 0.001), (0.005, 0.4)] {
            for seed in 0..4 {
                let m = table([cd; 3], [cs; 3], exponent, 0.02, 1e-4, 100 + seed);
                for weights in [Weights::Ngan, Weights::Sigma] {
                    let f = fit(&Observations::from_measured(&m), &with(weights));
                    for (name, truth) in [("exponent", exponent), ("diffuse_g", cd), ("specular_g", cs)] {
                        let (low, high) = f.interval(name, 2.0).unwrap();
                        total += 1;
                        outside += usize::from(!(low..=high).contains(&truth));
                        let (low, high) = f.interval(name, 4.0).unwrap();
                        assert!(
                            (low..=high).contains(&truth),
                            "{name} {truth} not in {low}…{high} ({cd}, {cs}, {seed})"
                        );
                    }
                }
            }
        }
    }
    // two standard uncertainties hold the truth 95 times of 100
    assert!(outside * 100 <= total * 10, "{outside} of {total} outside");
}

#[test]
fn the_covariance_is_that_of_repeated_measurements() {
    for weights in [Weights::Sigma, Weights::Ngan, Weights::None] {
        let truth = [120.0, 0.1, 0.2, 0.3, 0.05, 0.04, 0.03];
        let repeats = 60;
        let chi: Vec<f64> = (0..repeats)
            .map(|seed| {
                let m = table([0.1, 0.2, 0.3], [0.05, 0.04, 0.03], 120.0, 0.03, 1e-3, 1000 + seed);
                let f = fit(&Observations::from_measured(&m), &with(weights));
                let d = nalgebra::DVector::from_iterator(
                    7,
                    f.parameters.iter().zip(truth).map(|(p, t)| p.value - t),
                );
                let cov = nalgebra::DMatrix::from_fn(7, 7, |i, j| f.covariance[i][j]);
                // scaled, so that the inverse keeps its digits
                let s = cov.map_diagonal(|v| v.sqrt().recip());
                let scaled = nalgebra::DMatrix::from_fn(7, 7, |i, j| cov[(i, j)] * s[i] * s[j]);
                let x = d.component_mul(&s);
                x.dot(&scaled.lu().solve(&x).unwrap())
            })
            .collect();
        let mean = chi.iter().sum::<f64>() / repeats as f64;
        // χ² of 7 degrees of freedom: mean 7, standard deviation of the mean of 60 √(14/60) = 0.48
        assert!((5.5..8.5).contains(&mean), "{}: mean chi-square {mean}", weights.name());
    }
}

#[test]
fn a_common_uncertainty_widens_cd_and_cs_and_leaves_the_exponent() {
    let mut m = table([0.2; 3], [0.1; 3], 120.0, 0.01, 1e-4, 3);
    let narrow = fit(&Observations::from_measured(&m), &Options::default());
    m.attributes.insert("common_relative_uncertainty".into(), "0.015".into());
    let wide = fit(&Observations::from_measured(&m), &Options::default());
    let sigma = |f: &Fit, n: &str| f.parameter(n).unwrap().sigma.unwrap();
    assert_eq!(sigma(&narrow, "exponent"), sigma(&wide, "exponent"));
    let want = sigma(&narrow, "diffuse_r").hypot(0.015 * value(&wide, "diffuse_r"));
    assert!((sigma(&wide, "diffuse_r") / want - 1.0).abs() < 1e-9);
    // a table that is 1.5 % too bright as a whole stays inside its interval
    for v in &mut m.values {
        *v = v.map(|x| x * 1.015);
    }
    let f = fit(&Observations::from_measured(&m), &Options::default());
    let (low, high) = f.interval("diffuse_g", 2.0).unwrap();
    assert!((low..=high).contains(&0.2), "{low} {high}");
}

#[test]
fn a_fit_after_each_pose_sees_more_and_more() {
    let whole = table([0.1; 3], [0.1; 3], 120.0, 0.02, 1e-4, 5);
    let mut m = Measured::empty(whole.grid.clone(), whole.meaning);
    let per_row = m.grid.len() / 6;
    let mut used = 0;
    for ti in 0..6 {
        let rows = ti * per_row..(ti + 1) * per_row;
        m.values[rows.clone()].copy_from_slice(&whole.values[rows.clone()]);
        m.sigma[rows.clone()].copy_from_slice(&whole.sigma[rows.clone()]);
        m.flag[rows].fill(Flag::Measured);
        let f = fit(&Observations::from_measured(&m), &Options::default());
        assert!(f.cells_used > used);
        used = f.cells_used;
        assert!(
            (value(&f, "exponent") / 120.0 - 1.0).abs() < 0.05,
            "after {} rows: {:?}",
            ti + 1,
            f.parameters
        );
    }
    let once = fit(&Observations::from_measured(&whole), &Options::default());
    let last = fit(&Observations::from_measured(&m), &Options::default());
    assert_eq!(once.parameters, last.parameters);
}

#[test]
fn r0_is_found_where_the_data_hold_it() {
    use gonio_brdf::models::{AshikhminShirley, LambertAshikhminShirley};
    let full = AshikhminShirley { diffuse: [0.3, 0.2, 0.1], specular: [0.5; 3], exponent: 150.0, r0: 0.05 };
    let plain = LambertAshikhminShirley {
        diffuse: [0.3, 0.2, 0.1],
        specular: [0.5; 3],
        exponent: 150.0,
        r0: Some(0.05),
    };
    for (choice, m) in [
        (ModelChoice::AshikhminShirley, Measured::sampled(grid(), &full)),
        (ModelChoice::LambertAshikhminShirley, Measured::sampled(grid(), &plain)),
    ] {
        let f = fit(&Observations::from_measured(&m), &Options { model: choice, ..Options::default() });
        for (name, truth) in [("exponent", 150.0), ("r0", 0.05), ("diffuse_r", 0.3), ("specular_b", 0.5)] {
            let v = value(&f, name);
            assert!((v / truth - 1.0).abs() < 1e-3, "{choice:?} {name}: {v}");
        }
        assert_eq!(f.status, Status::Converged);
    }
}

#[test]
fn auto_takes_lambert_where_there_is_no_lobe() {
    let options = Options { model: ModelChoice::Auto, ..Options::default() };
    let matte = table([0.4; 3], [0.0; 3], 120.0, 0.01, 1e-3, 11);
    assert_eq!(fit(&Observations::from_measured(&matte), &options).model.name(), "lambert");
    let glossy = table([0.4; 3], [0.05; 3], 120.0, 0.01, 1e-3, 11);
    assert_eq!(
        fit(&Observations::from_measured(&glossy), &options).model.name(),
        "ashikhmin-shirley-simplified"
    );
}
