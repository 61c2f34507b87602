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
use gonio_brdf::{Flag, Grid, Measured};

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
    /// θo up to the limit, farther than [`NEAR_DEG`] from the mirror direction.
    pub holes: Method,
    /// θo up to the limit, nearer.
    pub near: Method,
    /// Beyond the limit.
    pub rim: Method,
}

/// What is near the mirror direction, degrees.
pub const NEAR_DEG: f64 = 15.0;

impl Filling {
    /// Nothing but what stands around.
    pub const PLAIN: Self = Self::both(Method { reciprocity: false, flake_space: false });
    /// Samples without a coat.
    pub const BARE: Self = Self::both(Method { reciprocity: true, flake_space: false });
    /// The base under a coat.
    pub const COATED: Self = Self {
        rim: Method { reciprocity: false, flake_space: true },
        ..Self::both(Method { reciprocity: true, flake_space: true })
    };
    /// Samples whose measured cells break reciprocity: what the map of all cells knows is the better guide into holes, but not into a lobe.
    pub const NOT_RECIPROCAL: Self =
        Self { holes: Method { reciprocity: false, flake_space: true }, ..Self::PLAIN };

    /// The same everywhere.
    #[must_use]
    pub const fn both(method: Method) -> Self {
        Self { holes: method, near: method, rim: method }
    }

    /// The same without reciprocity.
    #[must_use]
    pub fn without_reciprocity(self) -> Self {
        let without = |m: Method| Method { reciprocity: false, ..m };
        Self { holes: without(self.holes), near: without(self.near), rim: without(self.rim) }
    }

    const fn uses_flake_space(&self) -> bool {
        self.holes.flake_space || self.near.flake_space || self.rim.flake_space
    }

    /// What a cell is filled by.
    pub(crate) fn method(&self, grid: &Grid, [ti, to, phi]: [usize; 3], limit_deg: f64) -> Method {
        if grid.theta_o_deg[to] > limit_deg + 1e-9 {
            self.rim
        } else if self.near != self.holes && grid.geometry(ti, to, phi).from_mirror().degrees() <= NEAR_DEG {
            self.near
        } else {
            self.holes
        }
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
        write!(f, "holes: {}", words(self.holes, "plate"))?;
        if self.near != self.holes {
            write!(f, ", within {NEAR_DEG}° of the mirror direction: {}", words(self.near, "plate"))?;
        }
        write!(f, "; beyond the limit: {}", words(self.rim, "slope"))
    }
}

/// Fills `m` in place: [`Flag::Filled`] up to `limit_deg` in θo and within the rows measured, [`Flag::Extrapolated`] beyond.
/// `coat` is the one through which the table shows a base. A table without a measured cell stays as it is. Reciprocity is used where the measured
/// cells themselves keep it; where they make no flake map, the rest goes on without. What was done comes back.
pub fn fill(m: &mut Measured, coat: Option<&Coat>, limit_deg: f64) -> Filling {
    let reciprocal = reciprocity::residual(m).is_none_or(|off| off <= LARGEST_RESIDUAL);
    let how = match (coat, reciprocal) {
        (Some(_), true) => Filling::COATED,
        (Some(_), false) => Filling::COATED.without_reciprocity(),
        (None, true) => Filling::BARE,
        (None, false) => Filling::NOT_RECIPROCAL,
    };
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
    let shape = if how.uses_flake_space() { Some(shape::Shape::of(m, coat)?) } else { None };
    reciprocity::fill(m, limit_deg, how);
    let mut other = (how.near.flake_space != how.holes.flake_space).then(|| m.clone());
    let smooth = |m: &mut Measured, method: Method| {
        shape::relative_to(m, shape.as_ref().filter(|_| method.flake_space), |m| {
            plate::fill(m, limit_deg);
            continuation::between_rows(m, limit_deg);
        });
    };
    smooth(m, how.holes);
    if let Some(other) = &mut other {
        smooth(other, how.near);
        for i in (0..m.flag.len()).filter(|&i| m.flag[i] == Flag::Filled) {
            if how.method(&m.grid, m.grid.coordinates(i), limit_deg) == how.near {
                (m.values[i], m.sigma[i]) = (other.values[i], other.sigma[i]);
            }
        }
    }
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
