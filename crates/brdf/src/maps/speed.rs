//! The time of a look-up against two named baselines, measured in one process: for the benchmark, the figures and the trade.
//!
//! Random directions over the hemisphere to 89°, given as unit vectors in no order, RGB in f32, one thread. Rounds of all candidates alternate and
//! medians are compared, so that what else the machine does falls on all of them.

use std::hint::black_box;
use std::time::Instant;

use gonio_optics::{Angle, Vec3, isoline::Method};

use super::{
    ColourMap, FlakeFitOptions, FlakeMap, LookupTable, Region, Setting, trigonometric_map::TrigonometricMap,
};
use crate::{Brdf, Rgb};

/// What is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidate {
    /// 19×37×36 nodes over (θi, θo, φ), one evaluation after the other.
    TrilinearTable,
    /// Kirchner's map by his equations as printed, one evaluation after the other.
    ColourMapTrigonometry,
    /// Kirchner's map in the form without trigonometry, one evaluation after the other.
    ColourMap,
    /// A flake map with this many harmonics, one evaluation after the other.
    FlakeMap(usize),
    /// The same, many evaluations in one call.
    FlakeMapMany(usize),
}

impl Candidate {
    /// In words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::TrilinearTable => "trilinear-table".to_owned(),
            Self::ColourMapTrigonometry => "colour-map-trigonometry".to_owned(),
            Self::ColourMap => "colour-map".to_owned(),
            Self::FlakeMap(k) => format!("flake-map K = {k}, one at a time"),
            Self::FlakeMapMany(k) => format!("flake-map K = {k}, many at a time"),
        }
    }
}

/// A candidate's time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time {
    /// Median over rounds, ns per evaluation.
    pub median_ns: f64,
    /// Least over rounds, ns per evaluation.
    pub least_ns: f64,
    /// Bytes of the table.
    pub bytes: usize,
}

/// A smooth lobe with a colour that shifts: no look-up's time depends on what it holds.
struct Lobe;

impl Brdf for Lobe {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let h = (light + view).normalized();
        let (tilt, inc) = (1.0 - h.z * h.z, 1.0 - h.dot(light).powi(2));
        [0.0, 0.4, 0.8].map(|c| 0.05 + (-6.0 * tilt).exp() * (0.4 + c * inc))
    }
}

type Run<'a> = Box<dyn FnMut(&[[f32; 3]], &[[f32; 3]], &mut [[f32; 3]]) + 'a>;

/// Times all candidates over `rounds` rounds of `count` directions; empty where a map cannot be made.
#[must_use]
pub fn measure(rounds: usize, count: usize) -> Vec<(Candidate, Time)> {
    let everywhere = Region { largest: Angle::from_degrees(89.0), from_mirror: Angle::ZERO };
    let single = |d: Vec3| d.to_array().map(|x| x as f32);
    let (light, view): (Vec<_>, Vec<_>) =
        everywhere.directions(count, 3).map(|(l, v)| (single(l), single(v))).unzip();
    let largest = Region::default().largest;
    let table = LookupTable::from_brdf(&Lobe, [19, 37, 36]);
    let trigonometric = TrigonometricMap::from_brdf(&Lobe, 1.5, largest, 128);
    let colour = ColourMap::from_brdf(&Lobe, 1.5, Method::Clip, largest, 128);
    let samples = Region::default().of_brdf(&Lobe, 2000, 0);
    let options = |harmonics| FlakeFitOptions {
        harmonics,
        smoothness: Setting::Fixed(1e-3),
        edge: Setting::Fixed(0.1),
        ..FlakeFitOptions::default()
    };
    let maps: Vec<FlakeMap> =
        (0..=3).filter_map(|k| FlakeMap::fit("speed", &samples, &options(k)).ok()).collect();
    // one at a time: each result is kept, as a renderer keeps it
    fn each<'a>(f: impl Fn([f32; 3], [f32; 3]) -> [f32; 3] + 'a) -> Run<'a> {
        Box::new(move |light, view, out| {
            for ((l, v), o) in light.iter().zip(view).zip(out) {
                *o = f(*l, *v);
            }
        })
    }
    let mut runs: Vec<(Candidate, usize, Run<'_>)> = vec![
        (Candidate::TrilinearTable, table.bytes(), each(|l, v| table.eval_single(l, v))),
        (
            Candidate::ColourMapTrigonometry,
            trigonometric.bytes(),
            each(|l, v| trigonometric.eval_single(l, v)),
        ),
        (Candidate::ColourMap, colour.bytes(), each(|l, v| colour.eval_single(l, v))),
    ];
    for map in &maps {
        let k = map.harmonics();
        runs.push((Candidate::FlakeMap(k), map.bytes(), each(|l, v| map.eval_single(l, v))));
        runs.push((Candidate::FlakeMapMany(k), map.bytes(), Box::new(|l, v, o| map.eval_many(l, v, o))));
    }
    let mut times = vec![Vec::with_capacity(rounds); runs.len()];
    let mut out = vec![[0.0; 3]; count];
    for _ in 0..rounds.max(1) {
        for ((_, _, run), times) in runs.iter_mut().zip(&mut times) {
            // once untimed: the candidates before have had the caches, and a large table must not pay for that
            run(black_box(&light), black_box(&view), black_box(&mut out));
            let start = Instant::now();
            run(black_box(&light), black_box(&view), black_box(&mut out));
            times.push(start.elapsed().as_secs_f64() * 1e9 / count.max(1) as f64);
        }
    }
    let of = |mut t: Vec<f64>, bytes: usize| {
        t.sort_by(f64::total_cmp);
        Time { median_ns: t[t.len() / 2], least_ns: t[0], bytes }
    };
    runs.iter().zip(times).map(|((c, bytes, _), t)| (*c, of(t, *bytes))).collect()
}

/// How many times as fast as `base` a candidate is, by medians; NaN where either was not measured.
#[must_use]
pub fn ratio(report: &[(Candidate, Time)], base: Candidate, candidate: Candidate) -> f64 {
    let median = |c: Candidate| report.iter().find(|r| r.0 == c).map_or(f64::NAN, |r| r.1.median_ns);
    median(base) / median(candidate)
}
