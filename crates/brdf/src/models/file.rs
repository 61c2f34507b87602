//! `model.json`: `{"model": NAME, parameters…, "coat": {"index": n}, "fit": {…}}`.

use gonio_optics::Vec3;
use serde::{Deserialize, Serialize};

use super::{AshikhminShirleySimplified, Coat, Lambert};
use crate::{Brdf, Rgb};

/// Any model by its name in files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "kebab-case")]
pub enum Model {
    /// `lambert`.
    Lambert(Lambert),
    /// `ashikhmin-shirley-simplified`.
    AshikhminShirleySimplified(AshikhminShirleySimplified),
}

/// A `model.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelFile {
    /// The model and its parameters.
    #[serde(flatten)]
    pub model: Model,
    /// A clear coat over it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coat: Option<Coat>,
    /// What the fit said of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<serde_json::Value>,
}

/// A `model.json` that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Not JSON or not the keys of its model.
    #[error("model file cannot be read: {0}")]
    Syntax(#[from] serde_json::Error),
    /// A parameter outside its bounds.
    #[error("{key} = {found} in model \"{model}\", expected {expected}")]
    Value {
        /// Name of the model.
        model: &'static str,
        /// The key.
        key: &'static str,
        /// What the file says.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
}

impl Model {
    /// Name in files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Lambert(_) => "lambert",
            Self::AshikhminShirleySimplified(_) => "ashikhmin-shirley-simplified",
        }
    }

    /// The model as a [`Brdf`].
    #[must_use]
    pub fn brdf(&self) -> &dyn Brdf {
        match self {
            Self::Lambert(m) => m,
            Self::AshikhminShirleySimplified(m) => m,
        }
    }
}

impl ModelFile {
    /// Reads and checks a `model.json`.
    ///
    /// # Errors
    /// [`ModelError`] with the place in the text, or the key and what would be accepted.
    pub fn from_json(text: &str) -> Result<Self, ModelError> {
        Ok(serde_json::from_str(text)?)
    }

    /// The file's text, two-space indented.
    ///
    /// # Errors
    /// [`ModelError::Syntax`] for numbers JSON cannot hold.
    pub fn to_json(&self) -> Result<String, ModelError> {
        Ok(serde_json::to_string_pretty(self)?)
    }
}

/// Model with its coat, gloss left out (it needs the lamp: [`Coat::gloss`]).
impl Brdf for ModelFile {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        match &self.coat {
            Some(coat) => coat.base_through(self.model.brdf(), light, view),
            None => self.model.brdf().eval(light, view),
        }
    }
}
