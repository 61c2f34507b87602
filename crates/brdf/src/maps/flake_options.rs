//! How a flake map is made, and why it may not be.

use super::{Region, Transform, flake_map::MAX_HARMONICS};

/// A number that is given, or chosen from the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setting {
    /// This value.
    Fixed(f64),
    /// The one that predicts best the measurements that a fit has not seen.
    Chosen,
}

impl Setting {
    /// The value, where it is given.
    #[must_use]
    pub const fn fixed(self) -> Option<f64> {
        match self {
            Self::Fixed(x) => Some(x),
            Self::Chosen => None,
        }
    }
}

/// How a map is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeFitOptions {
    /// Refractive index of the coat, 1 for none.
    pub index: f64,
    /// K, 0 to 3.
    pub harmonics: usize,
    /// Nodes over θ_inc and θ_flake, at least 4 each; a map of fewer than 1,000 measurements takes at most 16 and 32.
    pub nodes: [usize; 2],
    /// Scale on which errors count.
    pub transform: Transform,
    /// β of the edge factor `1 + β (1 − cos θ)^5` of light and view, −1 to 2. −1 is the transmittance of the coat: right for a diffuse base. Of real
    /// paints it helps some and harms others, so the data choose; from K = 1 on it makes little difference.
    pub edge: Setting,
    /// λ, against a mean weight of 1 per node.
    pub smoothness: Setting,
    /// τ, relative to f.
    pub own_error: f64,
    /// Samples elsewhere do not take part.
    pub region: Region,
}

impl Default for FlakeFitOptions {
    fn default() -> Self {
        Self {
            index: 1.5,
            harmonics: 1,
            nodes: [40, 40],
            transform: Transform::CubeRoot,
            edge: Setting::Chosen,
            smoothness: Setting::Chosen,
            own_error: 0.05,
            region: Region::default(),
        }
    }
}

/// A map that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// An option outside its bounds.
    #[error("{option} = {found}: expected {expected}")]
    Option {
        /// Which.
        option: &'static str,
        /// Its value.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Too little data.
    #[error(
        "{found} measured geometries within {largest_deg}° and more than {mirror_deg}° from the mirror direction: expected at least {expected}; measure more of them or use fewer harmonics"
    )]
    Data {
        /// Samples that take part.
        found: usize,
        /// The least number.
        expected: usize,
        /// Limit of the polar angles, degrees.
        largest_deg: f64,
        /// Cone left out, degrees.
        mirror_deg: f64,
    },
    /// The equations have no solution in f64.
    #[error("the equations of the map cannot be solved with smoothness {smoothness}: raise it")]
    Singular {
        /// λ.
        smoothness: f64,
    },
}

impl FlakeFitOptions {
    pub(super) fn check(&self) -> Result<(), FitError> {
        let fail = |option, found: String, expected| Err(FitError::Option { option, found, expected });
        // not written as < so that NaN is refused
        if !(1.0..=4.0).contains(&self.index) {
            return fail("index", self.index.to_string(), "1 to 4");
        }
        if self.harmonics > MAX_HARMONICS {
            return fail("harmonics", self.harmonics.to_string(), "0 to 3");
        }
        if !self.nodes.iter().all(|n| (4..=256).contains(n)) {
            return fail("nodes", format!("{:?}", self.nodes), "4 to 256 each");
        }
        if let Some(b) = self.edge.fixed()
            && !(-1.0..=2.0).contains(&b)
        {
            return fail("edge", b.to_string(), "-1 to 2");
        }
        if let Some(l) = self.smoothness.fixed()
            && !(1e-9..=1e6).contains(&l)
        {
            return fail("smoothness", l.to_string(), "1e-9 to 1e6");
        }
        if !(1e-4..=10.0).contains(&self.own_error) {
            return fail("own_error", self.own_error.to_string(), "1e-4 to 10");
        }
        Ok(())
    }
}
