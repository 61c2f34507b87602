//! The trade: every representation of one material with its cost, its size and its error over the geometries that count.

use gonio_brdf::maps::Sample;
use gonio_optics::{
    Geometry, Vec3,
    isoline::{Method, isoline},
};

use crate::difference::Gathered;
use crate::material::place;
use crate::timing::{Direction, Evaluate};
use crate::{BuildError, Built, Cost, Difference, Finding, Material, Options, Representation, costs, front};

/// The geometries that count.
#[derive(Clone, Debug, PartialEq)]
pub enum GeometrySet {
    /// All to the largest angle, by solid angle of light and view.
    All,
    /// The user's, each with a weight.
    List(Vec<(Geometry, f64)>),
}

/// What to compare, and over which geometries.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOptions {
    /// How representations are built.
    pub build: Options,
    /// Which of them.
    pub candidates: Vec<Representation>,
    /// Over what.
    pub geometries: GeometrySet,
}

/// A representation with its figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Which.
    pub representation: Representation,
    /// ns per evaluation from vectors.
    pub cost: Cost,
    /// The arithmetic that was timed.
    pub arithmetic: &'static str,
    /// Bytes that look-ups read from.
    pub bytes: usize,
    /// Against the material.
    pub difference: Difference,
    /// No other is as fast and as exact beyond 15° (by mean), and better in one.
    pub on_front: bool,
}

/// A representation that could not be built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Left {
    /// Which.
    pub representation: Representation,
    /// Why.
    pub reason: String,
}

/// The whole comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Trade {
    /// Name of the material.
    pub name: String,
    /// Refractive index of the coat that was assumed.
    pub index: f64,
    /// In the order asked for.
    pub candidates: Vec<Candidate>,
    /// What could not be built, and why.
    pub left_out: Vec<Left>,
    /// Which geometries were judged, in words.
    pub judged: String,
    /// How many.
    pub geometries: usize,
    /// Share of their weight that lies beyond the critical angle of the in-plane equivalent, 0…1.
    pub beyond_critical: f64,
    /// What to know.
    pub findings: Vec<Finding>,
}

/// A comparison that cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TradeError {
    /// No measurement at the geometries asked for.
    #[error(
        "none of the {asked} geometries has a measurement near it: nothing to judge by; ask for geometries within what was measured"
    )]
    NothingMeasured {
        /// How many were asked for.
        asked: usize,
    },
    /// Scattered measurements and a list of geometries.
    #[error(
        "scattered measurements are judged at their own geometries and say nothing in between: leave the list of geometries out, or fit a model first"
    )]
    ScatteredList,
    /// Nothing could be built at all.
    #[error("no representation can be built: {reason}")]
    NothingBuilt {
        /// Of the first.
        reason: String,
    },
}

