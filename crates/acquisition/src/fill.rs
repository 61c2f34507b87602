//! Cells that were not measured: by reciprocity where the swapped geometry was, else smoothly from around; beyond the
//! limit by a guarded continuation. Never negative, without a jump at the limit, σ growing with the distance from data.
//!
//! What is smooth is the ratio to a *shape*: nothing at all (1), or a flake map of all measured cells, in whose two angles a coat bends
//! 75°…90° outside into a strip of 1.7° beside what is known and many other geometries stand for the same flakes. Which way serves where
//! ([`Filling`]) was measured: `docs/accuracy.md` has the table.

mod continuation;
mod plate;
mod reciprocity;
mod shape;

use gonio_brdf::maps::FitError;
use gonio_brdf::models::Coat;
use gonio_brdf::{Flag, Measured};

/// Median departure from reciprocity of measured cells, relative, up to which it may stand in for others. Bins that do not exchange with the lamp's disc
/// make 0.002, measured wraps 0.02; what a dark colour's own errors make of it is 0.3.
const LARGEST_RESIDUAL: f64 = 0.05;

/// What a zone is filled by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Method {
    /// Whether a cell takes the value measured with light and view exchanged, where there is one.
    pub reciprocity: bool,
    /// Whether the rest follows a flake map of what was measured; else it goes on smoothly by itself.
    pub flake_space: bool,
}

/// What holes up to the limit and what angles beyond it are filled by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Filling {
    /// θo up to the limit.
    pub holes: Method,
    /// Beyond.
    pub rim: Method,
}

impl Filling {
    /// Nothing but what stands around.
    pub const PLAIN: Self = Self::both(Method { reciprocity: false, flake_space: false });
    /// Samples without a coat.
    pub const BARE: Self = Self::both(Method { reciprocity: true, flake_space: false });
    /// The base under a coat.
    pub const COATED: Self = Self {
        holes: Method { reciprocity: true, flake_space: true },
        rim: Method { reciprocity: false, flake_space: true },
    };

    /// The same everywhere.
    #[must_use]
    pub const fn both(method: Method) -> Self {
        Self { holes: method, rim: method }
    }

    /// The same without reciprocity.
    #[must_use]
    pub fn without_reciprocity(self) -> Self {
        let without = |m: Method| Method { reciprocity: false, ..m };
        Self { holes: without(self.holes), rim: without(self.rim) }
    }
}

impl std::fmt::Display for Filling {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = |m: Method, smooth: &'static str| match (m.reciprocity, m.flake_space) {
            (false, false) => smooth.to_owned(),
            (true, false) => format!("reciprocity, then {smooth}"),
            (false, true) => "flake space".to_owned(),
            (true, true) => "reciprocity, then flake space".to_owned(),
        };
        write!(f, "holes: {}; beyond the limit: {}", words(self.holes, "plate"), words(self.rim, "slope"))
    }
}

/// Fills `m` in place: [`Flag::Filled`] up to `limit_deg` in θo and within the rows measured, [`Flag::Extrapolated`] beyond.
/// `coat` is the one through which the table shows a base. A table without a measured cell stays as it is. Reciprocity is used where the measured
/// cells themselves keep it; where they make no flake map, the rest goes on without. What was done comes back.
pub fn fill(m: &mut Measured, coat: Option<&Coat>, limit_deg: f64) -> Filling {
    let reciprocal = reciprocity::residual(m).is_none_or(|off| off <= LARGEST_RESIDUAL);
    let usual = if coat.is_some() { Filling::COATED } else { Filling::BARE };
    // without reciprocity what the map of all cells knows is the better guide into holes
    let holes = Method { reciprocity: false, flake_space: true };
    let how = if reciprocal { usual } else { Filling { holes, ..usual.without_reciprocity() } };
    if fill_by(m, coat, limit_deg, how).is_ok() {
        return how;
    }
    // too little for a map
    let how = if reciprocal { Filling::BARE } else { Filling::PLAIN };
    let _ = fill_by(m, coat, limit_deg, how);
    how
}

/// The same by ways of one's own choice.
///
/// # Errors
/// [`FitError`] where flake space is asked for and the measured cells do not make a map; nothing is filled then.
pub fn fill_by(m: &mut Measured, coat: Option<&Coat>, limit_deg: f64, how: Filling) -> Result<(), FitError> {
    if !m.flag.contains(&Flag::Measured) {
        return Ok(());
    }
    let shape =
        if how.holes.flake_space || how.rim.flake_space { Some(shape::Shape::of(m, coat)?) } else { None };
    reciprocity::fill(m, limit_deg, how);
    let holes = shape.as_ref().filter(|_| how.holes.flake_space);
    shape::relative_to(m, holes, |m| {
        plate::fill(m, limit_deg);
        continuation::between_rows(m, limit_deg);
    });
    let rim = shape.as_ref().filter(|_| how.rim.flake_space);
    shape::relative_to(m, rim, |m| {
        continuation::beyond_limit(m, limit_deg, rim.is_some());
        continuation::outer_rows(m, rim.is_some());
    });
    if let Some(s) = &shape {
        s.add_own_error(m, limit_deg, how);
    }
    for (v, s) in m.values.iter_mut().zip(&m.sigma) {
        for c in 0..3 {
            // noise about zero is kept where measured; what is made up is never negative
            if !v[c].is_finite() || !s[c].is_finite() {
                v[c] = 0.0;
            }
        }
    }
    Ok(())
}
