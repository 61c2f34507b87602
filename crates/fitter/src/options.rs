//! What to fit and how the cells count.

use std::str::FromStr;

use gonio_optics::Angle;

use crate::{CoatChoice, ModelChoice};

/// How a cell counts in the sum of squares. w is its solid angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Weights {
    /// Sopp (4.25): the residual is multiplied by w cos θi, so its square by (w cos θi)².
    Sopp,
    /// Ngan (3.5): the square is multiplied by w cos² θi.
    #[default]
    Ngan,
    /// The inverse variance of the cell; cells without σ do not take part.
    Sigma,
    /// The logarithm is fitted: Σ w (ln f − ln y)²; cells with a value ≤ 0 (or below 1e-6 of the mean) do not take part.
    LogRelative,
    /// Every cell alike.
    None,
}

/// A name that is no model or no weight.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot fit with {what} \"{found}\": use one of {known}")]
pub struct UnknownName {
    what: &'static str,
    found: String,
    known: String,
}

impl Weights {
    /// All weights with their names on the command line.
    pub const ALL: [(&'static str, Self); 5] = [
        ("sopp", Self::Sopp),
        ("ngan", Self::Ngan),
        ("sigma", Self::Sigma),
        ("log-relative", Self::LogRelative),
        ("none", Self::None),
    ];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sopp => "sopp",
            Self::Ngan => "ngan",
            Self::Sigma => "sigma",
            Self::LogRelative => "log-relative",
            Self::None => "none",
        }
    }
}

pub(crate) fn find<T: Copy>(
    all: &[(&'static str, T)],
    what: &'static str,
    found: &str,
) -> Result<T, UnknownName> {
    all.iter().find(|(name, _)| *name == found).map(|&(_, v)| v).ok_or_else(|| UnknownName {
        what,
        found: found.to_owned(),
        known: all.iter().map(|(n, _)| *n).collect::<Vec<_>>().join(", "),
    })
}

impl FromStr for Weights {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, "weights", s)
    }
}

/// How a residual that is far larger than the others counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Loss {
    /// By its square: least squares.
    #[default]
    Squares,
    /// Huber: by its size beyond 1.345 robust standard deviations.
    Huber,
    /// Cauchy: by its logarithm, from 2.385 robust standard deviations on.
    Cauchy,
    /// Tukey's biweight: not at all beyond 4.685 robust standard deviations.
    Tukey,
}

impl Loss {
    /// All losses with their names on the command line.
    pub const ALL: [(&'static str, Self); 4] = [
        ("squares", Self::Squares),
        ("huber", Self::Huber),
        ("cauchy", Self::Cauchy),
        ("tukey", Self::Tukey),
    ];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Squares => "squares",
            Self::Huber => "huber",
            Self::Cauchy => "cauchy",
            Self::Tukey => "tukey",
        }
    }
}

impl FromStr for Loss {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, "loss", s)
    }
}

/// Options of a fit; `Options::default()` fits the simplified Ashikhmin–Shirley model with Ngan's weights up to 75°.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Which model.
    pub model: ModelChoice,
    /// A clear coat over it.
    pub coat: CoatChoice,
    /// How cells count.
    pub weights: Weights,
    /// How outliers count.
    pub loss: Loss,
    /// Cells with θi or θo beyond this are left out (Sopp: 75°).
    pub max_angle: Angle,
    /// Take filled and extrapolated cells as well.
    pub include_filled: bool,
    /// Relative standard uncertainty common to all cells (reference, lamp, gain): added to the covariance of cd and cs. `None` takes the
    /// attribute `common_relative_uncertainty` of the data, 0 where there is none.
    pub common_relative_uncertainty: Option<f64>,
    /// Exponents searched, within 0.1 … 1e6, and widths alpha ≥ √(2/(n + 2)) of the largest. Beyond 8.1e3, the default, lamp and cells of 2.5° hide the lobe;
    /// node values of sharper functions may need more.
    pub exponent_range: (f64, f64),
}

impl Default for Options {
    fn default() -> Self {
        Self {
            model: ModelChoice::default(),
            coat: CoatChoice::None,
            weights: Weights::default(),
            loss: Loss::Squares,
            max_angle: Angle::from_degrees(75.0),
            include_filled: false,
            common_relative_uncertainty: None,
            exponent_range: (1.0, 8.1e3),
        }
    }
}

/// Smallest exponent that may be asked for: next to a constant.
const SMALLEST_EXPONENT: f64 = 0.1;
/// Largest exponent that may be asked for: beyond, a lobe is a mirror to any table of nodes.
const LARGEST_EXPONENT: f64 = 1e6;

impl Options {
    /// The range of the exponent, whatever the caller asks for.
    pub(crate) fn exponents(&self) -> (f64, f64) {
        let end =
            |x: f64, other: f64| if x > 0.0 { x.clamp(SMALLEST_EXPONENT, LARGEST_EXPONENT) } else { other };
        let (low, high) = (end(self.exponent_range.0, 1.0), end(self.exponent_range.1, 8.1e3));
        if low < high { (low, high) } else { (1.0, LARGEST_EXPONENT) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_wrong_ones_answered() {
        for (name, w) in Weights::ALL {
            assert_eq!((name.parse(), w.name()), (Ok(w), name));
        }
        for (name, l) in Loss::ALL {
            assert_eq!((name.parse(), l.name()), (Ok(l), name));
        }
        let e = "hubert".parse::<Loss>().unwrap_err().to_string();
        assert!(e.contains("\"hubert\"") && e.contains("tukey"), "{e}");
    }
}
