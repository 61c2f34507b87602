//! What to fit and how the cells count.

use std::str::FromStr;

use gonio_optics::Angle;

/// Which model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ModelChoice {
    /// `lambert`.
    Lambert,
    /// `ashikhmin-shirley-simplified`, Sopp (4.28).
    #[default]
    AshikhminShirleySimplified,
    /// `lambert-ashikhmin-shirley` with r0 fitted.
    LambertAshikhminShirley,
    /// `ashikhmin-shirley`, Sopp (4.17) + (4.18), r0 fitted.
    AshikhminShirley,
    /// `auto`: `ashikhmin-shirley-simplified`, or `lambert` where the data hold no lobe (its cs within two standard uncertainties of 0).
    Auto,
}

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

impl ModelChoice {
    /// All choices with their names on the command line.
    pub const ALL: [(&'static str, Self); 5] = [
        ("lambert", Self::Lambert),
        ("ashikhmin-shirley-simplified", Self::AshikhminShirleySimplified),
        ("lambert-ashikhmin-shirley", Self::LambertAshikhminShirley),
        ("ashikhmin-shirley", Self::AshikhminShirley),
        ("auto", Self::Auto),
    ];
}

impl Weights {
    /// All weights with their names on the command line.
    pub const ALL: [(&'static str, Self); 4] =
        [("sopp", Self::Sopp), ("ngan", Self::Ngan), ("sigma", Self::Sigma), ("none", Self::None)];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sopp => "sopp",
            Self::Ngan => "ngan",
            Self::Sigma => "sigma",
            Self::None => "none",
        }
    }
}

fn find<T: Copy>(all: &[(&'static str, T)], what: &'static str, found: &str) -> Result<T, UnknownName> {
    all.iter().find(|(name, _)| *name == found).map(|&(_, v)| v).ok_or_else(|| UnknownName {
        what,
        found: found.to_owned(),
        known: all.iter().map(|(n, _)| *n).collect::<Vec<_>>().join(", "),
    })
}

impl FromStr for ModelChoice {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, "model", s)
    }
}

impl FromStr for Weights {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, "weights", s)
    }
}

/// Options of a fit; `Options::default()` fits the simplified Ashikhmin–Shirley model with Ngan's weights up to 75°.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Which model.
    pub model: ModelChoice,
    /// How cells count.
    pub weights: Weights,
    /// Cells with θi or θo beyond this are left out (Sopp: 75°).
    pub max_angle: Angle,
    /// Take filled and extrapolated cells as well.
    pub include_filled: bool,
    /// Relative standard uncertainty common to all cells (reference, lamp, gain): added to the covariance of cd and cs. `None` takes the
    /// attribute `common_relative_uncertainty` of the data, 0 where there is none.
    pub common_relative_uncertainty: Option<f64>,
    /// Exponents searched, within 1 … 8.1e3: beyond, lamp and cells of 2.5° hide the lobe.
    pub exponent_range: (f64, f64),
}

impl Default for Options {
    fn default() -> Self {
        Self {
            model: ModelChoice::default(),
            weights: Weights::default(),
            max_angle: Angle::from_degrees(75.0),
            include_filled: false,
            common_relative_uncertainty: None,
            exponent_range: (1.0, 8.1e3),
        }
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
        for (name, m) in ModelChoice::ALL {
            assert_eq!(name.parse(), Ok(m));
        }
        let e = "ward".parse::<ModelChoice>().unwrap_err().to_string();
        assert!(e.contains("\"ward\"") && e.contains("auto"), "{e}");
    }
}
