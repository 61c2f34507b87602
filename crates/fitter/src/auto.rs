//! Choice by itself: the simplest model that keeps the colour difference on held-out angles of incidence within the user's bound.
//!
//! Every candidate is fitted twice, each time to every other angle of incidence, and judged on the angles it has not seen; so a model that only
//! bends to its data gains nothing. Among those whose mean CIEDE2000 is within the bound the one with the fewest parameters is taken (of equals
//! the one with the smaller difference) and fitted to all data. Where none is, the one with the smallest difference is taken and said to miss the bound.

use std::time::Instant;

use gonio_brdf::{Brdf, ModelFile};
use gonio_optics::Geometry;

use crate::{
    ColourErrors, Fit, ModelChoice, Observations, Options, Status, assess, colour_error::Pair, fit::fit,
};

/// Candidates in the order they are tried: fewer parameters first.
pub const CANDIDATES: [ModelChoice; 15] = [
    ModelChoice::Lambert,
    ModelChoice::OrenNayar,
    ModelChoice::AshikhminShirleySimplified,
    ModelChoice::BlinnPhong,
    ModelChoice::Ward,
    ModelChoice::WardDuer,
    ModelChoice::LambertAshikhminShirley,
    ModelChoice::AshikhminShirley,
    ModelChoice::CookTorrance(1),
    ModelChoice::Ggx(1),
    ModelChoice::Lafortune(1),
    ModelChoice::CookTorrance(2),
    ModelChoice::Ggx(2),
    ModelChoice::CookTorrance(3),
    ModelChoice::Ggx(3),
];

/// A model that was considered.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Which.
    pub choice: ModelChoice,
    /// Free parameters, colours counted per channel.
    pub parameters: usize,
    /// Colour differences on held-out angles; `None` where it was not tried because a simpler one is good enough, or could not be fitted.
    pub held_out: Option<ColourErrors>,
    /// How its fit ended; `None` where it was not tried.
    pub status: Option<Status>,
    /// Nanoseconds an evaluation from vectors takes here (the fastest of several runs).
    pub nanoseconds: Option<f64>,
}

/// What was chosen, and among what.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The chosen model, fitted to all data.
    pub fit: Fit,
    /// Place of the chosen one among the candidates.
    pub place: usize,
    /// Whether its difference is within the bound.
    pub within: bool,
    /// All candidates.
    pub candidates: Vec<Candidate>,
    /// What was held out, in words.
    pub held_out: &'static str,
}

impl Candidate {
    /// Mean CIEDE2000 over all held-out cells.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        self.held_out.and_then(|h| h.all).map(|s| s.mean)
    }
}

