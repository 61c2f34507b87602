//! The method of the thesis on what it was made for: data of its own model.

use gonio_brdf::{
    Flag, Grid, Measured,
    models::{AshikhminShirley, AshikhminShirleySimplified},
};
use gonio_fitter::{
    Observations, Options, Weights,
    sopp::{Ended, SoppOptions, sopp},
};

fn off(got: f64, want: f64) -> f64 {
    (got / want - 1.0).abs()
}

#[test]
fn clean_data_of_its_own_model_give_the_parameters_back() {
    let truth = AshikhminShirleySimplified {
        diffuse: [0.1, 0.2, 0.3],
        specular: [0.05, 0.06, 0.07],
        exponent: 120.0,
    };
    let obs = Observations::from_measured(&Measured::sampled(Grid::sopp(), &truth));
    for weights in [Weights::None, Weights::Sopp] {
        let options = Options { weights, ..Options::default() };
        let run = sopp(&obs, &options, &SoppOptions::default());
        assert!(run.succeeded(), "{weights:?} {:?}", run.stages);
        assert!(off(run.exponent, 120.0) < 1e-6, "{}", run.exponent);
        for c in 0..3 {
            assert!(off(run.diffuse[c], truth.diffuse[c]) < 1e-5);
            assert!(off(run.specular[c], truth.specular[c]) < 1e-5);
        }
        assert_eq!(run.stages.len(), 4);
        assert!(run.stages[0].squares.windows(2).all(|w| w[1] <= w[0]), "worse steps are dropped");
    }
}

#[test]
fn the_full_form_starts_from_the_simplified_one() {
    let truth = AshikhminShirley { diffuse: [0.2; 3], specular: [0.5; 3], exponent: 60.0, r0: 0.3 };
    let obs = Observations::from_measured(&Measured::sampled(Grid::sopp(), &truth));
    let options = Options { weights: Weights::None, ..Options::default() };
    let run = sopp(&obs, &options, &SoppOptions { r0: Some(0.1), ..SoppOptions::default() });
    assert_eq!(run.stages.len(), 5);
    assert!(run.stages[1].squares.last().unwrap() <= &run.stages[1].squares[0]);
    assert!(run.stages[1].condition_scaled > 2.0 * run.stages[0].condition_scaled, "{:?}", run.stages[1]);
}

#[test]
fn data_without_sense_end_with_a_word() {
    let black = AshikhminShirleySimplified { diffuse: [0.0; 3], specular: [0.0; 3], exponent: 1.0 };
    let mut table = Measured::sampled(Grid::sopp(), &black);
    let run = sopp(&Observations::from_measured(&table), &Options::default(), &SoppOptions::default());
    assert_eq!(run.stages.len(), 4);
    table.flag.fill(Flag::Invalid);
    let run = sopp(&Observations::from_measured(&table), &Options::default(), &SoppOptions::default());
    assert!(run.stages.is_empty() && run.cells == 0 && !run.succeeded());
    let mut huge = Measured::sampled(Grid::sopp(), &black);
    huge.values.fill([f32::MAX; 3]);
    let far = SoppOptions { exponent: f64::MAX, ..SoppOptions::default() };
    let run = sopp(&Observations::from_measured(&huge), &Options::default(), &far);
    assert!(run.stages.iter().any(|s| s.ended != Ended::Settled));
}
