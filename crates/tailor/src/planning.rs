//! The scan for a scene: which poses the instrument must visit so that the scene's pictures come out as the full plan's would.
//!
//! A pose lights the sample at one θi and sees the whole hemisphere. What it does not visit is filled from what it does: by reciprocity, in flake space under
//! a coat, smoothly between rows. So the planner asks the filling itself: it measures a likely material virtually with a set of poses, fills the table, renders the
//! scene, and compares with the material. Poses are added one by one, each the one that lowers the error most of those in the middle of what is still open,
//! until the bound is kept. In an adaptive scan the likely material is what was measured so far ([`next_pose`]).

use gonio_brdf::{Brdf, Flag, Grid, Meaning, Measured};
use gonio_instrument::{Description, Plan};
use gonio_optics::{Angle, Geometry, colour};
use gonio_render::sphere::LinearImage;
use gonio_render::trace::Gathered;
use rayon::prelude::*;

use crate::choice::of_function;
use crate::pixels::{pixel_differences, spread};

/// Fills the cells that were not measured, as the reduction of a scan does; a coat is told by the table's attribute `coat_index`.
pub type Fill<'a> = &'a (dyn Fn(&mut Measured) + Sync);

/// Largest polar viewing angle that a pose measures, degrees; the rest is continued.
pub const LIMIT_DEG: f64 = 75.0;
/// ΔE that nobody sees, a twentieth of what side by side can just be told apart: allowed beside 5 % where no bound is given.
const ALLOWED: f64 = 0.05;

/// What is asked for.
#[derive(Clone, Copy)]
pub struct PlanOptions<'a> {
    /// How a scan fills its table.
    pub fill: Fill<'a>,
    /// Mean ΔE over the scene's pixels that will do; `None`: that of the full plan, 5 % and 0.05 more.
    pub bound: Option<f64>,
}

/// A set of poses and what it is expected to give.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    /// Tilts, degrees, ascending.
    pub tilt_deg: Vec<f64>,
    /// Mean CIEDE2000 over the pixels of the scene, mean over the likely materials.
    pub delta_e: f64,
}

/// A plan with its evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenePlan {
    /// What `gonio scan` takes.
    pub plan: Plan,
    /// Expectation for the plan.
    pub expected: Expected,
    /// Expectation for the instrument's own plan.
    pub full: Expected,
    /// The bound that was held.
    pub bound: f64,
    /// Whether it is kept.
    pub kept: bool,
    /// Every step on the way: the pose added and the expectation with it.
    pub steps: Vec<(f64, f64)>,
    /// What the scene asks of the instrument.
    pub reach: Reach,
}

/// Shares of the scene's weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reach {
    /// Light and view within what poses measure.
    pub measured: f64,
    /// Measured with light and view exchanged alone (reciprocity).
    pub exchanged: f64,
    /// Neither: continued past the limit.
    pub beyond: f64,
}

/// A plan that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The instrument sees nothing of what counts.
    #[error(
        "{share:.0} % of the scene's light meets the surface or leaves it beyond {limit_deg}°, where this instrument measures nothing (tilts {low}° to {high}°): bring the light to the \
         camera's side, show less of the object's rim, or use an instrument that tilts farther"
    )]
    OutOfReach {
        /// Share of the weight, per cent.
        share: f64,
        /// Limit of the angles, degrees.
        limit_deg: f64,
        /// Lowest tilt.
        low: f64,
        /// Highest tilt.
        high: f64,
    },
    /// No pixel to judge by.
    #[error(
        "no pixel lies wholly on the object and in the light: nothing to plan for; give the scene more pixels"
    )]
    NoPixel,
    /// No material.
    #[error(
        "no likely material was given: name a model or an earlier measurement of a paint like the one to be scanned"
    )]
    NoMaterial,
}

/// What the scene asks of the instrument.
#[must_use]
pub fn reach(scene: &Gathered, instrument: &Description) -> Reach {
    let [_, high] = instrument.holder.tilt_limits_deg;
    let mut out = Reach::default();
    for (g, w) in scene.geometries() {
        let seen = |g: Geometry| g.theta_i.degrees() <= high + 2.5 && g.theta_o.degrees() <= LIMIT_DEG + 1.25;
        if seen(g) {
            out.measured += w;
        } else if seen(g.swapped()) {
            out.exchanged += w;
        } else {
            out.beyond += w;
        }
    }
    out
}

