//! `model.json`: `{"model": NAME, parameters…, "coat": {"index": n}, "fit": {…}}`.

use gonio_optics::{Angle, Vec3};
use serde::{Deserialize, Serialize};

use super::{
    AshikhminShirley, AshikhminShirleyAnisotropic, AshikhminShirleySimplified, BlinnPhong, Coat,
    CookTorrance, Ggx, Lafortune, Lambert, LambertAshikhminShirley, OrenNayar, Phong, Ward, WardDuer,
};
use crate::{Brdf, Rgb};

/// Any model by its name in files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "kebab-case")]
pub enum Model {
    /// `lambert`.
    Lambert(Lambert),
    /// `phong`.
    Phong(Phong),
    /// `blinn-phong`.
    BlinnPhong(BlinnPhong),
    /// `ashikhmin-shirley-simplified`.
    AshikhminShirleySimplified(AshikhminShirleySimplified),
    /// `lambert-ashikhmin-shirley`.
    LambertAshikhminShirley(LambertAshikhminShirley),
    /// `ashikhmin-shirley`.
    AshikhminShirley(AshikhminShirley),
    /// `ashikhmin-shirley-anisotropic`.
    AshikhminShirleyAnisotropic(AshikhminShirleyAnisotropic),
    /// `cook-torrance`.
    CookTorrance(CookTorrance),
    /// `oren-nayar`.
    OrenNayar(OrenNayar),
    /// `lafortune`.
    Lafortune(Lafortune),
    /// `ward`.
    Ward(Ward),
    /// `ward-duer`.
    WardDuer(WardDuer),
    /// `ggx`.
    Ggx(Ggx),
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
    #[error("model file cannot be read: {0}; see the keys of each model in docs, colours are [r, g, b]")]
    Syntax(#[from] serde_json::Error),
    /// No `"model"` key.
    #[error("model file names no model: add \"model\": NAME, one of {known}")]
    NoName {
        /// The names that can be read.
        known: String,
    },
    /// A name that is none of ours.
    #[error("unknown model \"{found}\": use one of {known}")]
    UnknownModel {
        /// The name in the file.
        found: String,
        /// The names that can be read.
        known: String,
    },
    /// A parameter outside its bounds.
    #[error("{key} = {found} in model \"{model}\": expected {expected}; correct the file")]
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
    /// Names of all models, as files and the command line spell them.
    pub const NAMES: [&'static str; 13] = [
        "lambert",
        "phong",
        "blinn-phong",
        "ashikhmin-shirley-simplified",
        "lambert-ashikhmin-shirley",
        "ashikhmin-shirley",
        "ashikhmin-shirley-anisotropic",
        "cook-torrance",
        "oren-nayar",
        "lafortune",
        "ward",
        "ward-duer",
        "ggx",
    ];

    /// Name in files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Lambert(_) => "lambert",
            Self::Phong(_) => "phong",
            Self::BlinnPhong(_) => "blinn-phong",
            Self::AshikhminShirleySimplified(_) => "ashikhmin-shirley-simplified",
            Self::LambertAshikhminShirley(_) => "lambert-ashikhmin-shirley",
            Self::AshikhminShirley(_) => "ashikhmin-shirley",
            Self::AshikhminShirleyAnisotropic(_) => "ashikhmin-shirley-anisotropic",
            Self::CookTorrance(_) => "cook-torrance",
            Self::OrenNayar(_) => "oren-nayar",
            Self::Lafortune(_) => "lafortune",
            Self::Ward(_) => "ward",
            Self::WardDuer(_) => "ward-duer",
            Self::Ggx(_) => "ggx",
        }
    }

    /// The model as a [`Brdf`].
    #[must_use]
    pub fn brdf(&self) -> &dyn Brdf {
        match self {
            Self::Lambert(m) => m,
            Self::Phong(m) => m,
            Self::BlinnPhong(m) => m,
            Self::AshikhminShirleySimplified(m) => m,
            Self::LambertAshikhminShirley(m) => m,
            Self::AshikhminShirley(m) => m,
            Self::AshikhminShirleyAnisotropic(m) => m,
            Self::CookTorrance(m) => m,
            Self::OrenNayar(m) => m,
            Self::Lafortune(m) => m,
            Self::Ward(m) => m,
            Self::WardDuer(m) => m,
            Self::Ggx(m) => m,
        }
    }

    /// Checks every parameter against its bounds.
    ///
    /// # Errors
    /// [`ModelError::Value`] with the first key outside them.
    pub fn check(&self) -> Result<(), ModelError> {
        match self {
            Self::Lambert(m) => m.check(),
            Self::Phong(m) => m.check(),
            Self::BlinnPhong(m) => m.check(),
            Self::AshikhminShirleySimplified(m) => m.check(),
            Self::LambertAshikhminShirley(m) => m.check(),
            Self::AshikhminShirley(m) => m.check(),
            Self::AshikhminShirleyAnisotropic(m) => m.check(),
            Self::CookTorrance(m) => m.check(),
            Self::OrenNayar(m) => m.check(),
            Self::Lafortune(m) => m.check(),
            Self::Ward(m) => m.check(),
            Self::WardDuer(m) => m.check(),
            Self::Ggx(m) => m.check(),
        }
    }
}