/// A single representation that cannot be assessed.
#[derive(Debug, thiserror::Error)]
pub enum AssessError {
    /// It cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// There is nothing to judge by.
    #[error(transparent)]
    Judge(#[from] TradeError),
}

type Part = (Option<Material>, Vec<Sample>);

/// Compares.
///
/// # Errors
/// [`TradeError`]; single representations that cannot be built are listed in [`Trade::left_out`] instead.
pub fn trade(material: &Material, options: &TradeOptions) -> Result<Trade, TradeError> {
    let index = options.build.index;
    let mut findings = Finding::of_coat(material, index);
    let (parts, judged) = parts(material, options, &mut findings)?;
    let geometries = parts.iter().map(|p| p.1.len()).sum();
    if geometries == 0 {
        return Err(TradeError::NothingMeasured { asked: 0 });
    }
    let (mut built, mut left_out): (Vec<(Built, Difference)>, Vec<Left>) = (Vec::new(), Vec::new());
    for &representation in &options.candidates {
        match representation.build(material, &options.build) {
            Ok(whole) => match judge(&whole, representation, &parts, &options.build) {
                Ok(difference) => built.push((whole, difference)),
                Err(e) => left_out.push(Left { representation, reason: e.to_string() }),
            },
            Err(e) => left_out.push(Left { representation, reason: e.to_string() }),
        }
    }
    if built.is_empty() {
        let reason = left_out.first().map_or_else(|| "none was asked for".to_owned(), |l| l.reason.clone());
        return Err(TradeError::NothingBuilt { reason });
    }
    for f in built.iter().flat_map(|b| &b.0.findings) {
        if !findings.contains(f) {
            findings.push(f.clone());
        }
    }
    let candidates = figures(&built, &parts);
    Ok(Trade {
        name: material.name.clone(),
        index,
        candidates,
        left_out,
        judged,
        geometries,
        beyond_critical: beyond_critical(&parts, index),
        findings,
    })
}

fn parts(
    material: &Material,
    options: &TradeOptions,
    findings: &mut Vec<Finding>,
) -> Result<(Vec<Part>, String), TradeError> {
    match &options.geometries {
        GeometrySet::All => {
            let judged = material.judged(options.build.largest);
            let largest = options.build.largest.degrees();
            Ok((judged.parts, format!("all geometries to {largest:.0}°: {}", judged.how)))
        }
        GeometrySet::List(list) => {
            let (samples, missing) = material.samples_at(list).ok_or(TradeError::ScatteredList)?;
            let asked = samples.len() + missing;
            if samples.is_empty() {
                return Err(TradeError::NothingMeasured { asked });
            }
            if missing > 0 {
                findings.push(Finding::NotMeasured { count: missing, of: asked });
            }
            Ok((vec![(None, samples)], "the geometries of the list, by their weights".to_owned()))
        }
    }
}

/// One representation, with its differences over `geometries` and what is to know.
///
/// # Errors
/// [`AssessError`]: it cannot be built, or there is nothing to judge by.
pub fn assess(
    material: &Material,
    representation: Representation,
    build: &Options,
    geometries: GeometrySet,
) -> Result<(Built, Difference, Vec<Finding>), AssessError> {
    let mut findings = Finding::of_coat(material, build.index);
    let whole = representation.build(material, build)?;
    let options = TradeOptions { build: *build, candidates: Vec::new(), geometries };
    let (parts, _) = parts(material, &options, &mut findings)?;
    findings.extend(whole.findings.iter().cloned());
    let difference = judge(&whole, representation, &parts, build)?;
    Ok((whole, difference, findings))
}

fn judge(
    whole: &Built,
    representation: Representation,
    parts: &[Part],
    options: &Options,
) -> Result<Difference, BuildError> {
    let mut gathered = Gathered::default();
    for (rest, samples) in parts {
        let of_rest = match rest {
            Some(rest) => Some(representation.build(rest, options)?),
            None => None,
        };
        let built = of_rest.as_ref().unwrap_or(whole);
        for s in samples {
            gathered.add(s, built.eval(s.light, s.view));
        }
    }
    Ok(gathered.finish())
}

fn figures(built: &[(Built, Difference)], parts: &[Part]) -> Vec<Candidate> {
    let single = |d: Vec3| d.to_array().map(|x| x as f32);
    let samples: Vec<&Sample> = parts.iter().flat_map(|p| &p.1).collect();
    // neighbours in a list of cells are neighbours in the tables: a scene's geometries come in no order
    let mixed: Vec<(Direction, Direction)> = (0..samples.len().min(1 << 16))
        .map(|i| samples[place(i, samples.len())])
        .map(|s| (single(s.light), single(s.view)))
        .collect();
    let closures: Vec<_> = built
        .iter()
        .map(|(b, _)| move |l: &[Direction], v: &[Direction], out: &mut [[f32; 3]]| b.eval_many(l, v, out))
        .collect();
    let evaluations: Vec<Evaluate<'_>> = closures.iter().map(|c| c as Evaluate<'_>).collect();
    let costs = costs(&mixed, &evaluations);
    let points: Vec<(f64, f64)> = built
        .iter()
        .zip(&costs)
        .map(|((_, d), c)| (c.median_ns, d.beyond_15_deg.or(d.within_15_deg).map_or(f64::NAN, |s| s.mean)))
        .collect();
    let on_front = front(&points);
    built
        .iter()
        .zip(costs)
        .zip(on_front)
        .map(|(((b, difference), cost), on_front)| Candidate {
            representation: b.representation,
            cost,
            arithmetic: b.arithmetic(),
            bytes: b.bytes(),
            difference: *difference,
            on_front,
        })
        .collect()
}

