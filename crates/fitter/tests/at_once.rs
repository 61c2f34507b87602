//! Many fits at once, as a batch makes them: what they share is made once and nobody waits for itself.

use std::sync::mpsc;
use std::time::Duration;

use gonio_brdf::{Brdf, Grid, Meaning, models::AshikhminShirleySimplified};
use gonio_fitter::{ModelChoice, Observations, Options, fit};
use gonio_optics::Angle;
use rayon::prelude::*;

/// A grid that no other test has asked for, so that its cells are new to every fit.
fn grid(of: u32) -> Grid {
    Grid {
        theta_i_deg: (0..4).map(|k| f64::from(of) * 0.125 + 15.0 * f64::from(k)).collect(),
        theta_o_deg: (0..15).map(|k| 5.0 * f64::from(k)).collect(),
        phi_deg: (0..19).map(|k| 10.0 * f64::from(k)).collect(),
    }
}

fn observations(grid: &Grid, exponent: f64) -> Observations {
    let truth = AshikhminShirleySimplified { diffuse: [0.1; 3], specular: [0.1; 3], exponent };
    let values: Vec<[f64; 3]> = (0..grid.len())
        .map(|i| {
            let [a, b, c] = grid.coordinates(i);
            let (l, v) = grid.geometry(a, b, c).directions();
            truth.eval(l, v)
        })
        .collect();
    let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    Observations::from_grid_values(grid, meaning, &values)
}

#[test]
fn many_fits_of_one_new_grid_end() {
    let (done, wait) = mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("four threads");
        let fitted: usize = pool.install(|| {
            (0..6)
                .map(|of| {
                    let grid = grid(of);
                    (0..12u32)
                        .into_par_iter()
                        .filter(|k| {
                            let model = if k % 4 == 3 { ModelChoice::Ggx(1) } else { ModelChoice::default() };
                            let obs = observations(&grid, 20.0 + 10.0 * f64::from(*k));
                            fit(&obs, &Options { model, ..Options::default() }).status.is_fitted()
                        })
                        .count()
                })
                .sum()
        });
        done.send(fitted)
    });
    let fitted = wait.recv_timeout(Duration::from_secs(240));
    assert_eq!(fitted, Ok(72), "fits that share a grid wait for each other");
}