/// A virtual measurement: the rows of `tilts` of `truth`, filled.
#[must_use]
pub fn measured_with(truth: &Measured, tilts: &[f64], fill: Fill<'_>) -> Measured {
    let mut out = truth.clone();
    let [_, no, np] = out.grid.shape();
    for (ti, row) in truth.grid.theta_i_deg.iter().enumerate() {
        let visited = tilts.iter().any(|t| (t - row).abs() < 1e-6);
        for to in 0..no {
            let seen = visited && truth.grid.theta_o_deg[to] <= LIMIT_DEG + 1e-9;
            for phi in 0..np {
                let i = truth.grid.index(ti, to, phi);
                if !seen || truth.flag[i] != Flag::Measured {
                    out.flag[i] = Flag::Invalid;
                    out.values[i] = [0.0; 3];
                }
            }
        }
    }
    fill(&mut out);
    out
}

/// A material that the sample is likely to resemble.
#[derive(Clone, Copy)]
pub struct LikelyMaterial<'a> {
    /// f.
    pub brdf: &'a dyn Brdf,
    /// Refractive index of its coat, 1 for none: tells the filling.
    pub index: f64,
}

/// A likely material's pictures, and the table a perfect scan of every row would give.
struct Likely<'a> {
    table: Measured,
    pictures: Vec<LinearImage>,
    scene: &'a Gathered,
}

impl<'a> Likely<'a> {
    fn new(material: LikelyMaterial<'_>, scene: &'a Gathered, lamp: Angle) -> Self {
        let brdf = material.brdf;
        let mut table = Measured::sampled(Grid::sopp(), brdf);
        table.meaning = Meaning::CellMean { lamp_half_angle: lamp };
        if material.index > 1.0 {
            table.attributes.insert("coat_index".to_owned(), material.index.to_string());
        }
        for (i, s) in table.sigma.iter_mut().enumerate() {
            *s = table.values[i].map(|v| 0.01 * v);
        }
        Self { table, pictures: scene.pictures(&|l, v, out| of_function(brdf, l, v, out)), scene }
    }

    fn error(&self, tilts: &[f64], fill: Fill<'_>) -> Option<f64> {
        let filled = measured_with(&self.table, tilts, fill);
        let made = self.scene.pictures(&|l, v, out| of_function(&filled, l, v, out));
        spread(&pixel_differences(self.scene, &self.pictures, &made)).map(|s| s.mean)
    }
}

