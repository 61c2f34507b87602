//! The radiometric calibration over instruments of one make: each with another sensor, other noise and references that are off their certificates by what these
//! say. Every number against its truth, in units of the uncertainty that is stated.

use gonio_instrument::builtin;
use gonio_tests::imperfect::{Instrument, normal, tiny, wrong};

use crate::Figure;

const SEED: u64 = 1;
const REPEATS: u64 = 40;
/// Standard deviation of the lamp from exposure to exposure, and of its monitor's readings.
const LAMP: [f64; 2] = [1e-3, 1e-4];
/// Relative standard uncertainties of the white and the black reference (their certificates).
const CERTIFIED: [f64; 2] = [5e-4, 2e-3];

fn rms(z: &[f64]) -> f64 {
    (z.iter().map(|v| v * v).sum::<f64>() / z.len().max(1) as f64).sqrt()
}

/// References drawn anew.
fn references(seed: u64) -> [f64; 2] {
    [0, 1].map(|k| 1.0 + CERTIFIED[k] * normal(1 << 40 | seed << 1 | k as u64))
}

pub fn figures() -> Vec<Figure> {
    let mut instrument = Instrument::of(tiny(), wrong(), SEED);
    instrument.lamp = LAMP;
    let mut found: Vec<(String, Vec<f64>)> = Vec::new();
    let mut add = |name: &str, z: Vec<f64>| match found.iter_mut().find(|f| f.0 == name) {
        Some(f) => f.1.extend(z),
        None => found.push((name.to_owned(), z)),
    };
    for seed in SEED..SEED + REPEATS {
        instrument.reseed(seed, references(seed));
        let c = instrument.calibrated();
        for n in instrument.compared(&c) {
            add(&n.name, vec![n.z()]);
        }
        for (tiles, name) in instrument.haze(&c).iter().zip(["red", "green", "blue"]) {
            add(
                &format!("haze {name}, tile by tile"),
                tiles.iter().map(gonio_tests::imperfect::Compared::z).collect(),
            );
        }
    }
    found
        .into_iter()
        .map(|(name, z)| {
            // of n values the r.m.s. of sound scores is uncertain by 1/√2n; three of that
            let (low, high) = if z.len() > 1000 { (0.85, 1.2) } else { (0.66, 1.34) };
            Figure::within(
                format!("{name}: z over {REPEATS} instruments, r.m.s."),
                rms(&z),
                low,
                high,
                Some(SEED),
            )
        })
        .collect()
}

/// The reference instrument once: time, memory, every number.
pub fn reference() -> Vec<Figure> {
    let d = builtin::description("reference").expect("built in").expect("readable");
    let mut instrument = Instrument::of(d, wrong(), SEED);
    instrument.lamp = LAMP;
    instrument.reseed(SEED, references(SEED));
    let c = instrument.calibrated();
    let mut out: Vec<Figure> = instrument
        .compared(&c)
        .iter()
        .map(|n| {
            let value = format!("{:.5} ± {:.5}, truth {:.5}", n.found.value, n.found.sigma, n.truth);
            Figure::said(
                format!("{} of the reference instrument", n.name),
                value,
                "within 3.5 σ",
                Some(SEED),
                n.z().abs() <= 3.5,
            )
        })
        .collect();
    out.extend(instrument.haze(&c).iter().zip(["red", "green", "blue"]).map(|(tiles, name)| {
        let z: Vec<f64> = tiles.iter().map(gonio_tests::imperfect::Compared::z).collect();
        Figure::within(
            format!("haze {name} of the reference instrument: z over its tiles, r.m.s."),
            rms(&z),
            0.8,
            1.25,
            Some(SEED),
        )
    }));
    out
}