impl From<Model> for ModelFile {
    fn from(model: Model) -> Self {
        Self { model, coat: None, fit: None }
    }
}

/// The name alone, whatever else the file holds.
#[derive(Deserialize)]
struct Name {
    model: Option<String>,
}

impl ModelFile {
    /// Reads and checks a `model.json`.
    ///
    /// # Errors
    /// [`ModelError`] with the place in the text, the names that are known, or the key and what would be accepted.
    pub fn from_json(text: &str) -> Result<Self, ModelError> {
        let known = || Model::NAMES.join(", ");
        match serde_json::from_str::<Name>(text)?.model {
            None => return Err(ModelError::NoName { known: known() }),
            Some(found) if !Model::NAMES.contains(&found.as_str()) => {
                return Err(ModelError::UnknownModel { found, known: known() });
            }
            Some(_) => {}
        }
        let file: Self = serde_json::from_str(text)?;
        file.check()?;
        Ok(file)
    }

    /// Checks model and coat.
    ///
    /// # Errors
    /// [`ModelError::Value`].
    pub fn check(&self) -> Result<(), ModelError> {
        self.model.check()?;
        self.coat.as_ref().map_or(Ok(()), Coat::check)
    }

    /// The file's text, two-space indented.
    ///
    /// # Errors
    /// [`ModelError::Syntax`] for numbers JSON cannot hold.
    pub fn to_json(&self) -> Result<String, ModelError> {
        Ok(serde_json::to_string_pretty(self)?)
    }

    /// f for a lamp of angular radius α centred on `light`: the model through its coat and the coat's gloss ([`Coat::with_gloss`]).
    #[must_use]
    pub fn eval_with_lamp(&self, light: Vec3, view: Vec3, half_angle: Angle) -> Rgb {
        match &self.coat {
            Some(coat) => coat.with_gloss(self.model.brdf(), light, view, half_angle),
            None => self.model.brdf().eval(light, view),
        }
    }
}

