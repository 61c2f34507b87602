//! The part of σ that many cells share, over repeats with the white reference and the lamp's readings drawn anew.

use crate::Figure;
use crate::bench_scan::{BenchScan, OnHolder};
use crate::noise::Noise;
use gonio_acquisition::Options;
use gonio_brdf::{Flag, Measured};
use gonio_instrument::{Certificate, Description, Misalignment, builtin};
use rayon::prelude::*;

const SEED: u64 = 1;
const REPEATS: u64 = 500;
/// Reflectance of the sample, a perfect diffuser by the law.
const REFLECTANCE: f64 = 0.5;
/// Angles of incidence, degrees, and spins of each: as many poses as it takes to know the scatter of the lamp's readings.
const TILTS: [f64; 5] = [15.0, 20.0, 25.0, 30.0, 35.0];
const SPINS: u32 = 24;
/// The row that is looked at.
const ROW_DEG: f64 = 25.0;

/// Value and relative size of the part of σ that cells share, cell by cell and channel by channel of one row.
fn row(table: &Measured) -> Vec<[f64; 2]> {
    let mut out = Vec::new();
    for i in (0..table.grid.len()).filter(|&i| table.flag[i] == Flag::Measured) {
        let [ti, to, phi] = table.grid.coordinates(i);
        if (table.grid.theta_i_deg[ti] - ROW_DEG).abs() > 0.1 || (to == 0 && phi > 0) {
            continue;
        }
        for c in 0..3 {
            let f = f64::from(table.values[i][c]);
            let parts = ["certificate", "lamp"].iter().filter_map(|p| table.sigma_parts.get(*p));
            let shared: f64 = parts.map(|p| (f64::from(p[i][c]) / f).powi(2)).sum();
            out.push([f, shared.sqrt()]);
        }
    }
    out
}

/// A quiet bench whose lamp readings scatter by `monitor_noise` from pose to pose.
fn bench(d: &Description, monitor_noise: f64) -> BenchScan {
    let mut bench = BenchScan::new(d, &Misalignment::default(), SEED);
    (bench.monitor_noise, bench.quiet) = (monitor_noise, true);
    bench
}

/// z of the common part of every cell for readings that scatter by `monitor_noise` from pose to pose. Frames are without noise: the pixels' own has figures of
/// its own.
fn scores(monitor_noise: f64) -> Vec<f64> {
    let d = builtin::description("tiny").expect("built in").expect("readable");
    let certificate = Certificate::virtual_white().relative_uncertainty;
    let spins: Vec<f64> = (0..SPINS).map(|k| 360.0 / f64::from(SPINS) * f64::from(k)).collect();
    // for a white reference of this reflectance
    let one = |bench: &mut BenchScan, reflectance: f64| {
        let white = bench.white_of(&OnHolder::Diffuser(reflectance, 1), &TILTS);
        let sample = OnHolder::Diffuser(REFLECTANCE, 2);
        row(&bench
            .table_of(&white, &sample, [&TILTS, &spins], Options { fill: false, ..Options::default() })
            .0)
    };
    // what remains without any error to draw: how the grid and the quadrature see the truth
    let none = one(&mut bench(&d, 0.0), 0.98);
    (0..REPEATS)
        .into_par_iter()
        .map_init(
            || bench(&d, monitor_noise),
            |bench, repeat| {
                bench.reseed(SEED + repeat);
                let drawn = Noise::new(u64::MAX - repeat).normal();
                let cells = one(bench, 0.98 * (1.0 + certificate * drawn));
                assert_eq!(cells.len(), none.len(), "the same cells each time");
                cells
                    .iter()
                    .zip(&none)
                    .map(|([f, sigma], [right, _])| (f / right - 1.0) / sigma)
                    .collect::<Vec<_>>()
            },
        )
        .flatten()
        .collect()
}

pub fn figures() -> Vec<Figure> {
    let mut out = Vec::new();
    for (name, monitor_noise) in [("certificate", 1e-4), ("lamp readings off by 0.2 %", 2e-3)] {
        let z = scores(monitor_noise);
        let n = z.len() as f64;
        let rms = (z.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
        let held = z.iter().filter(|v| v.abs() <= 1.959_964).count() as f64 / n;
        out.push(Figure::within(
            format!("common part, {name}: z of its cells over {REPEATS} repeats, r.m.s."),
            rms,
            0.95,
            1.05,
            Some(SEED),
        ));
        out.push(Figure::within(
            format!("common part, {name}: 95 % intervals that hold"),
            held,
            0.93,
            0.97,
            Some(SEED),
        ));
    }
    out
}
