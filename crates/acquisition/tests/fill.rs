//! What is made up where nothing was measured: flagged, never negative, without a jump, less sure the farther from data.

use gonio_acquisition::fill::{Filling, fill, fill_by};
use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Flag, Grid, Meaning, Measured, average};
use gonio_optics::Angle;

const TRUTH: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.3, 0.2, 0.1], specular: [0.05; 3], exponent: 40.0 };

fn truth(m: &Measured, i: usize) -> [f64; 3] {
    average::cell_mean(&TRUTH, &m.grid, m.meaning, m.grid.coordinates(i), 4, 1)
}

/// Measured up to 75° at θi 0…85°, but for what `hole` names.
fn table(hole: impl Fn([usize; 3]) -> bool) -> Measured {
    let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let mut m = Measured::empty(Grid::sopp(), meaning);
    for i in 0..m.grid.len() {
        let c = m.grid.coordinates(i);
        if m.grid.theta_i_deg[c[0]] < 86.0 && m.grid.theta_o_deg[c[1]] < 75.1 && !hole(c) {
            let t = truth(&m, i);
            m.values[i] = t.map(|v| v as f32);
            m.sigma[i] = t.map(|v| (0.002 * v) as f32);
            m.flag[i] = Flag::Measured;
        }
    }
    m
}

#[test]
fn everything_is_filled_flagged_and_not_negative() {
    let lamp = |c: [usize; 3]| c[2] < 3 && (2 * c[0]).abs_diff(c[1]) <= 1;
    let mut m = table(lamp);
    let before = m.clone();
    fill(&mut m, None, 75.0);
    for i in 0..m.grid.len() {
        let c = m.grid.coordinates(i);
        let (ti, to) = (m.grid.theta_i_deg[c[0]], m.grid.theta_o_deg[c[1]]);
        assert!(m.values[i].iter().chain(&m.sigma[i]).all(|v| v.is_finite() && *v >= 0.0), "{c:?}");
        let expected = if before.flag[i] == Flag::Measured {
            assert_eq!((m.values[i], m.sigma[i]), (before.values[i], before.sigma[i]), "measured cells stay");
            Flag::Measured
        } else if to < 75.1 && ti < 86.0 {
            Flag::Filled
        } else {
            Flag::Extrapolated
        };
        assert_eq!(m.flag[i], expected, "{c:?}");
    }
}

#[test]
fn a_hole_known_by_reciprocity_takes_that_value() {
    // θi = 30° (row 6), θo = 50° (column 20): its swapped cell is θi = 50° (10), θo = 30° (12)
    let mut m = table(|c| c == [6, 20, 8]);
    fill(&mut m, None, 75.0);
    let (hole, swapped) = (m.grid.index(6, 20, 8), m.grid.index(10, 12, 8));
    assert_eq!(m.flag[hole], Flag::Filled);
    assert_eq!(m.values[hole], m.values[swapped]);
    assert!(m.sigma[hole][1] > m.sigma[swapped][1]);
}

#[test]
fn a_hole_without_a_swapped_value_is_spanned_smoothly() {
    // the retro-reflecting cells around the lamp are their own swapped ones
    let mut m = table(|c| c[2] < 3 && (2 * c[0]).abs_diff(c[1]) <= 1);
    fill(&mut m, None, 75.0);
    for ti in [4, 8, 12] {
        let i = m.grid.index(ti, 2 * ti, 0);
        let t = truth(&m, i);
        for c in [0, 1, 2] {
            let off = (f64::from(m.values[i][c]) - t[c]).abs();
            assert!(off < 0.05 * t[c] && off < 3.0 * f64::from(m.sigma[i][c]), "{ti} {c}: {off} of {}", t[c]);
        }
    }
}