fn beyond_critical(parts: &[Part], index: f64) -> f64 {
    let (mut met, mut total) = (0.0, 0.0);
    for s in parts.iter().flat_map(|p| &p.1) {
        total += s.weight;
        met += if isoline(s.light, s.view, index, Method::Clip).limited { s.weight } else { 0.0 };
    }
    if total > 0.0 { met / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::formats::Loaded;
    use gonio_brdf::{Flag, Grid, Measured, ModelFile};
    use gonio_optics::Angle;

    const PAINT: &str = r#"{"model":"ggx","diffuse":[0.05,0.1,0.3],"lobes":[{"specular":[0.3,0.2,0.1],"alpha":0.3,"r0":0.5}],"coat":{"index":1.5}}"#;

    fn paint(text: &str) -> Material {
        Material::new("paint", Loaded::Model(Box::new(ModelFile::from_json(text).unwrap())))
    }

    fn options(candidates: &[&str], index: f64) -> TradeOptions {
        TradeOptions {
            build: Options { nodes: 24, ..Options::new(index) },
            candidates: candidates.iter().map(|c| c.parse().unwrap()).collect(),
            geometries: GeometrySet::All,
        }
    }

    #[test]
    fn more_dimensions_cost_less_error_and_the_front_holds_the_best_of_each() {
        let names = ["table", "aspecular", "clip", "flake-map:0", "flake-map:1"];
        let t = trade(&paint(PAINT), &options(&names, 1.5)).unwrap();
        assert!(t.left_out.is_empty() && t.findings.is_empty(), "{:?}", t.findings);
        let mean = |k: usize| t.candidates[k].difference.beyond_15_deg.unwrap().mean;
        // from the aspecular angle over the plane to all geometries
        assert!(mean(1) > mean(2) && mean(2) > mean(3) && mean(3) > mean(4), "{:?}", t.candidates);
        assert!(t.candidates.iter().all(|c| c.cost.median_ns > 0.0 && c.bytes > 0));
        let best = (0..5).min_by(|&a, &b| mean(a).total_cmp(&mean(b))).unwrap();
        assert!(t.candidates[best].on_front);
        // 38 % of all geometries farther than 15° from the mirror direction, which are 93 % of all
        assert!((0.30..0.40).contains(&t.beyond_critical), "{}", t.beyond_critical);
        assert_eq!(t.geometries, 10_000);
    }

    #[test]
    fn a_coat_that_is_not_there_is_said() {
        let bare = PAINT.replace(r#","coat":{"index":1.5}"#, "");
        let t = trade(&paint(&bare), &options(&["flake-map:0"], 1.5)).unwrap();
        assert!(matches!(t.findings[0], Finding::Uncoated { share: None, .. }), "{:?}", t.findings);
        assert!(trade(&paint(&bare), &options(&["flake-map:0"], 1.0)).unwrap().findings.is_empty());
        let matte = Measured::sampled(Grid::sopp(), &gonio_brdf::models::Lambert { diffuse: [0.3; 3] });
        let matte = Material::new("matte", Loaded::Table(Box::new(matte)));
        let t = trade(&matte, &options(&["clip"], 1.5)).unwrap();
        assert!(t.findings.iter().any(|f| f.to_string().contains("--index 1")), "{:?}", t.findings);
        // what is the same everywhere is stored exactly by anything
        assert!(t.candidates[0].difference.beyond_15_deg.unwrap().max < 1e-3);
    }

    #[test]
    fn geometries_without_a_measurement_are_left_out_and_counted() {
        let mut table = paint(PAINT);
        let mut t = Measured::sampled(Grid::sopp(), table.brdf().unwrap());
        for i in 0..t.grid.len() {
            if t.grid.coordinates(i)[0] > 12 {
                t.flag[i] = Flag::Extrapolated;
            }
        }
        table = Material::new("t", Loaded::Table(Box::new(t)));
        let at = |ti: f64| (Geometry::from_degrees(ti, 20.0, 90.0), 1.0);
        let mut o = options(&["table", "clip"], 1.5);
        o.geometries = GeometrySet::List(vec![at(30.0), at(80.0), at(85.0)]);
        let found = trade(&table, &o).unwrap();
        assert_eq!(found.geometries, 1);
        assert!(found.findings.contains(&Finding::NotMeasured { count: 2, of: 3 }), "{:?}", found.findings);
        o.geometries = GeometrySet::List(vec![at(80.0)]);
        assert_eq!(trade(&table, &o), Err(TradeError::NothingMeasured { asked: 1 }));
    }

    #[test]
    fn all_measured_cells_of_a_table_are_judged_by_solid_angle() {
        let t = Measured::sampled(Grid::sopp(), paint(PAINT).brdf().unwrap());
        let m = Material::new("t", Loaded::Table(Box::new(t)));
        let mut o = options(&["table"], 1.5);
        o.build.largest = Angle::from_degrees(60.0);
        let found = trade(&m, &o).unwrap();
        // the same nodes: nothing but rounding
        assert!(
            found.candidates[0].difference.beyond_15_deg.unwrap().max < 0.01,
            "{:?}",
            found.candidates[0]
        );
        assert_eq!(found.geometries, 13 * 25 * 36);
    }
}
