//! What a look-up costs: flake maps against the named baselines `trilinear-table` (19×37×36, as an ordinary renderer writes it) and
//! `colour-map-trigonometry` (Kirchner's map reached by his equations 1–7 as printed, with inverse functions).
//!
//! `cargo bench -p gonio-brdf --bench look_up` prints ns per evaluation, single thread, RGB in f32, random directions given as vectors, and the ratio
//! of lower quartiles to both baselines; rounds of all candidates alternate, so that what else the machine does falls on all of them.
#![allow(missing_docs, clippy::print_stdout)]

use gonio_brdf::maps::speed::{self, Candidate};

fn main() {
    let report = speed::measure(301, 4_000);
    println!(
        "{:<34} {:>8} {:>8} {:>8} {:>10} {:>10} {:>9}",
        "", "median", "quartile", "least", "× table", "× trig.", "bytes"
    );
    for (candidate, time) in &report {
        let ratio = |base: Candidate| speed::ratio(&report, base, *candidate);
        println!(
            "{:<34} {:>5.1} ns {:>5.1} ns {:>5.1} ns {:>10.2} {:>10.2} {:>9}",
            candidate.name(),
            time.median_ns,
            time.quartile_ns,
            time.least_ns,
            ratio(Candidate::TrilinearTable),
            ratio(Candidate::ColourMapTrigonometry),
            time.bytes,
        );
    }
}
