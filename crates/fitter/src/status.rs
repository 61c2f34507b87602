//! How a fit ended, as a name and as a sentence.

use crate::Fit;

/// How a fit ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// A minimum inside all bounds.
    Converged,
    /// The minimum lies on a bound of these parameters (colours at 0; a nonlinear parameter at an end of its range).
    AtBound(Vec<&'static str>),
    /// The data do not tell some parameters apart; their uncertainties say which.
    IllConditioned,
    /// The search did not come to rest within its steps: the parameters are the best it saw.
    Stalled,
    /// No measurement took part: nothing valid within the limit (or, with weights `sigma`, nothing with σ).
    NoData,
    /// Fewer values than parameters.
    TooFewData {
        /// Values of one channel.
        values: usize,
        /// Parameters of one channel.
        parameters: usize,
    },
    /// The sum of squares is not a number: values too large to square.
    NonFinite,
    /// The model cannot be fitted to data of this kind.
    NotApplicable(Reason),
}

/// Why a model cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reason {
    /// An anisotropic model needs azimuths of light and view, the data hold their difference.
    NoAzimuths,
    /// The given index of the coat is no index.
    CoatIndex,
}

impl Status {
    /// Name in files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::AtBound(_) => "at-bound",
            Self::IllConditioned => "ill-conditioned",
            Self::Stalled => "stalled",
            Self::NoData => "no-data",
            Self::TooFewData { .. } => "too-few-data",
            Self::NonFinite => "non-finite",
            Self::NotApplicable(_) => "not-applicable",
        }
    }

    /// Whether there are parameters at all; without them the model of the fit is black.
    #[must_use]
    pub const fn is_fitted(&self) -> bool {
        matches!(self, Self::Converged | Self::AtBound(_) | Self::IllConditioned | Self::Stalled)
    }
}

impl Fit {
    /// What the status means and what can be done, in a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        match &self.status {
            Status::Converged => "the fit converged; the data determine every parameter".to_owned(),
            Status::AtBound(names) => format!(
                "the best fit lies at the bound of {}; the model has no better answer inside",
                names.join(", ")
            ),
            Status::IllConditioned => format!(
                "the data do not tell all parameters apart (condition {:.1e}); see their uncertainties",
                self.condition
            ),
            Status::Stalled => {
                "the search did not come to rest; the parameters are the best it saw: try other weights or a simpler model"
                    .to_owned()
            }
            Status::NoData => {
                "no measured cell took part within the angle limit; nothing was fitted: widen the limit, include filled cells, or choose weights that need no uncertainties"
                    .to_owned()
            }
            Status::TooFewData { values, parameters } => format!(
                "{values} values cannot determine {parameters} parameters; nothing was fitted: choose a simpler model or measure more geometries"
            ),
            Status::NonFinite => "the values are too large to be squared; nothing was fitted".to_owned(),
            Status::NotApplicable(Reason::NoAzimuths) => {
                "an anisotropic model needs the azimuths of light and view, and these data hold their difference alone; nothing was fitted"
                    .to_owned()
            }
            Status::NotApplicable(Reason::CoatIndex) => {
                "the index of a coat must be a finite number above 1; nothing was fitted".to_owned()
            }
        }
    }
}
