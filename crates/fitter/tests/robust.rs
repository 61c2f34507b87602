//! Robust losses find the paint among outliers; least squares do not.
//!
//! Node values of the simplified form with normal noise of known σ. Six of a hundred directions, seeded, are spoilt as measurements are: half of them by glints that add
//! light, half by shadows that take most of it.

use gonio_brdf::{Brdf, Flag, Grid, Meaning, Measured, models::AshikhminShirleySimplified};
use gonio_fitter::{Fit, Loss, Observations, Options, Status, Weights, fit};

mod noise;
use noise::Noise;

const TRUTH: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.1, 0.2, 0.3], specular: [0.3, 0.25, 0.2], exponent: 120.0 };

/// Noise of 2 % of the value plus 5e-4 1/sr; `spoilt`: share of the directions that are outliers.
fn table(spoilt: f64, seed: u64) -> Measured {
    let grid = Grid { theta_i_deg: (0..6).map(|k| 15.0 * f64::from(k)).collect(), ..Grid::sopp() };
    let mut m = Measured::empty(grid, Meaning::Node);
    let mut rng = Noise(seed);
    for i in 0..m.grid.len() {
        let [a, b, c] = m.grid.coordinates(i);
        let (l, v) = m.grid.geometry(a, b, c).directions();
        let f = TRUTH.eval(l, v);
        let (hit, kind, size) = (rng.uniform(), rng.uniform(), rng.uniform());
        for (c, &f) in f.iter().enumerate() {
            let sigma = (0.02 * f).hypot(5e-4);
            let mut y = f + sigma * rng.normal();
            if hit < spoilt {
                y = if kind < 0.5 { y + 0.2 + 2.0 * size } else { y * 0.3 * size };
            }
            m.values[i][c] = y as f32;
            m.sigma[i][c] = sigma as f32;
        }
        m.flag[i] = Flag::Measured;
    }
    m
}

fn fitted(m: &Measured, loss: Loss) -> Fit {
    let o = Options { weights: Weights::Sigma, loss, ..Options::default() };
    fit(&Observations::from_measured(m), &o)
}

/// Largest relative errors: of the exponent, of the colours.
fn off(f: &Fit) -> (f64, f64) {
    let value = |n: String| f.parameter(&n).unwrap().value;
    let mut colours = 0.0f64;
    for (c, n) in ["r", "g", "b"].into_iter().enumerate() {
        colours = colours.max((value(format!("diffuse_{n}")) / TRUTH.diffuse[c] - 1.0).abs());
        colours = colours.max((value(format!("specular_{n}")) / TRUTH.specular[c] - 1.0).abs());
    }
    ((value("exponent".to_owned()) / TRUTH.exponent - 1.0).abs(), colours)
}

#[test]
fn robust_losses_find_the_paint_where_squares_do_not() {
    for seed in [1, 2, 3, 4, 5] {
        let spoilt = table(0.06, seed);
        let squares = off(&fitted(&spoilt, Loss::Squares));
        assert!(squares.1 > 0.1, "{seed}: squares are off by {squares:?} alone");
        for loss in [Loss::Huber, Loss::Cauchy, Loss::Tukey] {
            let f = fitted(&spoilt, loss);
            let found = off(&f);
            assert!(
                found.0 < 0.02 && found.1 < 0.02,
                "{seed} {}: {found:?}, squares {squares:?}",
                loss.name()
            );
            assert!(f.status.is_fitted() && f.loss == loss, "{seed} {}: {:?}", loss.name(), f.status);
        }
    }
}

#[test]
fn without_outliers_robust_losses_agree_with_squares() {
    let clean = table(0.0, 11);
    let squares = fitted(&clean, Loss::Squares);
    for loss in [Loss::Huber, Loss::Cauchy, Loss::Tukey] {
        let f = fitted(&clean, loss);
        assert_eq!(f.status, Status::Converged, "{}", loss.name());
        for (a, b) in f.parameters.iter().zip(&squares.parameters) {
            // 95 % efficient: the difference is a fraction of a standard uncertainty
            let sigma = b.sigma.unwrap();
            assert!((a.value - b.value).abs() < sigma, "{} {}: {} {}", loss.name(), a.name, a.value, b.value);
        }
    }
}