fn mean_error(likely: &[Likely<'_>], tilts: &[f64], fill: Fill<'_>) -> Result<f64, PlanError> {
    let mut sum = 0.0;
    for l in likely {
        sum += l.error(tilts, fill).ok_or(PlanError::NoPixel)?;
    }
    Ok(sum / likely.len() as f64)
}

/// Plans a scan for a scene.
///
/// # Errors
/// [`PlanError`].
pub fn plan(
    scene: &Gathered,
    instrument: &Description,
    materials: &[LikelyMaterial<'_>],
    options: PlanOptions<'_>,
) -> Result<ScenePlan, PlanError> {
    if materials.is_empty() {
        return Err(PlanError::NoMaterial);
    }
    let reach = reach(scene, instrument);
    let [low, high] = instrument.holder.tilt_limits_deg;
    if reach.beyond > 0.5 {
        return Err(PlanError::OutOfReach { share: 100.0 * reach.beyond, limit_deg: LIMIT_DEG, low, high });
    }
    let likely: Vec<Likely<'_>> =
        materials.iter().map(|m| Likely::new(*m, scene, instrument.lamp.half_angle())).collect();
    let all = rows_of(&instrument.plan);
    let full = Expected { delta_e: mean_error(&likely, &all, options.fill)?, tilt_deg: all.clone() };
    let bound = options.bound.unwrap_or(1.05 * full.delta_e + ALLOWED);
    let demand = demand(scene);
    let (mut chosen, mut steps, mut left): (Vec<f64>, Vec<(f64, f64)>, Vec<f64>) =
        (Vec::new(), Vec::new(), all);
    let mut error = f64::INFINITY;
    while error > bound && !left.is_empty() {
        let tried = worth_trying(&chosen, &left, &demand);
        let found: Vec<Result<f64, PlanError>> = tried
            .par_iter()
            .map(|tilt| {
                let with: Vec<f64> = chosen.iter().copied().chain([*tilt]).collect();
                mean_error(&likely, &with, options.fill)
            })
            .collect();
        let mut best = (left[0], f64::INFINITY);
        for (tilt, e) in tried.into_iter().zip(found) {
            let e = e?;
            if e < best.1 {
                best = (tilt, e);
            }
        }
        left.retain(|t| *t != best.0);
        chosen.push(best.0);
        error = best.1;
        steps.push(best);
    }
    // a pose taken early may have become superfluous
    for tilt in chosen.clone() {
        let without: Vec<f64> = chosen.iter().copied().filter(|t| *t != tilt).collect();
        if without.is_empty() {
            break;
        }
        let e = mean_error(&likely, &without, options.fill)?;
        if e <= bound {
            (chosen, error) = (without, e);
        }
    }
    chosen.sort_by(f64::total_cmp);
    let max_exposures = exposures(scene, materials).min(instrument.plan.max_exposures);
    let plan = Plan { tilt_deg: chosen.clone(), max_exposures, ..instrument.plan.clone() };
    Ok(ScenePlan {
        plan,
        expected: Expected { tilt_deg: chosen, delta_e: error },
        full,
        bound,
        kept: error <= bound,
        steps,
        reach,
    })
}

/// Most poses that are tried at each step.
const TRIED: usize = 4;

/// The poses that may lower the error most: those in the middle of the gaps between poses already taken, the gaps with the most of the scene's light and the
/// widest first. The first pose is the one nearest to the median of what the scene asks for.
fn worth_trying(chosen: &[f64], left: &[f64], demand: &[(f64, f64)]) -> Vec<f64> {
    let nearest =
        |to: f64, list: &[f64]| list.iter().copied().min_by(|a, b| (a - to).abs().total_cmp(&(b - to).abs()));
    if chosen.is_empty() {
        return nearest(median(demand), left).into_iter().collect();
    }
    let mut edges: Vec<f64> = chosen.to_vec();
    edges.sort_by(f64::total_cmp);
    edges.insert(0, 0.0);
    edges.push(90.0);
    let mut gaps: Vec<(f64, f64)> = edges
        .windows(2)
        .filter_map(|g| {
            let inside: Vec<f64> = left.iter().copied().filter(|t| (g[0]..=g[1]).contains(t)).collect();
            // beside nothing the ends themselves count: the first gap asks for 0, the last for the largest tilt there is
            let middle = nearest(0.5 * (g[0] + g[1]), &inside)?;
            let w: f64 = demand.iter().filter(|d| (g[0]..=g[1]).contains(&d.0)).map(|d| d.1).sum();
            Some((middle, w * (g[1] - g[0]).powi(2)))
        })
        .collect();
    gaps.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut out: Vec<f64> = gaps.into_iter().take(TRIED).map(|g| g.0).collect();
    out.dedup();
    out
}

/// Exposures that a bracket may need for what the scene sees: one for each factor 4.5 between its darkest and its brightest radiance (a hundredth of the
/// light left out at either end), and four to find the middle and to overlap.
fn exposures(scene: &Gathered, materials: &[LikelyMaterial<'_>]) -> u32 {
    let geometries = scene.geometries();
    let range = materials
        .iter()
        .map(|m| {
            let mut seen: Vec<(f64, f64)> = geometries
                .iter()
                .map(|(g, w)| {
                    let (l, v) = g.directions();
                    (colour::luminance(m.brdf.eval(l, v)) * l.z.max(0.0), *w)
                })
                .filter(|s| s.0 > 0.0)
                .collect();
            seen.sort_by(|a, b| a.0.total_cmp(&b.0));
            let at = |share: f64| {
                let mut passed = 0.0;
                seen.iter()
                    .find(|s| {
                        passed += s.1;
                        passed >= share
                    })
                    .map_or(1.0, |s| s.0)
            };
            at(0.99) / at(0.01)
        })
        .fold(1.0, f64::max);
    4 + (range.ln() / 4.5f64.ln()).ceil().clamp(0.0, 60.0) as u32
}

/// Tilts of a plan, each once.
fn rows_of(plan: &Plan) -> Vec<f64> {
    let mut out = plan.tilt_deg.clone();
    out.sort_by(f64::total_cmp);
    out.dedup();
    out
}

/// What an adaptive scan does next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Next {
    /// The pose that the uncertainty asks for most, its tilt in degrees; `None` where no pose is left.
    pub tilt_deg: Option<f64>,
    /// Expected mean ΔE of the scene as things stand.
    pub expected: f64,
}

/// The next pose of an adaptive scan. `measured` holds the rows visited so far (others invalid), `left` the tilts that could follow.
///
/// The uncertainty is found by leaving out: each measured row is predicted from the others, and what that does to the scene's pictures tells how much a row that is
/// as far from its neighbours is off. The pose asked for is the one in the middle of the gap that carries most of the expected error, weighted with the light of
/// the scene that falls into the gap. With one row alone nothing is known of the error: it is taken as 100.
#[must_use]
pub fn next_pose(scene: &Gathered, measured: &Measured, left: &[f64], fill: Fill<'_>) -> Next {
    let rows: Vec<f64> = measured
        .grid
        .theta_i_deg
        .iter()
        .enumerate()
        .filter(|(ti, _)| {
            let first = measured.grid.index(*ti, 0, 0);
            let one = measured.grid.theta_o_deg.len() * measured.grid.phi_deg.len();
            measured.flag[first..first + one].iter().filter(|f| **f == Flag::Measured).count() * 4 > one
        })
        .map(|r| *r.1)
        .collect();
    let demand = demand(scene);
    let weight =
        |from: f64, to: f64| demand.iter().filter(|d| d.0 > from && d.0 < to).map(|d| d.1).sum::<f64>();
    if rows.len() < 2 {
        let middle = median(&demand);
        let far = |t: &f64| {
            rows.first().map_or(-(t - middle).abs(), |r| (t - r).abs() * weight(t - 20.0, t + 20.0).sqrt())
        };
        let tilt = left.iter().copied().max_by(|a, b| far(a).total_cmp(&far(b)));
        return Next { tilt_deg: tilt, expected: 100.0 };
    }
    let mut full = measured.clone();
    fill(&mut full);
    let reference = scene.pictures(&|l, v, out| of_function(&full, l, v, out));
    // ΔE of the pictures per unit of the scene's weight in the gap and squared width, from each row left out
    let mut rates = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        let others: Vec<f64> = rows.iter().copied().filter(|r| r != row).collect();
        let (before, after) =
            (if k == 0 { 0.0 } else { rows[k - 1] }, rows.get(k + 1).copied().unwrap_or(90.0));
        let filled = measured_with(measured, &others, fill);
        let made = scene.pictures(&|l, v, out| of_function(&filled, l, v, out));
        let Some(e) = spread(&pixel_differences(scene, &reference, &made)) else { continue };
        let (width, w) = (after - before, weight(before, after).max(1e-3));
        rates.push((*row, e.mean / (w * width * width)));
    }
    let rate_at = |tilt: f64| {
        rates.iter().min_by(|a, b| (a.0 - tilt).abs().total_cmp(&(b.0 - tilt).abs())).map_or(0.0, |r| r.1)
    };
    let (mut expected, mut best) = (0.0, (None, 0.0));
    let edges: Vec<f64> = [0.0].into_iter().chain(rows.iter().copied()).chain([90.0]).collect();
    for gap in edges.windows(2) {
        let (from, to) = (gap[0], gap[1]);
        let error = rate_at(0.5 * (from + to)) * weight(from, to) * (to - from) * (to - from);
        expected += error;
        let middle = 0.5 * (from + to);
        let inside = left.iter().copied().filter(|t| *t > from - 1e-9 && *t < to + 1e-9);
        if let Some(t) = inside.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()))
            && error > best.1
        {
            best = (Some(t), error);
        }
    }
    Next { tilt_deg: best.0.or_else(|| left.first().copied()), expected }
}

/// How much of the scene's weight asks for each angle of incidence; of light and view either will do, so each takes half.
fn demand(scene: &Gathered) -> Vec<(f64, f64)> {
    scene
        .geometries()
        .into_iter()
        .flat_map(|(g, w)| [(g.theta_i.degrees(), 0.5 * w), (g.theta_o.degrees(), 0.5 * w)])
        .collect()
}

fn median(demand: &[(f64, f64)]) -> f64 {
    let mut all = demand.to_vec();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * all.iter().map(|d| d.1).sum::<f64>();
    let mut passed = 0.0;
    all.iter()
        .find(|d| {
            passed += d.1;
            passed >= half
        })
        .map_or(45.0, |d| d.0)
}
