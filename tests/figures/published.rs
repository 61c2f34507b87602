//! Our fits beside the parameters that were published for the same materials, in the measure of those who published them. Needs `GONIO_DATA`.
//!
//! Data: the networks fitted to 86 MERL materials, as node values at θi by 10°, θo by 1° and 27 azimuths that close up towards the mirror
//! plane (0.5° there), so that lobes of 1° are seen; θ ≤ 80°. Measure: Ngan et al. 2005, √(Σ w cos² θi (f − y)²/Σ w), all channels.

use std::f64::consts::{FRAC_1_PI, PI};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use gonio_brdf::formats::{self, Loaded};
use gonio_brdf::{Grid, Measured, Model};
use gonio_fitter::{ModelChoice, Observations, Options, Weights, assess, colours_at, fit};
use gonio_optics::{Angle, Geometry};
use gonio_tests::{RealData, real_data};
use rayon::prelude::*;

use crate::Figure;
use crate::published_tables::{Table, models, nonlinear};

/// 4/π: see [`crate::published_tables`].
const NORMALISATION: f64 = 4.0 * FRAC_1_PI;

fn grid() -> Grid {
    let mut phi: Vec<f64> = (0..16).map(|k| f64::from(k) * 10.0).collect();
    phi.extend([160.0, 165.0, 170.0, 173.0, 175.0, 176.5, 177.5, 178.5, 179.0, 179.5, 180.0]);
    Grid {
        theta_i_deg: (0..9).map(|k| f64::from(k) * 10.0).collect(),
        theta_o_deg: (0..=80).map(f64::from).collect(),
        phi_deg: phi,
    }
}

fn options(model: ModelChoice) -> Options {
    Options {
        model,
        weights: Weights::Ngan,
        max_angle: Angle::from_degrees(80.0),
        // published exponents go from 0.5 to 78,200
        exponent_range: (0.1, 1e6),
        ..Options::default()
    }
}

/// Values of a network at the grid's nodes.
fn observations(data: &RealData, name: &str) -> Option<Observations> {
    let path = format!("{}#{name}", data.file("nbrdf/merl_nbrdf.f32").display());
    let Ok(Loaded::Function(f)) = formats::open(Path::new(&path)) else { return None };
    Some(Observations::from_measured(&Measured::sampled(grid(), f.brdf.as_ref())))
}

/// Errors of one material.
struct Compared {
    name: String,
    /// With the published parameters, with their shape and the best colours, with a wrong normalisation, by our fit of the same model.
    published: [f64; 3],
    colours: [f64; 3],
    /// Errors under other readings of the published colours: see [`READINGS`].
    readings: [[f64; READINGS.len()]; 3],
    /// What the published lobes send back at [`ANGLES`]: value at the mirror direction times the lobe's area.
    lobes_sent: [[f64; 3]; 3],
    /// Specular colour that the data ask for at the published shape over the published one, angles up to 60° and to 80°.
    scale: [[f64; 2]; 3],
    wrong: f64,
    ours: [f64; 3],
    /// `ashikhmin-shirley`.
    full: f64,
    /// Best single lobe and best two lobes; `None` where more lobes were not fitted.
    lobes: Option<[f64; 3]>,
}

const TABLES: [(Table, ModelChoice, &str); 3] = [
    (Table::AshikhminShirley, ModelChoice::LambertAshikhminShirley, "lambert-ashikhmin-shirley"),
    (Table::CookTorrance, ModelChoice::CookTorrance(1), "cook-torrance"),
    (Table::Ward, ModelChoice::Ward, "ward"),
];

/// Factors of conventions that could be mistaken: what the lobe's and the diffuse colour would be multiplied by.
const READINGS: [(&str, f64, f64); 9] = [
    ("as read", 1.0, 1.0),
    ("lobe / π", FRAC_1_PI, 1.0),
    ("lobe / 4", 0.25, 1.0),
    ("lobe · π/4", PI / 4.0, 1.0),
    ("lobe · 4/π", 4.0 * FRAC_1_PI, 1.0),
    ("lobe · π", PI, 1.0),
    ("lobe · 4", 4.0, 1.0),
    ("diffuse / π", 1.0, FRAC_1_PI),
    ("diffuse · π", 1.0, PI),
];

/// Angles of incidence at which published lobes are compared, degrees.
const ANGLES: [f64; 3] = [15.0, 45.0, 60.0];

/// A lobe at its mirror direction times its area in half vectors: 1/(n + 1), or α²/2.
fn sent(model: &Model, angle: f64) -> f64 {
    let (l, v) = Geometry::from_degrees(angle, angle, 180.0).directions();
    let lobe: f64 = scaled(model, 1.0, 0.0).brdf().eval(l, v).iter().sum();
    lobe * match model {
        Model::LambertAshikhminShirley(m) => (m.exponent + 1.0).recip(),
        Model::CookTorrance(m) => m.lobes.first().map_or(f64::NAN, |k| 0.5 * k.alpha * k.alpha),
        Model::Ward(m) => 0.5 * m.alpha * m.alpha,
        _ => f64::NAN,
    }
}

