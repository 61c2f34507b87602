//! Coated samples: the coat is found by its gloss, its index from Fresnel's curve, the base underneath as it is without a coat; samples
//! without a coat are left alone.

mod forward;

use std::sync::Arc;

use forward::{Noise, coarse, gloss_rates, rates, record_of};
use gonio_acquisition::{ClearCoat, Options, PixelMap, Reducer, Verdict, WhiteBuilder, WhiteReference};
use gonio_brdf::models::{AshikhminShirleySimplified, Coat, Lambert};
use gonio_brdf::{Brdf, Flag, Measured, Rgb, average};
use gonio_instrument::{Certificate, Description, Pose, PoseRecord, SampleRecord};
use gonio_optics::{Vec3, colour};

const GAIN: f64 = 2.0e5;
const TILTS: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 65.0, 75.0];
const EXPOSURES: [f64; 7] = [2e-5, 1.5e-4, 1e-3, 6e-3, 0.03, 0.2, 1.0];

/// A paint seen through its coat, gloss left out.
struct Through<'a>(&'a dyn Brdf, Coat);

impl Brdf for Through<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.1.base_through(self.0, light, view)
    }
}

fn white(map: &Arc<PixelMap>, d: &Description, options: &Options) -> WhiteReference {
    let mut builder =
        WhiteBuilder::new(map.clone(), &Certificate::virtual_white(), Vec::new(), options).expect("builds");
    for (k, tilt) in [0.0, 25.0, 50.0, 70.0].into_iter().enumerate() {
        let (t, pose) = (0.10 / f64::to_radians(tilt).cos(), Pose::from_degrees(tilt, 0.0));
        let light = rates(d, &Lambert { diffuse: [0.98; 3] }, pose, GAIN);
        builder.add_pose(&record_of(d, &light, k as u32, pose, &[t; 4], &mut Some(Noise(3)))).expect("adds");
    }
    builder.finish().expect("covers")
}

/// The poses of a sample, its base as it is or under a coat.
fn poses(d: &Description, base: &dyn Brdf, coat: Option<Coat>, tilts: &[f64]) -> Vec<PoseRecord> {
    tilts
        .iter()
        .zip(0u32..)
        .map(|(&tilt, k)| {
            let pose = Pose::from_degrees(tilt, 0.0);
            let light = match coat {
                Some(coat) => {
                    let gloss = gloss_rates(d, coat.index, pose, GAIN);
                    let below = rates(d, &Through(base, coat), pose, GAIN);
                    below.iter().zip(gloss).map(|(a, b)| a + b).collect()
                }
                None => rates(d, base, pose, GAIN),
            };
            record_of(d, &light, k, pose, &EXPOSURES, &mut Some(Noise(1000 + u64::from(k))))
        })
        .collect()
}

fn reduce(map: &Arc<PixelMap>, white: &WhiteReference, poses: &[PoseRecord], options: Options) -> Reducer {
    let mut reducer =
        Reducer::new(map.clone(), white.clone(), SampleRecord::default(), options).expect("builds");
    for pose in poses {
        reducer.add_pose(pose).expect("adds");
    }
    reducer
}

fn scan(d: &Description, base: &dyn Brdf, coat: Option<Coat>, tilts: &[f64]) -> Reducer {
    let map = Arc::new(PixelMap::new(d));
    let options = options(tilts);
    let white = white(&map, d, &options);
    reduce(&map, &white, &poses(d, base, coat, tilts), options)
}

fn options(tilts: &[f64]) -> Options {
    let mut o = Options::default();
    o.grid.theta_i_deg = tilts.to_vec();
    o
}

const METALLIC: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.06, 0.13, 0.32], specular: [0.3, 0.35, 0.4], exponent: 40.0 };

/// A zone of the table: its name, its cells, and the mean colour difference it may have.
type Zone<'a> = (&'a str, &'a dyn Fn([usize; 3], Flag) -> bool, f64);

/// Colour differences of the total's cells chosen by `pick`: mean and largest.
fn differences(m: &Measured, truth: &dyn Brdf, pick: impl Fn([usize; 3], Flag) -> bool) -> (f64, f64, usize) {
    let mut all = Vec::new();
    for i in 0..m.grid.len() {
        let cell = m.grid.coordinates(i);
        let g = m.grid.geometry(cell[0], cell[1], cell[2]);
        if !pick(cell, m.flag[i]) || g.from_mirror().degrees() < 15.0 {
            continue;
        }
        let want = average::adaptive_cell_mean(truth, &m.grid, m.meaning, cell);
        let have = m.values[i].map(f64::from);
        all.push(colour::ciede2000(colour::lab_from_brdf(have), colour::lab_from_brdf(want)));
    }
    let n = all.len();
    (all.iter().sum::<f64>() / n.max(1) as f64, all.iter().copied().fold(0.0, f64::max), n)
}

