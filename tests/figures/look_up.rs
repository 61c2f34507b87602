//! Speed of look-ups against the baselines of `cargo bench -p gonio-brdf --bench look_up`, in this process.

use gonio_brdf::maps::speed::{self, Candidate};

use crate::Figure;

/// Ratios of lower quartiles over alternating rounds.
pub fn figures() -> Vec<Figure> {
    let report = speed::measure(301, 4000);
    let k0 = Candidate::FlakeMapMany(0);
    let ratio = |base, candidate| speed::ratio(&report, base, candidate);
    vec![
        Figure::within(
            "flake map K = 0 × trilinear table 19×37×36",
            ratio(Candidate::TrilinearTable, k0),
            6.0,
            f64::INFINITY,
            Some(3),
        ),
        Figure::within(
            "flake map K = 0 × colour map with trigonometry",
            ratio(Candidate::ColourMapTrigonometry, k0),
            10.0,
            f64::INFINITY,
            Some(3),
        ),
        Figure::at_most(
            "time of K = 1 over that of K = 0",
            ratio(Candidate::FlakeMapMany(1), k0),
            1.6,
            Some(3),
        ),
    ]
}
