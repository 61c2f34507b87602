//! A car paint for a measured BRDF, without starting values: lobes on brightness, then colours (Günther et al. 2005; Rump et al. 2008).
//!
//! 1. Flake textures are brought to the level of the measurement where what lies between the flakes is known ([`FlakeLevel`]); what they add on average is
//!    taken off.
//! 2. Lambert and up to three Cook–Torrance lobes under the coat are fitted to the mean of the three channels ([`gonio_fitter`]): widths, r0 and grey coefficients.
//! 3. χ(θh̄, θī) takes up what is left, per channel: the factor on the nodes of a table that brings the base closest to the measurement, found by weighted
//!    least squares of the relative error with a penalty on its curvature, which also fills nodes no measurement touches.
//!
//! Cell means are compared with means over cell and lamp: the base's own mean comes out of the fit of the lobes, χ is taken at the centre of the cell (it
//! varies far slower than a lobe).

mod colour;
mod level;
mod relative;
mod subject;
#[cfg(test)]
mod tests;

use gonio_brdf::{Coat, Model, Rgb};
use gonio_fitter::{Assessment, CoatChoice, Fit, ModelChoice, Options, Weights, assess_brdf};

use crate::car_paint::{CarPaint, CarPaintError, CarPaintParts, Flakes, Through};

pub use level::FlakeLevel;
pub use subject::Subject;

/// How a paint is fitted.
#[derive(Clone, Debug)]
pub struct PaintOptions {
    /// Name of the paint.
    pub name: String,
    /// Coat, weights and limit of angle of the lobes' fit; its model is of no account.
    pub lobes: Options,
    /// Number of lobes, 1…3.
    pub lobe_count: u8,
    /// Nodes of χ in half angle and angle of incidence; `None` for a paint without χ (the lobes have colours of their own then).
    pub colour_nodes: Option<[usize; 2]>,
    /// Flakes, whose mean the measurement contains.
    pub flakes: Option<Flakes>,
    /// What lies between the flakes of each slice, in order of half angle, then angle of incidence, 1/sr ([`crate::flake_floor`]): with it textures are
    /// brought to the level of the measurement, without it they stay as they are.
    pub flake_floors: Option<Vec<Rgb>>,
}

impl Default for PaintOptions {
    fn default() -> Self {
        Self {
            name: String::new(),
            lobes: Options { weights: Weights::LogRelative, ..Options::default() },
            lobe_count: 3,
            colour_nodes: Some([24, 16]),
            flakes: None,
            flake_floors: None,
        }
    }
}

/// A fitted paint and what is known of the fit.
#[derive(Clone, Debug)]
pub struct PaintFit {
    /// The paint.
    pub paint: CarPaint,
    /// The fit of its lobes: to the mean of the channels, or to each channel where there is no χ.
    pub lobes: Fit,
    /// Errors of the whole paint against the measurement, averaged over cells as the data say.
    pub errors: Assessment,
    /// Share of χ's nodes that a measurement touches; 0 without χ.
    pub nodes_seen: f64,
    /// By what factors the flake textures were brought to the level of the measurement; `None` where they stayed.
    pub flake_level: Option<FlakeLevel>,
}

/// A paint that could not be fitted.
#[derive(Debug, thiserror::Error)]
pub enum PaintFitError {
    /// The lobes could not be.
    #[error("the lobes of the paint could not be fitted: {0}")]
    Lobes(String),
    /// The mean of flakes cannot be taken off while the index of the coat is open.
    #[error(
        "flakes lie under a coat of known index: give its index (1.5 for clear coats) instead of fitting it"
    )]
    FlakesNeedIndex,
    /// The parts found make no paint.
    #[error(transparent)]
    Paint(#[from] CarPaintError),
}

/// Fits a paint to a measurement.
///
/// # Errors
/// [`PaintFitError`] where the lobes cannot be fitted, with why.
pub fn fit_paint(subject: &Subject<'_>, options: &PaintOptions) -> Result<PaintFit, PaintFitError> {
    let coat = match options.lobes.coat {
        CoatChoice::Index(n) => Some(Coat { index: n }),
        _ => None,
    };
    let whole = subject.to_owned_data();
    let mut without_flakes = whole.clone();
    let mut flakes = options.flakes.clone();
    let mut flake_level = None;
    if let Some(known) = &mut flakes {
        if options.lobes.coat == CoatChoice::Fitted {
            return Err(PaintFitError::FlakesNeedIndex);
        }
        if let (Flakes::Slices(slices), Some(floors)) = (&*known, &options.flake_floors) {
            let mut below_gloss = whole.clone();
            if let Some(coat) = coat {
                below_gloss.subtract_gloss(coat);
            }
            let (brought, told) = level::bring([&whole, &below_gloss], slices, floors, coat)?;
            *known = Flakes::Slices(brought);
            flake_level = Some(told);
        }
        without_flakes.subtract(known, coat)?;
    }
    let model = ModelChoice::CookTorrance(options.lobe_count.clamp(1, 3));
    let lobe_options = Options { model, ..options.lobes.clone() };
    let lobes = if options.colour_nodes.is_some() {
        gonio_fitter::fit(&without_flakes.grey().observations(), &lobe_options)
    } else {
        gonio_fitter::fit(&without_flakes.observations(), &lobe_options)
    };
    if !lobes.status.is_fitted() {
        return Err(PaintFitError::Lobes(lobes.sentence()));
    }
    let Model::CookTorrance(base) = &lobes.model else {
        return Err(PaintFitError::Lobes(format!("the fit gave a {} instead", lobes.model.name())));
    };
    let mut parts = CarPaintParts {
        name: options.name.clone(),
        coat: lobes.coat,
        through: Through::TwoWay,
        diffuse: base.diffuse,
        lobes: base.lobes.iter().copied().filter(|l| l.specular != [0.0; 3]).collect(),
        colour: None,
        flakes,
    };
    let mut nodes_seen = 0.0;
    if let Some(nodes) = options.colour_nodes {
        let index = lobes.coat.map_or(1.0, |c| c.index);
        let (table, seen) = colour::solve(&without_flakes.rows(&lobes, &whole), index, nodes)?;
        parts.colour = Some(table);
        nodes_seen = seen;
    }
    let paint = CarPaint::new(parts)?;
    let errors = judge(subject, &lobe_options, &paint);
    Ok(PaintFit { paint, lobes, errors, nodes_seen, flake_level })
}

/// Errors of a paint against a measurement: the gloss of its coat is taken off the measurement first, as the paint has none.
#[must_use]
pub fn judge(subject: &Subject<'_>, options: &Options, paint: &CarPaint) -> Assessment {
    let mut data = subject.to_owned_data();
    if let Some(coat) = paint.parts().coat {
        data.subtract_gloss(coat);
    }
    assess_brdf(&data.observations(), options, paint)
}