/// A model with its lobe's and its diffuse colour multiplied.
fn scaled(model: &Model, lobe: f64, diffuse: f64) -> Model {
    let (l, d) = (|c: [f64; 3]| c.map(|x| x * lobe), |c: [f64; 3]| c.map(|x| x * diffuse));
    let mut model = model.clone();
    match &mut model {
        Model::LambertAshikhminShirley(m) => (m.diffuse, m.specular) = (d(m.diffuse), l(m.specular)),
        Model::Ward(m) => (m.diffuse, m.specular) = (d(m.diffuse), l(m.specular)),
        Model::CookTorrance(m) => {
            m.diffuse = d(m.diffuse);
            m.lobes.iter_mut().for_each(|k| k.specular = l(k.specular));
        }
        _ => {}
    }
    model
}

/// Materials of which more lobes are fitted: every so many.
const LOBES_EVERY: usize = 6;

fn compare(obs: &Observations, name: &str, theirs: [&Model; 3], wrong: &Model, lobes: bool) -> Compared {
    let error = |m: &Model| assess(obs, &options(ModelChoice::Lambert), &m.clone().into()).weighted_error;
    let ours = TABLES.map(|(_, choice, _)| fit(obs, &options(choice)).weighted_error);
    let full = fit(obs, &options(ModelChoice::AshikhminShirley)).weighted_error;
    let best = |choices: &[ModelChoice]| {
        choices.iter().map(|c| fit(obs, &options(*c)).weighted_error).fold(f64::INFINITY, f64::min)
    };
    let lobes = lobes.then(|| {
        let one = best(&[ModelChoice::Ggx(1)]).min(full).min(ours[0]).min(ours[1]).min(ours[2]);
        let two = best(&[ModelChoice::CookTorrance(2), ModelChoice::Ggx(2)]);
        [one, two, two.min(best(&[ModelChoice::Ggx(3)]))]
    });
    let (mut colours, mut scale) = ([0.0; 3], [[0.0; 2]; 3]);
    for (k, (_, choice, _)) in TABLES.iter().enumerate() {
        for (limit, s) in [60.0, 80.0].into_iter().zip(&mut scale[k]) {
            let o = Options { max_angle: Angle::from_degrees(limit), ..options(*choice) };
            let best = colours_at(obs, &o, &nonlinear(theirs[k]));
            *s = specular(&best.model) / specular(theirs[k]);
            colours[k] = best.weighted_error;
        }
    }
    Compared {
        name: name.to_owned(),
        published: theirs.map(error),
        lobes_sent: theirs.map(|m| ANGLES.map(|a| sent(m, a))),
        readings: theirs.map(|m| READINGS.map(|(_, lobe, diffuse)| error(&scaled(m, lobe, diffuse)))),
        colours,
        scale,
        wrong: error(wrong),
        ours,
        full,
        lobes,
    }
}

/// Brightness of the lobe of a model: its specular colours added up.
fn specular(model: &Model) -> f64 {
    let colour = match model {
        Model::LambertAshikhminShirley(m) => m.specular,
        Model::Ward(m) => m.specular,
        Model::CookTorrance(m) => m.lobes.first().map_or([0.0; 3], |l| l.specular),
        _ => [0.0; 3],
    };
    colour.iter().sum()
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
}

pub fn figures() -> Vec<Figure> {
    let Some(data) = real_data("published fits") else {
        return vec![Figure::said("published fits", "GONIO_DATA is unset: did not run", "-", None, true)];
    };
    let read = |table: Table, n: f64| {
        let text = std::fs::read_to_string(data.file(table.file())).expect("a table of published fits");
        models(&text, table, n)
    };
    let tables = TABLES.map(|(t, _, _)| read(t, NORMALISATION));
    let wrong = read(Table::CookTorrance, 4.0);
    let names: Vec<&String> = tables[0].keys().collect();
    let done = AtomicUsize::new(0);
    let compared: Vec<Compared> = names
        .par_iter()
        .enumerate()
        .filter_map(|(i, name)| {
            let obs = observations(&data, name)?;
            let theirs = [tables[0].get(*name)?, tables[1].get(*name)?, tables[2].get(*name)?];
            let c = compare(&obs, name, theirs, wrong.get(*name)?, i % LOBES_EVERY == 0);
            let k = done.fetch_add(1, Ordering::Relaxed) + 1;
            eprint!("\r{k} of {} materials", names.len());
            Some(c)
        })
        .collect();
    eprintln!();
    told(&compared)
}