#[test]
fn beyond_the_limit_there_is_no_jump_and_the_uncertainty_grows() {
    let mut m = table(|_| false);
    fill(&mut m, None, 75.0);
    // away from the lobe, where neighbours in θo differ little: a jump would show
    for phi in [0, 10, 20] {
        // rows at which reciprocity does not reach beyond the limit
        for ti in [16, 17] {
            let at = |to: usize| m.grid.index(ti, to, phi);
            let (edge, next) = (m.values[at(30)][1], m.values[at(31)][1]);
            assert!((next / edge - 1.0).abs() < 0.25, "{ti} {phi}: {edge} {next}");
            let relative = |to: usize| m.sigma[at(to)][1] / m.values[at(to)][1];
            assert!(relative(30) < relative(31) && relative(31) < relative(36), "{ti} {phi}");
        }
    }
    // and where it does, the value beyond the limit is the swapped one
    let (beyond, swapped) = (m.grid.index(4, 32, 12), m.grid.index(16, 8, 12));
    assert_eq!(m.values[beyond], m.values[swapped]);
    assert_eq!(m.flag[beyond], Flag::Extrapolated);
}

#[test]
fn a_table_without_measurements_stays_empty() {
    let mut m = table(|_| true);
    fill(&mut m, None, 75.0);
    assert!(m.flag.iter().all(|f| *f == Flag::Invalid));
}

#[test]
fn reciprocity_stands_in_only_where_the_measured_cells_keep_it() {
    // the light's own row and the view's, nothing between 30° and 40° of the one is known
    let hole = |c: [usize; 3]| (12..=15).contains(&c[1]) && c[0] > 8;
    let mut m = table(hole);
    assert_eq!(fill(&mut m, None, 75.0), Filling::BARE);
    let worst = |m: &Measured, factor: &dyn Fn([usize; 3]) -> f64| {
        (0..m.grid.len())
            .filter(|&i| m.flag[i] == Flag::Filled && m.grid.coordinates(i)[0] < 16)
            .map(|i| {
                let wanted = truth(m, i)[1] * factor(m.grid.coordinates(i));
                (f64::from(m.values[i][1]) / wanted - 1.0).abs()
            })
            .fold(0.0, f64::max)
    };
    let kept = worst(&m, &|_| 1.0);
    // the lower light shows more than it does the other way round, by up to three quarters
    let skew = |c: [usize; 3]| (0.0075 * (5.0 * c[0] as f64 - 2.5 * c[1] as f64)).exp();
    let mut skewed = table(hole);
    for i in 0..skewed.grid.len() {
        let f = skew(skewed.grid.coordinates(i)) as f32;
        skewed.values[i] = skewed.values[i].map(|v| v * f);
    }
    let mut forced = skewed.clone();
    let done = fill(&mut skewed, None, 75.0);
    assert!(!done.holes.reciprocity && !done.rim.reciprocity && done.holes.flake_space, "{done}");
    fill_by(&mut forced, None, 75.0, Filling::BARE).unwrap();
    let (guarded, forced) = (worst(&skewed, &skew), worst(&forced, &skew));
    assert!(kept < 0.1 && guarded < 0.3 * forced, "{kept} {guarded} {forced}");
}

#[test]
fn a_hole_in_a_slope_goes_on_as_the_slope_does() {
    // log f linear in θo across a hole that a membrane would fill with a step at its middle
    let mut m = table(|c| (10..=14).contains(&c[1]) && c[2] < 9);
    let wanted = |c: [usize; 3]| (0.3 - 0.04 * c[1] as f64).exp();
    for i in 0..m.grid.len() {
        if m.flag[i] == Flag::Measured {
            m.values[i] = [wanted(m.grid.coordinates(i)) as f32; 3];
        }
    }
    fill_by(&mut m, None, 75.0, Filling::PLAIN).unwrap();
    for i in (0..m.grid.len()).filter(|&i| m.flag[i] == Flag::Filled) {
        let (have, want) = (f64::from(m.values[i][0]), wanted(m.grid.coordinates(i)));
        assert!((have / want - 1.0).abs() < 0.02, "{:?}: {have} {want}", m.grid.coordinates(i));
    }
}
