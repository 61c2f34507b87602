//! Flake maps from a scan: measured effect coatings on the virtual instrument, its noise and its holes included. Needs `GONIO_DATA`.
//!
//! The truth of the virtual sample is a table of a MERL network at 2.5° by 2.5° by 5°, linear between nodes, and is what is judged.

use gonio_brdf::Brdf;
use gonio_brdf::formats::{self, Loaded, Target};
use gonio_brdf::maps::{ColourMap, FlakeFitOptions, FlakeMap, Region, Sample, colour_map};
use gonio_brdf::{Grid, Measured};
use gonio_optics::isoline::Method;
use gonio_tests::real_data;

use crate::maps::{mean_error, network, open, ratios};
use crate::{Figure, scans};

const SEED: u64 = 1;
const PAINTS: [&str; 2] = ["color-changing-paint2", "green-metallic-paint"];
const JUDGED: usize = 5000;

/// All figures of scanned flake maps.
pub fn figures() -> Vec<Figure> {
    let Some(data) = real_data("figures of flake maps from a scan") else {
        return vec![Figure::said(
            "flake maps of a scan",
            "GONIO_DATA is unset: did not run",
            "-",
            None,
            true,
        )];
    };
    let by = |step: f64, to: f64| (0..=(to / step) as u32).map(|k| step * f64::from(k)).collect();
    let grid = Grid { theta_i_deg: by(2.5, 90.0), theta_o_deg: by(2.5, 90.0), phi_deg: by(5.0, 180.0) };
    let region = Region::default();
    let (mut direct, mut scanned, mut k) = (0.0, 0.0, [0.0; 3]);
    let share = 1.0 / PAINTS.len() as f64;
    for name in PAINTS {
        let loaded = open(&data, &network(name));
        let truth = Measured::sampled(grid.clone(), loaded.as_brdf().expect("a network has values"));
        let file = scans::path(&format!("{name}.truth.nc"));
        let saved = formats::save(&file, &Loaded::Table(Box::new(truth.clone())), Target::Netcdf, true);
        assert!(saved.expect("written").losses.is_empty());
        let (session, _) = scans::record_file(&format!("flake-{name}"), &file, SEED);
        let table = match formats::open(&session.with_extension("nc")) {
            Ok(Loaded::Table(t)) => *t,
            other => panic!("{name}: no table: {other:?}"),
        };
        let _ = std::fs::remove_file(&session);
        let judged = region.of_brdf(&truth, JUDGED, 1);
        let by_clip = |s: &Sample| colour_map::at_equivalent(&truth, s, 1.5, Method::Clip, region.largest);
        direct += share * mean_error(&judged, by_clip);
        let map = ColourMap::from_brdf(&table, 1.5, Method::Clip, region.largest, 128);
        scanned += share * mean_error(&judged, |s| map.eval(s.light, s.view));
        for (harmonics, sum) in k.iter_mut().enumerate() {
            let options = FlakeFitOptions { harmonics, ..FlakeFitOptions::default() };
            let map = FlakeMap::fit_table(name, &table, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
            *sum += share * mean_error(&judged, |s| map.eval(s.light, s.view));
        }
    }
    let mut out = Vec::new();
    let note = format!(" (A of the scan {scanned:.2})");
    ratios(&mut out, "a scan of the virtual instrument, 2 networks", direct, k, &note);
    out
}