fn told(compared: &[Compared]) -> Vec<Figure> {
    let count = compared.len();
    let mut out =
        vec![Figure::said("materials with published parameters", count.to_string(), "86", None, count == 86)];
    for (k, (_, _, name)) in TABLES.iter().enumerate() {
        let at = |limit: usize| {
            median(compared.iter().map(|c| c.scale[k][limit]).filter(|x| x.is_finite()).collect())
        };
        // a factor of 4, π or 4/π misread would stand out
        out.push(Figure::within(
            format!("{name}: lobe's brightness as data to 60° ask, over published, median"),
            at(0),
            0.8,
            1.25,
            None,
        ));
        out.push(Figure::said(
            "  the same with data to 80°",
            format!("{:.3}", at(1)),
            "as measured",
            None,
            true,
        ));
        let published = median(compared.iter().map(|c| c.published[k]).collect());
        let colours = median(compared.iter().map(|c| c.colours[k]).collect());
        out.push(Figure::said(
            "  median error with published parameters; with the best colours at their shape",
            format!("{published:.4}; {colours:.4}"),
            "as measured",
            None,
            true,
        ));
    }
    for (k, (_, _, name)) in TABLES.iter().enumerate() {
        let errors: Vec<f64> = (0..READINGS.len())
            .map(|r| median(compared.iter().map(|c| c.readings[k][r]).collect()))
            .collect();
        let others: Vec<String> =
            READINGS.iter().zip(&errors).map(|((what, ..), e)| format!("{what} {e:.4}")).collect();
        // how many materials the reading is the best of all for
        let best = compared.iter().filter(|c| c.readings[k].iter().all(|e| c.readings[k][0] <= *e)).count();
        out.push(Figure::said(
            format!("{name}: median error under other readings of the published colours"),
            format!("{}; best for {best} of {count}", others.join(", ")),
            "as measured",
            None,
            true,
        ));
    }
    // both were fitted to the same measurements: what their lobes send back must agree, whatever the networks hold
    for (at, angle) in ANGLES.into_iter().enumerate() {
        let ratio = |other: usize| {
            median(compared.iter().map(|c| c.lobes_sent[other][at] / c.lobes_sent[0][at]).collect())
        };
        out.push(Figure::within(
            format!("published Cook–Torrance lobe over published Ashikhmin–Shirley lobe at {angle}°, median"),
            ratio(1),
            0.9,
            1.1,
            None,
        ));
        out.push(Figure::said(
            format!("  Ward's, which has no Fresnel factor, over it at {angle}°"),
            format!("{:.3}", ratio(2)),
            "as published",
            None,
            true,
        ));
    }
    let right = median(compared.iter().map(|c| c.published[1]).collect());
    let wrong = median(compared.iter().map(|c| c.wrong).collect());
    out.push(Figure::within(
        "the same with Cook–Torrance four times as bright (a control)",
        wrong / right,
        1.0,
        1e3,
        None,
    ));
    for (k, (_, _, name)) in TABLES.iter().enumerate() {
        out.push(better(compared, name, |c| (c.published[k], c.ours[k]), k == 0));
    }
    out.push(better(
        compared,
        "ashikhmin-shirley (another diffuse term)",
        |c| (c.published[0], c.full),
        false,
    ));
    let lobes: Vec<[f64; 3]> = compared.iter().filter_map(|c| c.lobes).collect();
    for (more, word) in [(1, "two"), (2, "two or three")] {
        let reduction = median(lobes.iter().map(|l| 100.0 * (1.0 - l[more] / l[0])).collect());
        out.push(Figure::within(
            format!("best {word} lobes against the best one, {} materials: median reduction, %", lobes.len()),
            reduction,
            0.0,
            100.0,
            None,
        ));
    }
    out
}

/// Share better, median gain and the worst ratio of a model.
fn better(
    compared: &[Compared],
    name: &str,
    of: impl Fn(&Compared) -> (f64, f64),
    none_worse: bool,
) -> Figure {
    let ratios: Vec<(f64, &str)> = compared
        .iter()
        .map(|c| {
            let (theirs, ours) = of(c);
            (ours / theirs, c.name.as_str())
        })
        .collect();
    let share = ratios.iter().filter(|r| r.0 < 1.0).count() as f64 / ratios.len().max(1) as f64;
    let gain = median(ratios.iter().map(|r| 100.0 * (1.0 - r.0)).collect());
    let worst = ratios.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, ""));
    let value = format!(
        "{:.1} % better, median gain {gain:.1} %, worst ratio {:.6} ({})",
        100.0 * share,
        worst.0,
        worst.1
    );
    let bound = if none_worse { "none worse" } else { "share, gain" };
    Figure::said(name, value, bound, None, if none_worse { worst.0 <= 1.0 + 1e-6 } else { gain >= 0.0 })
}