#[test]
fn a_coat_is_found_with_its_index_and_the_base_comes_out_as_it_is() {
    let d = coarse(2);
    let coat = Coat { index: 1.5 };
    let reducer = scan(&d, &METALLIC, Some(coat), &TILTS);
    let Verdict::Coat(fit) = reducer.coat() else { panic!("{:?}", reducer.coat()) };
    assert!((fit.index - 1.5).abs() < 0.005, "{fit:?}");
    assert!((fit.ratio - 1.0).abs() < 0.02, "{fit:?}");
    let m = reducer.finish();
    assert_eq!(m.attributes["clear_coat"], "two-way");
    let through = Through(&METALLIC, coat);
    let zones: [Zone<'_>; 4] = [
        ("measured", &|_, f| f == Flag::Measured, 0.3),
        ("filled", &|_, f| f == Flag::Filled, 0.6),
        ("75-85", &|c: [usize; 3], f| f == Flag::Extrapolated && m.grid.theta_o_deg[c[1]] <= 85.0, 1.0),
        (
            "85-90",
            &|c: [usize; 3], f| f == Flag::Extrapolated && m.grid.theta_o_deg[c[1]] > 85.0,
            f64::INFINITY,
        ),
    ];
    for (name, pick, bound) in zones {
        let (mean, max, n) = differences(&m, &through, pick);
        assert!(n > 20 && mean <= bound, "{name}: mean {mean} max {max} of {n}");
    }
    // the base, where it was measured, against the base itself; T T/n² is finite up to grazing
    let base = m.base.as_ref().expect("a base");
    let mut worst = 0.0f64;
    for (i, have) in base.iter().enumerate() {
        let [ti, to, phi] = m.grid.coordinates(i);
        let g = m.grid.geometry(ti, to, phi);
        if m.flag[i] != Flag::Measured || g.from_mirror().degrees() < 20.0 || m.grid.theta_o_deg[to] > 70.0 {
            continue;
        }
        let (l, v) = g.directions();
        let inside = |v: Vec3| gonio_optics::fresnel::refract(v, 1.5);
        let want = METALLIC.eval(inside(l), inside(v));
        worst = worst.max((f64::from(have[1]) / want[1] - 1.0).abs());
    }
    assert!(worst < 0.05, "base off by {worst}");
    // what the gloss carries into a cell is there again
    let cell = m.grid.index(2, 12, 35);
    let (truth, have) = (
        average::model_cell_mean(
            &gonio_brdf::ModelFile {
                model: gonio_brdf::Model::AshikhminShirleySimplified(METALLIC),
                coat: Some(coat),
                fit: None,
            },
            &m.grid,
            m.meaning,
            [2, 12, 35],
        ),
        m.values[cell],
    );
    assert!((f64::from(have[1]) / truth[1] - 1.0).abs() < 0.02, "{have:?} {truth:?}");
    assert_eq!(m.flag[cell], Flag::Filled, "the gloss hid this cell's base");
}

#[test]
fn samples_without_a_coat_are_left_alone() {
    const SOME: [f64; 4] = [10.0, 30.0, 50.0, 65.0];
    let d = coarse(3);
    let map = Arc::new(PixelMap::new(&d));
    let white = white(&map, &d, &options(&SOME));
    for (exponent, specular) in [(21.0, 0.1), (120.0, 0.1), (1300.0, 0.05)] {
        let paint =
            AshikhminShirleySimplified { diffuse: [0.2, 0.1, 0.05], specular: [specular; 3], exponent };
        let poses = poses(&d, &paint, None, &SOME);
        let looked = reduce(&map, &white, &poses, options(&SOME));
        assert!(matches!(looked.coat(), Verdict::None(_)), "{exponent}: {:?}", looked.coat());
        let m = looked.finish();
        let not = Options { clear_coat: ClearCoat::None, ..options(&SOME) };
        let plain = reduce(&map, &white, &poses, not).finish();
        assert_eq!((m.values, m.sigma, m.flag), (plain.values, plain.sigma, plain.flag));
        assert!(m.base.is_none());
    }
}

#[test]
fn black_glass_has_its_index() {
    const SOME: [f64; 5] = [10.0, 25.0, 40.0, 55.0, 65.0];
    let reducer = scan(&coarse(3), &Lambert { diffuse: [0.0; 3] }, Some(Coat { index: 1.567 }), &SOME);
    let Verdict::Coat(fit) = reducer.coat() else { panic!("{:?}", reducer.coat()) };
    // pixels of 1.1° before an image of 1°: a percent of F
    assert!((fit.index - 1.567).abs() < 3.0 * fit.index_sigma.max(2e-3), "{fit:?}");
    assert!((fit.ratio - 1.0).abs() < 0.02, "{fit:?}");
}
