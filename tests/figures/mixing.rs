//! Car paints: their flakes' statistics, how fast they become mixable and mix, and a mixture against a paint that holds both kinds of flakes.

use std::sync::Arc;
use std::time::Instant;

use gonio_brdf::Coat;
use gonio_optics::{Angle, colour::lab_from_brdf};
use gonio_paint::btf_folder::{SliceFormat, read_btf_folder, write_btf_folder};
use gonio_paint::car_paint::{ColourTable, FlakeSlices, Flakes, Through};
use gonio_paint::mixing::{Mixable, Part, Realisation};
use gonio_paint::statistics::{Cluster, FlakeStatistics, StatisticsOptions, fidelity};
use gonio_paint::transport::{Costs, Problem, Solver};
use gonio_paint::{CarPaint, CarPaintParts, FlakeBtf};
use gonio_sim::flakes::{Field, FlakePaint};

use crate::Figure;

const INDEX: f64 = 1.5;
const HALF_DEG: [f64; 6] = [0.0, 3.0, 6.0, 9.0, 12.0, 15.0];
const INCIDENCE_DEG: [f64; 6] = [5.0, 9.0, 13.0, 17.0, 21.0, 25.0];
const SIDE: usize = 128;

const SILVER: &str = "format = \"gonio-flake-paint\"\nversion = 1\nname = \"silver\"\nseed = 21\ncoat_index = 1.5\ndiffuse = [0.03, 0.04, 0.06]\n[[flakes]]\n\
    density_per_mm2 = 500.0\nsize_mm = 0.03\nsize_spread = 0.3\nspread_deg = 8.0\ndepth_mm = [0.002, 0.03]\nreflectance = [0.85, 0.86, 0.88]\n";
const COPPER: &str = "format = \"gonio-flake-paint\"\nversion = 1\nname = \"copper\"\nseed = 22\ncoat_index = 1.5\ndiffuse = [0.09, 0.03, 0.02]\n[[flakes]]\n\
    density_per_mm2 = 300.0\nsize_mm = 0.04\nsize_spread = 0.3\nspread_deg = 12.0\ndepth_mm = [0.002, 0.03]\nreflectance = [0.9, 0.5, 0.3]\n";

/// Slices of a paint of single flakes as a perfect texture camera sees them.
fn slices(paint: FlakePaint) -> FlakeBtf {
    let field = Field::new(paint).expect("sound");
    let mut texels = Vec::with_capacity(36 * SIDE * SIDE);
    for half in HALF_DEG {
        for incidence in INCIDENCE_DEG {
            let (half, incidence) = (Angle::from_degrees(half), Angle::from_degrees(incidence));
            texels.extend(field.slice(half, incidence, [0, 0], [SIDE, SIDE]));
        }
    }
    let angles = |deg: [f64; 6]| deg.map(Angle::from_degrees).to_vec();
    FlakeBtf::new(angles(HALF_DEG), angles(INCIDENCE_DEG), [SIDE, SIDE], texels).expect("sound")
}

fn paint(btf: FlakeBtf) -> Arc<CarPaint> {
    let flakes = FlakeSlices::new(Arc::new(btf), 0.02).expect("sound");
    let angles = || (0..24).map(|k| Angle::from_degrees(1.7 * f64::from(k))).collect::<Vec<_>>();
    let parts = CarPaintParts {
        coat: Some(Coat { index: INDEX }),
        colour: Some(ColourTable::new(angles(), angles(), vec![[1.0, 0.9, 0.8]; 576]).expect("sound")),
        flakes: Some(Flakes::Slices(flakes)),
        ..CarPaintParts::default()
    };
    Arc::new(CarPaint::new(parts).expect("sound"))
}

/// Distance of two distributions of boxes: the cost of exact transport between their centres, Lab units, mean over the slices.
fn distance(p: &FlakeStatistics, q: &FlakeStatistics) -> f64 {
    let mut solver = Solver::new();
    let n = p.slices();
    let one = |k: usize, solver: &mut Solver| {
        let masses =
            |s: &FlakeStatistics| s.clusters(k).iter().map(|c| f64::from(c.steps)).collect::<Vec<_>>();
        let centres = |s: &FlakeStatistics| s.clusters(k).iter().map(Cluster::centre).collect::<Vec<_>>();
        let (supply, demand, from, to) = (masses(p), masses(q), centres(p), centres(q));
        let problem =
            Problem { supply: &supply, demand: &demand, costs: Costs::Distances { from: &from, to: &to } };
        let plan = solver.solve(&problem).expect("a plan");
        assert!(plan.proof(&problem).holds(500.0));
        plan.cost(&problem) / 500.0
    };
    (0..n).map(|k| one(k, &mut solver)).sum::<f64>() / n as f64
}

