//! The plan of a scan: which poses, in which order, and how exposures are chosen.

use serde::{Deserialize, Serialize};

use crate::{Description, FileError, Pose};

/// Format name of a plan file.
pub const FORMAT: &str = "gonio-plan";

/// Tilts (one θi each) and spins; every tilt is visited at every spin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Always [`FORMAT`] in a file of its own; absent inside an instrument description.
    #[serde(default = "format_name", skip_serializing_if = "is_default_format")]
    pub format: String,
    /// Version of the format.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub version: u32,
    /// Tilts, degrees: the angles of incidence.
    pub tilt_deg: Vec<f64>,
    /// Spins about the sample normal, degrees.
    #[serde(default = "no_spin")]
    pub spin_deg: Vec<f64>,
    /// Most exposures at one pose; automatic bracketing stays within.
    #[serde(default = "exposures")]
    pub max_exposures: u32,
    /// How often each exposure of a bracket is repeated and averaged.
    #[serde(default = "one")]
    pub repeats: u32,
    /// Exposures to take at each pose in place of automatic bracketing, s; empty for automatic.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exposure_s: Vec<f64>,
    /// Whether the first pose is taken once more at the end: what it gives then shows what has changed meanwhile.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub repeat_first: bool,
}

fn format_name() -> String {
    FORMAT.to_owned()
}
fn is_default_format(s: &String) -> bool {
    s == FORMAT
}
fn one() -> u32 {
    1
}
#[allow(clippy::trivially_copy_pass_by_ref)] // the signature serde asks for
fn is_one(v: &u32) -> bool {
    *v == 1
}
fn no_spin() -> Vec<f64> {
    vec![0.0]
}
fn exposures() -> u32 {
    12
}

impl Plan {
    /// Reads a plan file; the limits of the holder are checked by [`Plan::check`].
    ///
    /// # Errors
    /// [`FileError`] with line and excerpt, or another format's name.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let p: Self =
            toml::from_str(text).map_err(|e| FileError::Syntax { what: "plan", reason: e.to_string() })?;
        if p.format != FORMAT {
            return Err(FileError::Format { expected: FORMAT, found: p.format });
        }
        if p.version > 1 {
            return Err(FileError::Version { what: "plan", found: p.version, known: 1 });
        }
        Ok(p)
    }

    /// The plan as TOML.
    ///
    /// # Errors
    /// [`FileError::Syntax`] if a value cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String, FileError> {
        toml::to_string(self).map_err(|e| FileError::Syntax { what: "plan", reason: e.to_string() })
    }

    /// Holds the plan against the holder's limits.
    ///
    /// # Errors
    /// [`FileError::Value`] naming the pose and the limits.
    pub fn check(&self, instrument: &Description) -> Result<(), FileError> {
        let [low, high] = instrument.holder.tilt_limits_deg;
        if self.tilt_deg.is_empty() || self.spin_deg.is_empty() {
            return Err(FileError::value("plan.tilt_deg", &self.tilt_deg, "at least one tilt and one spin"));
        }
        for (i, &t) in self.tilt_deg.iter().enumerate() {
            if !(low..=high).contains(&t) {
                return Err(FileError::Value {
                    field: format!("plan.tilt_deg[{i}]"),
                    found: format!("{t}"),
                    expected: format!("within the holder's limits {low}…{high} degrees"),
                });
            }
        }
        if let Some(s) = self.spin_deg.iter().find(|s| !(s.is_finite() && s.abs() <= 36000.0)) {
            return Err(FileError::value("plan.spin_deg", s, "finite degrees within ±36000"));
        }
        if !(1..=64).contains(&self.max_exposures) {
            return Err(FileError::value("plan.max_exposures", self.max_exposures, "1 to 64"));
        }
        let [shortest, longest] = instrument.camera.exposure_s;
        if let Some(t) = self.exposure_s.iter().find(|t| !(shortest..=longest).contains(*t)) {
            return Err(FileError::Value {
                field: "plan.exposure_s".to_owned(),
                found: format!("{t}"),
                expected: format!("within the camera's exposures {shortest}…{longest} s"),
            });
        }
        if self.exposure_s.len() > 64 {
            return Err(FileError::value("plan.exposure_s", self.exposure_s.len(), "at most 64 exposures"));
        }
        if !(1..=1000).contains(&self.repeats) {
            return Err(FileError::value("plan.repeats", self.repeats, "1 to 1000"));
        }
        Ok(())
    }

    /// Every pose in the order of the plan: all spins of a tilt before the next tilt, the first once more where the plan says so.
    #[must_use]
    pub fn poses(&self) -> Vec<Pose> {
        let mut poses: Vec<Pose> = self
            .tilt_deg
            .iter()
            .flat_map(|&t| self.spin_deg.iter().map(move |&s| Pose::from_degrees(t, s)))
            .collect();
        if self.repeat_first {
            poses.extend(poses.first().copied());
        }
        poses
    }
}
