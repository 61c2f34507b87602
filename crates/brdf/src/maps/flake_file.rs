//! The file of a flake map: JSON that loads without recomputing.
//!
//! ```text
//! {"format": "gonio-flake-map", "version": 2, "name": …, "index": n, "harmonics": K, "nodes": [40, 40],
//!  "transform": "log" | "cube-root", "edge": β, "largest_deg": 75, "from_mirror_deg": 15,
//!  "bounds": [[y_min r, g, b], [y_max r, g, b]], "coefficients": [r, g, b, …], "covered": "0110…",
//!  "sigma": [σ of y at each node] or left out, "findings": [what to know about the map]}
//! ```
//!
//! Coefficients run over θ_inc, then θ_flake, then k, then the channel; nodes stand at equal steps of sin θ_inc and √(sin θ_flake) from 0 to the
//! steepest angle inside the coat.

use gonio_optics::Angle;
use serde::{Deserialize, Serialize};

use super::{Finding, FlakeMap, Region, Transform, flake_map::MAX_HARMONICS};

const FORMAT: &str = "gonio-flake-map";
const VERSION: u32 = 2;

/// A map file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MapFileError {
    /// Not JSON or not its keys.
    #[error("flake map cannot be read: {0}; make it again from its measurement")]
    Syntax(#[from] serde_json::Error),
    /// A value that does not fit.
    #[error("flake map with {key} = {found}: expected {expected}; make it again from its measurement")]
    Value {
        /// The key.
        key: &'static str,
        /// What the file says.
        found: String,
        /// What would be accepted.
        expected: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    version: u32,
    name: String,
    index: f64,
    harmonics: usize,
    nodes: [usize; 2],
    transform: Transform,
    edge: f64,
    largest_deg: f64,
    from_mirror_deg: f64,
    bounds: [[f32; 3]; 2],
    coefficients: Vec<f32>,
    covered: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sigma: Option<Vec<f32>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    findings: Vec<Finding>,
}

impl FlakeMap {
    /// The map as text.
    ///
    /// # Errors
    /// [`MapFileError::Syntax`] where the encoder fails.
    pub fn to_json(&self) -> Result<String, MapFileError> {
        let rgb = |v: [f32; 4]| [v[0], v[1], v[2]];
        Ok(serde_json::to_string(&File {
            format: FORMAT.to_owned(),
            version: VERSION,
            name: self.name.clone(),
            index: self.index,
            harmonics: self.harmonics,
            nodes: self.nodes,
            transform: self.transform,
            edge: self.edge,
            largest_deg: self.region.largest.degrees(),
            from_mirror_deg: self.region.from_mirror.degrees(),
            bounds: self.bounds.map(rgb),
            coefficients: self.coefficients.iter().flat_map(|&c| rgb(c)).collect(),
            covered: self.covered.iter().map(|&c| if c { '1' } else { '0' }).collect(),
            sigma: self.sigma.clone(),
            findings: self.findings.clone(),
        })?)
    }

    /// Reads a map.
    ///
    /// # Errors
    /// [`MapFileError`]: what was found and what was expected.
    pub fn from_json(text: &str) -> Result<Self, MapFileError> {
        let file: File = serde_json::from_str(text)?;
        let fail = |key, found: &dyn std::fmt::Display, expected: String| {
            Err(MapFileError::Value { key, found: found.to_string(), expected })
        };
        if file.format != FORMAT {
            return fail("format", &file.format, FORMAT.to_owned());
        }
        if file.version != VERSION {
            return fail("version", &file.version, VERSION.to_string());
        }
        if !(1.0..=4.0).contains(&file.index) {
            return fail("index", &file.index, "1 to 4".to_owned());
        }
        if file.harmonics > MAX_HARMONICS {
            return fail("harmonics", &file.harmonics, format!("0 to {MAX_HARMONICS}"));
        }
        if !file.nodes.iter().all(|n| (4..=256).contains(n)) {
            return fail("nodes", &format!("{:?}", file.nodes), "4 to 256 each".to_owned());
        }
        let count = file.nodes[0] * file.nodes[1];
        let numbers = 3 * (file.harmonics + 1) * count;
        if file.coefficients.len() != numbers {
            return fail("coefficients", &file.coefficients.len(), format!("{numbers} numbers"));
        }
        if let Some(x) = file.coefficients.iter().chain(file.bounds.iter().flatten()).find(|x| !x.is_finite())
        {
            return fail("coefficients", x, "finite numbers".to_owned());
        }
        if !(0..3).all(|c| file.bounds[0][c] <= file.bounds[1][c]) {
            return fail("bounds", &format!("{:?}", file.bounds), "smallest before largest".to_owned());
        }
        if file.covered.len() != count || file.covered.bytes().any(|b| b != b'0' && b != b'1') {
            return fail("covered", &file.covered.len(), format!("{count} digits 0 or 1"));
        }
        if !(-1.0..=2.0).contains(&file.edge) {
            return fail("edge", &file.edge, "-1 to 2".to_owned());
        }
        if let Some(sigma) = &file.sigma {
            if sigma.len() != count {
                return fail("sigma", &sigma.len(), format!("{count} numbers"));
            }
            if let Some(x) = sigma.iter().find(|x| !(x.is_finite() && **x >= 0.0)) {
                return fail("sigma", x, "numbers from 0 on".to_owned());
            }
        }
        let lanes = |v: [f32; 3]| [v[0], v[1], v[2], 0.0];
        Ok(Self {
            name: file.name,
            index: file.index,
            harmonics: file.harmonics,
            nodes: file.nodes,
            transform: file.transform,
            edge: file.edge,
            region: Region {
                largest: Angle::from_degrees(file.largest_deg),
                from_mirror: Angle::from_degrees(file.from_mirror_deg),
            },
            bounds: file.bounds.map(lanes),
            coefficients: file.coefficients.chunks_exact(3).map(|c| lanes([c[0], c[1], c[2]])).collect(),
            covered: file.covered.bytes().map(|b| b == b'1').collect(),
            sigma: file.sigma,
            findings: file.findings,
        })
    }
}
