//! Why a scene cannot be rendered.

use crate::mesh::MeshError;

/// A scene that cannot be used, with what would help.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be opened.
    #[error("scene {path} cannot be read: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML, or not the keys expected.
    #[error("scene {path} cannot be read: {reason}")]
    Syntax {
        /// The file.
        path: String,
        /// The parser's message with line and excerpt.
        reason: String,
    },
    /// Another kind of file, or a newer one.
    #[error(
        "scene {path}: expected format = \"gonio-scene\" and version = 1, found \"{format}\", version {version}"
    )]
    Format {
        /// The file.
        path: String,
        /// Format name found.
        format: String,
        /// Version found.
        version: u32,
    },
    /// A value that cannot be.
    #[error("scene: {key} = {found}, expected {expected}")]
    Value {
        /// Which key.
        key: String,
        /// What it says.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// The mesh.
    #[error("scene object: {0}")]
    Mesh(#[from] MeshError),
    /// The map of the environment.
    #[error(
        "environment map {path}: {reason}; expected an OpenEXR image of a whole sphere, twice as wide as high"
    )]
    Environment {
        /// The file.
        path: String,
        /// What is wrong.
        reason: String,
    },
    /// No pixel shows the object.
    #[error(
        "nothing is visible: no pixel shows the object (a ball of radius {radius:.3} about {centre} holds it; the camera stands at {camera} and looks along \
         {look}); point camera.to at the object, widen camera.field_of_view_deg, or stand farther off"
    )]
    NothingVisible {
        /// Middle of the object.
        centre: String,
        /// Radius of the ball around it.
        radius: f64,
        /// Place of the camera.
        camera: String,
        /// Its direction.
        look: String,
    },
    /// No light reaches what is seen.
    #[error(
        "nothing is visible: no light reaches what the camera sees of the object; turn a light, or add one on the camera's side"
    )]
    Dark,
}

impl SceneError {
    pub(crate) fn value(key: impl Into<String>, found: impl std::fmt::Debug, expected: &str) -> Self {
        Self::Value { key: key.into(), found: format!("{found:?}"), expected: expected.to_owned() }
    }
}