/// Model with its coat, gloss left out (it needs the lamp: [`ModelFile::eval_with_lamp`]).
impl Brdf for ModelFile {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        match &self.coat {
            Some(coat) => coat.base_through(self.model.brdf(), light, view),
            None => self.model.brdf().eval(light, view),
        }
    }

    // refraction narrows the range of half vectors, so a lobe under a coat looks no sharper than it is
    fn sharpness(&self) -> f64 {
        self.model.brdf().sharpness()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOLDEN: [&str; 15] = [
        r#"{"model":"lambert","diffuse":[0.1,0.2,0.3]}"#,
        r#"{"model":"phong","diffuse":[0.1,0.2,0.3],"specular":[0.4,0.4,0.4],"exponent":20.0}"#,
        r#"{"model":"blinn-phong","diffuse":[0.1,0.2,0.3],"specular":[0.4,0.4,0.4],"exponent":80.0}"#,
        r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.1,0.2,0.3],"specular":[0.05,0.05,0.05],"exponent":120.0}"#,
        r#"{"model":"lambert-ashikhmin-shirley","diffuse":[0.1,0.2,0.3],"specular":[0.05,0.05,0.05],"exponent":120.0}"#,
        r#"{"model":"lambert-ashikhmin-shirley","diffuse":[0.1,0.2,0.3],"specular":[0.9,0.9,0.9],"exponent":120.0,"r0":0.04}"#,
        r#"{"model":"ashikhmin-shirley","diffuse":[0.1,0.2,0.3],"specular":[0.9,0.9,0.9],"exponent":120.0,"r0":0.04}"#,
        r#"{"model":"ashikhmin-shirley-anisotropic","diffuse":[0.1,0.2,0.3],"specular":[0.9,0.9,0.9],"exponent_u":120.0,"exponent_v":12.0,"r0":0.04}"#,
        r#"{"model":"cook-torrance","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.2,0.2,0.2],"alpha":0.3,"r0":0.1},{"specular":[0.1,0.0,0.0],"alpha":0.05,"r0":1.0}]}"#,
        r#"{"model":"oren-nayar","diffuse":[0.1,0.2,0.3],"sigma_deg":30.0}"#,
        r#"{"model":"lafortune","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.4,0.4,0.4],"cxy":-1.0,"cz":0.8,"exponent":20.0}]}"#,
        r#"{"model":"ward","diffuse":[0.1,0.2,0.3],"specular":[0.4,0.4,0.4],"alpha":0.1}"#,
        r#"{"model":"ward-duer","diffuse":[0.1,0.2,0.3],"specular":[0.4,0.4,0.4],"alpha":0.1}"#,
        r#"{"model":"ggx","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.2,0.2,0.2],"alpha":0.3,"r0":0.1},{"specular":[0.1,0.0,0.0],"alpha":0.05,"r0":1.0}]}"#,
        r#"{"model":"lambert","diffuse":[0.1,0.2,0.3],"coat":{"index":1.5},"fit":{"error":0.01,"status":"converged"}}"#,
    ];

    #[test]
    fn every_model_file_is_written_as_it_was_read() {
        for text in GOLDEN {
            let file = ModelFile::from_json(text).unwrap();
            assert_eq!(serde_json::to_string(&file).unwrap(), text);
            assert_eq!(ModelFile::from_json(&file.to_json().unwrap()).unwrap(), file);
        }
    }

    #[test]
    fn the_list_of_names_is_complete() {
        let written = GOLDEN.map(|text| ModelFile::from_json(text).unwrap().model.name());
        assert!(written.iter().all(|name| Model::NAMES.contains(name)));
        assert!(Model::NAMES.iter().all(|name| written.contains(name)));
    }

    fn message(text: &str) -> String {
        ModelFile::from_json(text).unwrap_err().to_string()
    }

    #[test]
    fn an_unknown_model_is_answered_with_the_known_ones() {
        let m = message(r#"{"model":"wardd","diffuse":[0,0,0]}"#);
        assert!(m.contains("\"wardd\"") && Model::NAMES.iter().all(|n| m.contains(n)), "{m}");
        assert!(message("{}").contains("cook-torrance"));
    }

    #[test]
    fn values_outside_their_bounds_name_the_key() {
        for (text, expect) in [
            (r#"{"model":"lambert","diffuse":[0.1,-0.2,0.3]}"#, "diffuse = -0.2"),
            (r#"{"model":"phong","diffuse":[0,0,0],"specular":[0,0,-1],"exponent":20}"#, "specular = -1"),
            (
                r#"{"model":"blinn-phong","diffuse":[0,0,0],"specular":[0,0,0],"exponent":-2}"#,
                "exponent = -2",
            ),
            (
                r#"{"model":"ashikhmin-shirley","diffuse":[0,0,0],"specular":[0,0,0],"exponent":2,"r0":1.5}"#,
                "r0 = 1.5",
            ),
            (
                r#"{"model":"cook-torrance","diffuse":[0,0,0],"lobes":[{"specular":[0,0,0],"alpha":0,"r0":0}]}"#,
                "lobes.alpha = 0",
            ),
            (r#"{"model":"oren-nayar","diffuse":[0,0,0],"sigma_deg":91}"#, "sigma_deg = 91"),
            (
                r#"{"model":"lafortune","diffuse":[0,0,0],"lobes":[{"specular":[0,0,0],"cxy":-1.1,"cz":1,"exponent":2}]}"#,
                "lobes.cxy = -1.1",
            ),
            (
                r#"{"model":"lafortune","diffuse":[0,0,0],"lobes":[{"specular":[0,0,0],"cxy":-1,"cz":-0.1,"exponent":2}]}"#,
                "lobes.cz = -0.1",
            ),
            (r#"{"model":"ward","diffuse":[0,0,0],"specular":[0,0,0],"alpha":11}"#, "alpha = 11"),
            (r#"{"model":"ward-duer","diffuse":[0,0,0],"specular":[0,0,0],"alpha":0}"#, "alpha = 0"),
            (
                r#"{"model":"ggx","diffuse":[0,0,0],"lobes":[{"specular":[0,0,0],"alpha":0.1,"r0":-0.1}]}"#,
                "lobes.r0 = -0.1",
            ),
            (r#"{"model":"lambert","diffuse":[0,0,0],"coat":{"index":1.0}}"#, "coat.index = 1"),
        ] {
            let m = message(text);
            assert!(m.contains(expect) && m.contains("expected"), "{m}");
        }
        let infinite = Model::Lambert(Lambert { diffuse: [f64::INFINITY, 0.0, 0.0] });
        assert!(infinite.check().is_err());
    }

    #[test]
    fn misspelt_missing_and_broken_keys_are_errors() {
        assert!(message(r#"{"model":"lambert","difuse":[0,0,0]}"#).contains("difuse"));
        assert!(message(r#"{"model":"phong","diffuse":[0,0,0],"specular":[0,0,0]}"#).contains("exponent"));
        assert!(message(r#"{"model":"lambert","diffuse":[0,0]}"#).contains("length"));
        assert!(message(r#"{"model":"lambert","diffuse":[0,0,1e999]}"#).contains("out of range"));
        assert!(message("{\"model\":").contains("line 1"));
    }
}
