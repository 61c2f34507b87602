//! The choice for a scene: every representation renders the same pictures from the same rays, and the cheapest that keeps the bound is taken.
//!
//! The reference is the full table. Where a material has gloss that can be told from its body, body against body is compared: a renderer adds the coat's
//! mirror image to any of them alike.

use gonio_brdf::formats::Loaded;
use gonio_brdf::{Brdf, Grid, Measured, Rgb};
use gonio_optics::Vec3;
use gonio_render::sphere::LinearImage;
use gonio_render::trace::Gathered;

use crate::material::place;
use crate::pixels::{pixel_differences, spread};
use crate::timing::{Direction, Evaluate};
use crate::{
    Built, ColourSpread, Cost, Finding, Gloss, GlossError, Left, Material, Options, Representation, costs,
    front, without_gloss,
};

/// Which figure over the pixels is held against the bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Statistic {
    /// The mean.
    #[default]
    Mean,
    /// The 95th percentile.
    P95,
    /// The largest.
    Max,
}

impl Statistic {
    /// The figure.
    #[must_use]
    pub const fn of(self, s: &ColourSpread) -> f64 {
        match self {
            Self::Mean => s.mean,
            Self::P95 => s.p95,
            Self::Max => s.max,
        }
    }

    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::P95 => "p95",
            Self::Max => "max",
        }
    }
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct ChoiceOptions {
    /// How representations are built.
    pub build: Options,
    /// Which take part.
    pub candidates: Vec<Representation>,
    /// Largest colour difference.
    pub bound: f64,
    /// Of which figure.
    pub statistic: Statistic,
}

/// A representation and the pictures it makes.
pub struct SceneCandidate {
    /// As it was built.
    pub built: Built,
    /// ns per evaluation at the scene's own geometries.
    pub cost: Cost,
    /// CIEDE2000 over the pixels, against the full table.
    pub pixels: ColourSpread,
    /// Whether it keeps the bound.
    pub keeps: bool,
    /// Nothing else is faster and closer.
    pub on_front: bool,
}

/// What was found.
pub struct Choice {
    /// Cheapest first.
    pub candidates: Vec<SceneCandidate>,
    /// What could not be built, and why.
    pub left_out: Vec<Left>,
    /// Place of the chosen one; `None` where none keeps the bound.
    pub chosen: Option<usize>,
    /// ns per evaluation of the full table (trilinear, single precision).
    pub table_ns: f64,
    /// Bytes of the full table.
    pub table_bytes: usize,
    /// What happened to the gloss.
    pub gloss: Option<Gloss>,
    /// What to know.
    pub findings: Vec<Finding>,
    /// Pictures of the full table, a view each.
    pub reference: Vec<LinearImage>,
}

/// A choice that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ChoiceError {
    /// Nothing between the measurements.
    #[error(
        "scattered measurements say nothing in between, so there is no full table to render and to judge by: fit one first (gonio fit M --model flake-map:1 -o map.json, or a model) \
         and take that"
    )]
    Scattered,
    /// Gloss.
    #[error(transparent)]
    Gloss(#[from] GlossError),
    /// Nothing could be built.
    #[error("no representation can be built: {reason}")]
    NothingBuilt {
        /// Of the first.
        reason: String,
    },
    /// Nothing to compare.
    #[error(
        "no pixel lies wholly on the object and in the light: nothing to judge by; give the scene more pixels or bring the camera closer"
    )]
    NoPixel,
}

/// What is compared: the material, or its body where gloss can be taken off.
///
/// # Errors
/// [`ChoiceError`] for scattered measurements, and for a wish about gloss that cannot be followed.
pub fn body_of(material: &Material, options: &Options) -> Result<(Option<Material>, Gloss), ChoiceError> {
    if material.brdf().is_none() {
        return Err(ChoiceError::Scattered);
    }
    let (body, done) = without_gloss(material, options.index, options.gloss)?;
    if matches!(done, Gloss::NoneInIt | Gloss::NotSeen(_) | Gloss::Kept) {
        return Ok((None, done));
    }
    let table = match material.table() {
        Some(t) => {
            let mut out = Measured { base: None, base_single_pass: None, node: None, ..t.clone() };
            for (i, value) in out.values.iter_mut().enumerate() {
                let [ti, to, phi] = t.grid.coordinates(i);
                let (l, v) = t.grid.geometry(ti, to, phi).directions();
                *value = body.eval(l, v).map(|x| x as f32);
            }
            out
        }
        None => Measured::sampled(Grid::sopp(), &*body),
    };
    Ok((Some(Material::new(material.name.clone(), Loaded::Table(Box::new(table)))), done))
}

