//! Sopp's own method (thesis, 4.2.3–4.2.4), kept as he describes it, to be compared with.
//!
//! ```text
//! a ← a − (DᵀD + λ diag DᵀD)⁻¹ Dᵀ r                 (4.8); λ starts at 1e-3, doubles after a worse step until it exceeds 1,
//!                                                    halves after a better one until it falls below 1e-4; worse steps are dropped
//! stage 1: n, cd, cs on the mean of the channels    (4.26), r = w cos θi (R − M)/Σw, or R − M without weights
//! stage 2: cd, cs of each channel, n fixed          (4.27), from the values of stage 1
//! ```
//!
//! Values are compared at the nodes. n·h below 1e-4 is set to it. Start values are the user's; his own were cd = cs = 0.2 and n = 25…250. A number
//! of iterations (500) is the only end. For the full form (4.17, 4.18) stage 1 is run without Fresnel first; its result, with R_s as another
//! unknown, starts a second run whose parameters are kept within limits ("brute force", 5.0.1).
//!
//! Use [`crate::fit`] for results: this one needs luck with its start values, as `docs/fitting.md` shows.

mod iteration;

use gonio_brdf::{
    Model,
    models::{AshikhminShirley, AshikhminShirleySimplified},
};
use gonio_optics::COS_FLOOR;

use crate::{Fit, ModelChoice, Observations, Options, Weights, fit::fit_by, observations::Datum, solve};

pub use iteration::{Ended, Stage};
use iteration::{Form, Node, Point, iterate};

/// What the user of the method has to choose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoppOptions {
    /// Start value of n.
    pub exponent: f64,
    /// Start value of cd.
    pub diffuse: f64,
    /// Start value of cs.
    pub specular: f64,
    /// Start value of R_s; `None` fits the simplified form (4.28).
    pub r0: Option<f64>,
    /// Iterations of each stage.
    pub iterations: usize,
    /// Start value of λ.
    pub lambda: f64,
    /// λ is doubled until it exceeds this: 1 in the thesis.
    pub lambda_max: f64,
    /// Keep parameters within limits (cd, cs ≥ 0, 1 ≤ n ≤ 1e5, 0 ≤ R_s ≤ 1) in the simplified form too.
    pub limited: bool,
    /// End after the mean of the channels: n, and cd and cs of the mean for all three.
    pub mean_only: bool,
}

impl Default for SoppOptions {
    fn default() -> Self {
        Self {
            exponent: 25.0,
            diffuse: 0.2,
            specular: 0.2,
            r0: None,
            iterations: 500,
            lambda: 1e-3,
            lambda_max: 1.0,
            limited: false,
            mean_only: false,
        }
    }
}

/// What came out.
#[derive(Clone, Debug)]
pub struct SoppRun {
    /// n.
    pub exponent: f64,
    /// R_s; `None` for the simplified form.
    pub r0: Option<f64>,
    /// cd per channel; may be negative.
    pub diffuse: [f64; 3],
    /// cs per channel; may be negative.
    pub specular: [f64; 3],
    /// Each run of the iteration: one or two on the mean, then red, green, blue.
    pub stages: Vec<Stage>,
    /// Nodes that took part.
    pub cells: usize,
}

impl SoppRun {
    /// Whether every stage settled where the residual is at a right angle to all derivatives.
    #[must_use]
    pub fn succeeded(&self) -> bool {
        !self.stages.is_empty() && self.stages.iter().all(|s| s.ended == Ended::Settled)
    }

    /// The model, with parameters moved into their bounds where the iteration left them.
    #[must_use]
    pub fn model(&self) -> Model {
        let inside = |c: [f64; 3]| c.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 });
        let (diffuse, specular) = (inside(self.diffuse), inside(self.specular));
        let exponent = if self.exponent.is_finite() { self.exponent.clamp(0.0, 1e9) } else { 0.0 };
        match self.r0 {
            None => {
                Model::AshikhminShirleySimplified(AshikhminShirleySimplified { diffuse, specular, exponent })
            }
            Some(r0) => {
                let r0 = if r0.is_finite() { r0.clamp(0.0, 1.0) } else { 0.0 };
                Model::AshikhminShirley(AshikhminShirley { diffuse, specular, exponent, r0 })
            }
        }
    }
}

