//! The trade as a mean over several materials: the tables of `docs/effect-coatings.md`.
//!
//! `cargo run --release -p gonio-tailor --example over_materials -- FILE…` (FILE#NAME for a network): one line a representation, CIEDE2000 as mean over the
//! materials of their mean, 95th percentile and maximum, and of the times the median.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::path::Path;

use gonio_brdf::formats;
use gonio_tailor::{GeometrySet, Material, Options, Representation, TradeOptions, trade};

/// Figures of one representation, one entry a material.
#[derive(Default)]
struct Row {
    ns: Vec<f64>,
    bytes: usize,
    /// Mean, 95th percentile and maximum beyond 15°, mean within.
    difference: Vec<[f64; 4]>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let order: Vec<String> = Representation::all().map(|r| r.to_string()).collect();
    let mut rows: BTreeMap<String, Row> = BTreeMap::new();
    let mut beyond = Vec::new();
    for file in &files {
        let material = Material::new(file.clone(), formats::open(Path::new(file))?);
        let options = TradeOptions {
            build: Options::new(material.stated_index().unwrap_or(1.5)),
            candidates: Representation::all().collect(),
            geometries: GeometrySet::All,
        };
        let found = trade(&material, &options)?;
        println!(
            "{file}: {} geometries, {:.1} % beyond the critical angle",
            found.geometries,
            100.0 * found.beyond_critical
        );
        for f in &found.findings {
            println!("  {f}");
        }
        for l in &found.left_out {
            println!("  left out: {}: {}", l.representation, l.reason);
        }
        beyond.push(found.beyond_critical);
        for c in found.candidates {
            let row = rows.entry(c.representation.to_string()).or_default();
            row.ns.push(c.cost.median_ns);
            row.bytes = c.bytes;
            let within = c.difference.within_15_deg.map_or(f64::NAN, |s| s.mean);
            if let Some(s) = c.difference.beyond_15_deg {
                row.difference.push([s.mean, s.p95, s.max, within]);
            }
        }
    }
    println!("\n{} materials, {:.1} % beyond the critical angle", files.len(), 100.0 * mean(&beyond));
    println!(
        "| representation | ns | bytes | mean ΔE beyond 15° | 95 % | max | mean within 15° | materials |\n|---|---|---|---|---|---|---|---|"
    );
    for name in order {
        let Some(row) = rows.get_mut(&name) else { continue };
        row.ns.sort_by(f64::total_cmp);
        let of = |k: usize| mean(&row.difference.iter().map(|d| d[k]).collect::<Vec<_>>());
        println!(
            "| `{name}` | {:.1} | {} | {:.2} | {:.2} | {:.1} | {:.2} | {} |",
            row.ns[row.ns.len() / 2],
            row.bytes,
            of(0),
            of(1),
            of(2),
            of(3),
            row.difference.len()
        );
    }
    Ok(())
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}