/// Chooses.
///
/// # Errors
/// [`ChoiceError`]; single representations that cannot be built are listed in [`Choice::left_out`].
pub fn choose(material: &Material, scene: &Gathered, options: &ChoiceOptions) -> Result<Choice, ChoiceError> {
    let (body, gloss) = body_of(material, &options.build)?;
    let mut findings = Finding::of_coat(material, options.build.index);
    let judged = body.as_ref().unwrap_or(material);
    let brdf = judged.brdf().ok_or(ChoiceError::Scattered)?;
    let reference = scene.pictures(&|l, v, out| of_function(brdf, l, v, out));
    let (mut built, mut left_out) = (Vec::new(), Vec::new());
    for &representation in &options.candidates {
        match representation.build(judged, &options.build) {
            Ok(b) => {
                let pictures = scene.pictures(&|l, v, out| b.eval_many(l, v, out));
                let pixels =
                    spread(&pixel_differences(scene, &reference, &pictures)).ok_or(ChoiceError::NoPixel)?;
                built.push((b, pixels));
            }
            Err(e) => left_out.push(Left { representation, reason: e.to_string() }),
        }
    }
    if built.is_empty() {
        let reason = left_out.first().map_or_else(|| "none was asked for".to_owned(), |l| l.reason.clone());
        return Err(ChoiceError::NothingBuilt { reason });
    }
    for f in built.iter().flat_map(|b: &(Built, ColourSpread)| &b.0.findings) {
        if !findings.contains(f) {
            findings.push(f.clone());
        }
    }
    let table = Representation::Table
        .build(judged, &options.build)
        .map_err(|e| ChoiceError::NothingBuilt { reason: e.to_string() })?;
    let (costs, table_ns) = timed(scene, &built, &table);
    let points: Vec<(f64, f64)> =
        built.iter().zip(&costs).map(|((_, p), c)| (c.median_ns, options.statistic.of(p))).collect();
    let on_front = front(&points);
    let mut candidates: Vec<SceneCandidate> = built
        .into_iter()
        .zip(costs)
        .zip(on_front)
        .map(|(((built, pixels), cost), on_front)| {
            let keeps = options.statistic.of(&pixels) <= options.bound;
            SceneCandidate { built, cost, pixels, keeps, on_front }
        })
        .collect();
    candidates.sort_by(|a, b| a.cost.median_ns.total_cmp(&b.cost.median_ns));
    Ok(Choice {
        chosen: candidates.iter().position(|c| c.keeps),
        candidates,
        left_out,
        table_ns,
        table_bytes: table.bytes(),
        gloss: Some(gloss),
        findings,
        reference,
    })
}

impl Choice {
    /// The one that comes nearest by a figure.
    #[must_use]
    pub fn nearest(&self, statistic: Statistic) -> Option<&SceneCandidate> {
        self.candidates.iter().min_by(|a, b| statistic.of(&a.pixels).total_cmp(&statistic.of(&b.pixels)))
    }
}

/// f of a function, one at a time.
pub(crate) fn of_function(brdf: &dyn Brdf, l: &[Direction], v: &[Direction], out: &mut [[f32; 3]]) {
    for ((l, v), o) in l.iter().zip(v).zip(out) {
        let f: Rgb = brdf.eval(double(*l), double(*v));
        *o = f.map(|x| x as f32);
    }
}

fn double(d: Direction) -> Vec3 {
    let [x, y, z] = d.map(f64::from);
    Vec3::new(x, y, z)
}

/// Costs of all, and of the full table, timed in turn at geometries of the scene in no order.
fn timed(scene: &Gathered, built: &[(Built, ColourSpread)], table: &Built) -> (Vec<Cost>, f64) {
    let n = scene.lights.len();
    let mixed: Vec<(Direction, Direction)> =
        (0..n.min(1 << 16)).map(|i| place(i, n)).map(|i| (scene.lights[i], scene.toward[i])).collect();
    let closures: Vec<_> = built
        .iter()
        .map(|(b, _)| b)
        .chain([table])
        .map(|b| move |l: &[Direction], v: &[Direction], out: &mut [[f32; 3]]| b.eval_many(l, v, out))
        .collect();
    let evaluations: Vec<Evaluate<'_>> = closures.iter().map(|c| c as Evaluate<'_>).collect();
    let mut all = costs(&mixed, &evaluations);
    let table = all.pop().map_or(f64::NAN, |c| c.median_ns);
    (all, table)
}