/// What statistics keep of simulated flakes, and how a half-and-half mixture compares with a paint of both flakes.
pub fn figures() -> Vec<Figure> {
    let seed = 21;
    let described = |text| FlakePaint::from_toml(text).expect("readable");
    let (silver, copper) = (described(SILVER), described(COPPER));
    let both = slices(FlakePaint::mixed(&silver, &copper, 0.5).expect("a share"));
    let (silver, copper) = (slices(silver), slices(copper));
    let options = StatisticsOptions::default();
    let taken = |btf: &FlakeBtf| FlakeStatistics::of(btf, &options).expect("statistics");
    let (s, c, b) = (taken(&silver), taken(&copper), taken(&both));
    let (mut mean, mut deviation) = (0.0_f64, 0.0_f64);
    for (k, slice) in silver.slices().enumerate() {
        let lab: Vec<[f64; 3]> = slice
            .iter()
            .map(|t| {
                let lab = lab_from_brdf(t.map(f64::from));
                [lab.l, lab.a, lab.b]
            })
            .collect();
        let n = lab.len() as f64;
        for (axis, [m, d]) in s.moments(k).into_iter().enumerate() {
            let exact = lab.iter().map(|v| v[axis]).sum::<f64>() / n;
            let variance = lab.iter().map(|v| (v[axis] - exact).powi(2)).sum::<f64>() / n;
            mean = mean.max((m - exact).abs());
            if variance.sqrt() > 0.05 {
                deviation = deviation.max((d / variance.sqrt() - 1.0).abs());
            }
        }
    }
    let drawn = fidelity(&silver, &s);
    let m = Mixable::new(&[paint(silver), paint(copper)], &options).expect("mixable");
    let mut numbers = Realisation::default();
    m.realise(&[0.5, 0.5], Part::Everything, &mut numbers);
    let half = m.statistics(&numbers).expect("statistics");
    let (apart, off) = (distance(&s, &c), distance(&half, &b));
    let nearer = distance(&s, &b).min(distance(&c, &b));
    let seed = Some(seed);
    vec![
        Figure::at_most("statistics: mean of L*, a*, b*, worst slice", mean, 0.1, seed),
        Figure::at_most("statistics: standard deviation, relative, worst slice", deviation, 0.02, seed),
        Figure::at_most(
            "drawn 128 × 128: mean of L*, a*, b*, worst slice",
            drawn.largest(|s| s.mean),
            0.1,
            seed,
        ),
        Figure::at_most(
            "drawn 128 × 128: standard deviation, mean of slices",
            drawn.mean(|s| s.deviation),
            0.02,
            seed,
        ),
        Figure::within(
            "drawn: share that sparkles over the original's",
            drawn.mean(|s| s.rebuilt.density) / drawn.mean(|s| s.original.density),
            0.75,
            1.25,
            seed,
        ),
        Figure::said(
            "bytes of statistics, of textures",
            format!(
                "{} of {} (1 : {:.0})",
                drawn.bytes,
                drawn.raw_bytes,
                drawn.raw_bytes as f64 / drawn.bytes as f64
            ),
            "stated",
            seed,
            true,
        ),
        Figure::said(
            "mixture at 50 % from a paint of half of each flake, Lab",
            format!("{off:.2}; the paints lie {apart:.2} apart, the nearer one {nearer:.2} from it"),
            "nearer than both",
            seed,
            off < nearer,
        ),
    ]
}

/// Slices of noise and flakes, quick to make.
fn quick(seed: u64) -> FlakeBtf {
    let angles =
        |n: usize| (0..n).map(|k| Angle::from_degrees(40.0 * k as f64 / (n - 1) as f64)).collect::<Vec<_>>();
    let mut state = seed;
    let mut unit = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as f32 + 0.5) / (1_u64 << 31) as f32
    };
    let mut texels = Vec::with_capacity(600 * SIDE * SIDE);
    for slice in 0..600 {
        let fall = (-(slice as f32 / 150.0)).exp();
        for _ in 0..SIDE * SIDE {
            let ground = (0.02 + 0.5 * fall) * (1.0 + 0.5 * (unit() + unit() - 1.0));
            let bright = if unit() < 0.01 + 0.05 * fall { 0.3 / unit().max(0.01) } else { 0.0 };
            let tint = unit();
            texels.push([
                ground + bright,
                ground + bright * (0.6 + 0.4 * tint),
                0.3 * seed as f32 * ground + 0.5 * bright,
            ]);
        }
    }
    FlakeBtf::new(angles(24), angles(25), [SIDE, SIDE], texels).expect("sound")
}

/// From slices on disk to mixtures, in time.
pub fn speed() -> Vec<Figure> {
    let folder = tempfile::tempdir().expect("a folder");
    let folders: Vec<_> = (1..=3)
        .map(|seed| {
            let path = folder.path().join(format!("paint{seed}"));
            write_btf_folder(
                &path,
                &quick(seed),
                0.05,
                Some(INDEX),
                Through::TwoWay,
                SliceFormat::ExrHalf,
                false,
            )
            .expect("written");
            path
        })
        .collect();
    let options = StatisticsOptions::default();
    let prepared = |count: usize| {
        let begun = Instant::now();
        let paints: Vec<_> =
            folders[..count].iter().map(|f| paint(read_btf_folder(f).expect("read").btf)).collect();
        let m = Mixable::new(&paints, &options).expect("mixable");
        (begun.elapsed().as_secs_f64(), m)
    };
    let least = |count: usize| (0..5).map(|_| prepared(count).0).fold(f64::INFINITY, f64::min);
    let (two, three) = (least(2), least(3));
    let (_, m) = prepared(2);
    let mut r = Realisation::default();
    let mixtures = 300;
    let rate = (0..5)
        .map(|_| {
            let begun = Instant::now();
            for k in 0..mixtures {
                let w = f64::from(k) / f64::from(mixtures);
                m.realise(&[1.0 - w, w], Part::Everything, &mut r);
            }
            f64::from(mixtures) / begun.elapsed().as_secs_f64()
        })
        .fold(0.0, f64::max);
    vec![
        Figure::at_most("two paints from slices on disk to mixable, s", two, 1.0, Some(1)),
        Figure::at_most("three paints, s", three, 1.5, Some(1)),
        Figure::within("mixtures realised a second, one thread", rate, 2000.0, f64::INFINITY, Some(1)),
        Figure::said(
            "bytes of a mixable pair, of its textures",
            format!("{} of {}", m.bytes(), 2 * 600 * SIDE * SIDE * 12),
            "stated",
            Some(1),
            true,
        ),
    ]
}