/// Chooses among [`CANDIDATES`]. `options.model` is of no account.
///
/// Data that cannot be split (one angle only, or next to nothing) are judged on themselves, and `held_out` says so.
#[must_use]
pub fn choose(obs: &Observations, options: &Options, max_delta_e: f64) -> Chosen {
    let (folds, held_out) = folds(obs);
    let mut candidates: Vec<Candidate> = Vec::with_capacity(CANDIDATES.len());
    let mut good_enough: Option<usize> = None;
    for choice in CANDIDATES {
        let options = Options { model: choice, ..options.clone() };
        let parameters = parameter_count(choice);
        let enough = good_enough.is_some_and(|p| parameters > p);
        let tried = if enough { None } else { judge(&folds, &options) };
        let mean = tried.as_ref().and_then(|t| t.0.all).map(|s| s.mean);
        if mean.is_some_and(|m| m <= max_delta_e) && good_enough.is_none_or(|p| parameters < p) {
            good_enough = Some(parameters);
        }
        let status = tried.as_ref().map(|t| t.1.clone());
        let nanoseconds = tried.as_ref().map(|t| cost(&t.2));
        candidates.push(Candidate { choice, parameters, held_out: tried.map(|t| t.0), status, nanoseconds });
    }
    let best = |fits: &dyn Fn(&Candidate) -> bool| {
        candidates
            .iter()
            .enumerate()
            .filter(|(_, c)| fits(c))
            .filter_map(|(i, c)| Some((i, c.mean()?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(i, _)| i)
    };
    let simplest = good_enough.and_then(|p| best(&|c| c.parameters == p));
    let place = simplest.or_else(|| best(&|_| true)).unwrap_or(0);
    let choice = candidates.get(place).map_or(ModelChoice::Lambert, |c| c.choice);
    let fit = fit(obs, &Options { model: choice, ..options.clone() });
    Chosen { fit, place, within: simplest.is_some(), candidates, held_out }
}

/// Parameters with every colour counted three times.
#[must_use]
pub fn parameter_count(choice: ModelChoice) -> usize {
    match choice {
        ModelChoice::Lambert => 3,
        ModelChoice::OrenNayar => 4,
        ModelChoice::AshikhminShirleySimplified
        | ModelChoice::Auto
        | ModelChoice::Phong
        | ModelChoice::BlinnPhong
        | ModelChoice::Ward
        | ModelChoice::WardDuer => 7,
        ModelChoice::LambertAshikhminShirley | ModelChoice::AshikhminShirley => 8,
        ModelChoice::AshikhminShirleyAnisotropic => 9,
        ModelChoice::CookTorrance(n) | ModelChoice::Ggx(n) | ModelChoice::Lafortune(n) => {
            3 + 5 * usize::from(n.clamp(1, crate::MAX_LOBES))
        }
    }
}

/// Pairs of what is fitted and what it is judged on.
fn folds(obs: &Observations) -> (Vec<(Observations, Observations)>, &'static str) {
    let by_incidence = split(obs, |g| g.theta_i.degrees());
    if let Some(folds) = by_incidence {
        return (folds, "every other angle of incidence");
    }
    if let Some(folds) = split(obs, |g| g.theta_o.degrees()) {
        return (folds, "every other viewing angle");
    }
    (vec![(obs.clone(), obs.clone())], "nothing: the data cannot be split")
}

/// Even and odd places of the sorted angles (told apart to 0.5°), each judged by the other; `None` for fewer than four angles.
fn split(obs: &Observations, angle: impl Fn(&Geometry) -> f64) -> Option<Vec<(Observations, Observations)>> {
    let half_degrees = |g: &Geometry| (2.0 * angle(g)).round() as i64;
    let mut angles: Vec<i64> = obs.data.iter().map(|d| half_degrees(&d.geometry)).collect();
    angles.sort_unstable();
    angles.dedup();
    if angles.len() < 4 {
        return None;
    }
    let part = |odd: bool| {
        let mut part = obs.clone();
        part.data
            .retain(|d| angles.binary_search(&half_degrees(&d.geometry)).is_ok_and(|k| (k % 2 == 1) == odd));
        part
    };
    let (even, odd) = (part(false), part(true));
    Some(vec![(even.clone(), odd.clone()), (odd, even)])
}

/// Differences over all folds, the last status and model; `None` where a fold could not be fitted.
fn judge(
    folds: &[(Observations, Observations)],
    options: &Options,
) -> Option<(ColourErrors, Status, ModelFile)> {
    let mut pairs: Vec<Pair> = Vec::new();
    let mut last = None;
    for (seen, unseen) in folds {
        let found = fit(seen, options);
        if !found.status.is_fitted() {
            return None;
        }
        let file = ModelFile { model: found.model, coat: found.coat, fit: None };
        pairs.extend(assess::pairs(unseen, options, &file));
        last = Some((found.status, file));
    }
    let (status, file) = last?;
    Some((ColourErrors::of(&pairs), status, file))
}

/// Nanoseconds per evaluation: the fastest of seven runs over 1,000 geometries.
fn cost(file: &ModelFile) -> f64 {
    let directions: Vec<_> = (0..1000)
        .map(|k| {
            let t = f64::from(k);
            Geometry::from_degrees((t * 7.3) % 80.0, (t * 11.9) % 80.0, (t * 31.7) % 180.0).directions()
        })
        .collect();
    let mut best = f64::INFINITY;
    for _ in 0..7 {
        let start = Instant::now();
        let mut sum = 0.0;
        for (l, v) in &directions {
            sum += file.eval(*l, *v)[1];
        }
        std::hint::black_box(sum);
        best = best.min(start.elapsed().as_nanos() as f64 / directions.len() as f64);
    }
    best
}