/// Runs the method. Weights `none` leaves the residual as it is; any other weighs it as (4.25) does, which is the only weight he had.
///
/// Never panics on data; without any, the run has no stage.
#[must_use]
pub fn sopp(obs: &Observations, options: &Options, sopp: &SoppOptions) -> SoppRun {
    let limit = options.max_angle.degrees() + 1e-9;
    let chosen: Vec<&Datum> = obs
        .data
        .iter()
        .filter(|d| d.geometry.theta_i.degrees() <= limit && d.geometry.theta_o.degrees() <= limit)
        .filter(|d| d.flag == gonio_brdf::Flag::Measured || options.include_filled)
        .collect();
    let total: f64 = chosen.iter().map(|d| d.solid_angle).sum();
    let weighted = options.weights != Weights::None && total > 0.0;
    let nodes: Vec<Node> = chosen.iter().map(|d| node(d, weighted.then_some(total))).collect();
    let mut run = SoppRun {
        exponent: sopp.exponent,
        r0: None,
        diffuse: [sopp.diffuse; 3],
        specular: [sopp.specular; 3],
        stages: Vec::new(),
        cells: nodes.len(),
    };
    if nodes.is_empty() {
        return run;
    }
    let mean: Vec<f64> = chosen.iter().map(|d| d.value.iter().sum::<f64>() / 3.0).collect();
    let start = Point { exponent: sopp.exponent, diffuse: sopp.diffuse, specular: sopp.specular, r0: 0.0 };
    let simple = Form { fresnel: false, exponent_fixed: false, limited: sopp.limited };
    let (mut found, stage) = iterate("mean", &nodes, &mean, start, simple, sopp);
    run.stages.push(stage);
    let fresnel = sopp.r0.is_some();
    if let Some(r0) = sopp.r0 {
        let form = Form { fresnel: true, exponent_fixed: false, limited: true };
        // the simplified result in the words of the full form: the conversion of the thesis
        let start = Point { r0, ..found };
        let (again, stage) = iterate("mean, Fresnel", &nodes, &mean, start, form, sopp);
        run.stages.push(stage);
        run.r0 = Some(again.r0);
        found = again;
    }
    run.exponent = found.exponent;
    if sopp.mean_only {
        run.diffuse = [found.diffuse; 3];
        run.specular = [found.specular; 3];
        return run;
    }
    for (c, name) in ["red", "green", "blue"].into_iter().enumerate() {
        let values: Vec<f64> = chosen.iter().map(|d| d.value[c]).collect();
        let form = Form { fresnel, exponent_fixed: true, limited: sopp.limited || fresnel };
        let (channel, stage) = iterate(name, &nodes, &values, found, form, sopp);
        run.diffuse[c] = channel.diffuse;
        run.specular[c] = channel.specular;
        run.stages.push(stage);
    }
    run
}

/// The run as a [`Fit`], so that its errors, colour differences and residuals can be compared; a run that did not settle is `stalled`.
///
/// The errors are those of the model averaged as the data say, with the weights of `options`.
#[must_use]
pub fn as_fit(obs: &Observations, options: &Options, run: &SoppRun) -> Fit {
    let (diffuse, specular) = match run.model() {
        Model::AshikhminShirley(m) => (m.diffuse, m.specular),
        Model::AshikhminShirleySimplified(m) => (m.diffuse, m.specular),
        _ => ([0.0; 3], [0.0; 3]),
    };
    let choice = match run.r0 {
        Some(_) => ModelChoice::AshikhminShirley,
        None => ModelChoice::AshikhminShirleySimplified,
    };
    fit_by(obs, options, choice, &|family| {
        let at: Vec<f64> = family
            .parameters
            .iter()
            .map(|p| {
                let value = if p.name == "r0" { run.r0.unwrap_or(1.0) } else { run.exponent };
                let (low, high) = p.walked();
                let q = value.max(f64::MIN_POSITIVE).ln();
                if q.is_finite() { q.clamp(low, high) } else { low }
            })
            .collect();
        solve::at(obs, options, family, &at, Some(&[diffuse, specular]), run.succeeded())
    })
}

fn node(d: &Datum, total: Option<f64>) -> Node {
    let (l, v) = d.geometry.directions();
    let sum = l + v;
    // opposite grazing directions: the half vector is taken for the normal
    let h = if sum.norm() > 1e-12 { sum.normalized() } else { gonio_optics::Vec3::Z };
    let hv = h.dot(v).max(COS_FLOOR);
    let denominator = 8.0 * std::f64::consts::PI * hv * l.z.max(v.z).max(COS_FLOOR);
    Node {
        ln_nh: h.z.max(1e-4).ln(),
        shape: denominator.recip(),
        grazing: (1.0 - hv).max(0.0).powi(5),
        diffuse_full: AshikhminShirley::diffuse_term(0.0, l, v),
        weight: total.map_or(1.0, |t| d.solid_angle * d.geometry.theta_i.cos() / t),
    }
}
