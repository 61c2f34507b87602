//! The scene file, key by key; docs/scenes.md explains it with examples.

use serde::{Deserialize, Serialize};

use super::SceneError;
use crate::light::Sky;

/// Format name in the file.
pub const FORMAT: &str = "gonio-scene";

/// A scene as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Always [`FORMAT`].
    pub format: String,
    /// Version of the format: 1.
    pub version: u32,
    /// Name of the scene.
    #[serde(default)]
    pub name: String,
    /// Pixels across and down.
    #[serde(default = "size")]
    pub size: [u32; 2],
    /// Samples per pixel.
    #[serde(default = "samples")]
    pub samples: u32,
    /// Brightening of the picture; by default a perfect diffuser in the best light is white.
    #[serde(default)]
    pub exposure: Option<f64>,
    /// Show the environment beside the object.
    #[serde(default)]
    pub show_environment: bool,
    /// Where it is seen from.
    pub camera: CameraKeys,
    /// What is seen.
    pub object: ObjectKeys,
    /// The lights.
    #[serde(default, rename = "light")]
    pub lights: Vec<LightKeys>,
}

fn size() -> [u32; 2] {
    [512, 512]
}
fn samples() -> u32 {
    16
}
fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}
fn one() -> f64 {
    1.0
}
fn white() -> [f64; 3] {
    [1.0; 3]
}

/// `[camera]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraKeys {
    /// Place.
    pub from: [f64; 3],
    /// What it looks at.
    #[serde(default)]
    pub to: [f64; 3],
    /// What is up in the picture.
    #[serde(default = "up")]
    pub up: [f64; 3],
    /// Field of view from top to bottom, degrees; 30 where neither this nor `height` is given.
    #[serde(default)]
    pub field_of_view_deg: Option<f64>,
    /// Parallel rays instead: height of what the picture shows.
    #[serde(default)]
    pub height: Option<f64>,
    /// Several places: turned about the vertical through `to`.
    #[serde(default)]
    pub orbit: Option<Range>,
}

/// Turns about the vertical.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// First turn, degrees.
    #[serde(default)]
    pub from_deg: f64,
    /// Last turn, degrees; after a full turn the start is not repeated.
    pub to_deg: f64,
    /// Number of turns.
    pub steps: u32,
}

/// `[object]`: one of `shape` and `mesh`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectKeys {
    /// A body that needs no file.
    #[serde(default)]
    pub shape: Option<Shape>,
    /// A mesh, beside the scene file: Wavefront OBJ or glTF.
    #[serde(default)]
    pub mesh: Option<String>,
    /// Factor on its size.
    #[serde(default = "one")]
    pub scale: f64,
    /// Shift after scaling and turning.
    #[serde(default)]
    pub shift: [f64; 3],
    /// Turn about the vertical, degrees.
    #[serde(default)]
    pub turn_deg: f64,
    /// Tip about x before that turn, degrees.
    #[serde(default)]
    pub tip_deg: f64,
    /// Put the mesh's middle at the origin and its largest half extent to 1 first.
    #[serde(default)]
    pub fit: bool,
    /// Turned in steps about the vertical through the origin, camera and lights standing still.
    #[serde(default)]
    pub turntable: Option<Range>,
}

/// Bodies that need no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// Radius 1, exact.
    Sphere,
    /// Height 2.
    Egg,
    /// Height 2, radius ½.
    Capsule,
    /// Height 2.
    Teapot,
    /// 4.2 long.
    Car,
}

/// `[[light]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LightKeys {
    /// At infinity.
    Directional {
        /// Towards the light.
        towards: [f64; 3],
        /// On a surface that faces it.
        #[serde(default = "white")]
        irradiance: [f64; 3],
        /// Angular radius, for its mirror image in a coat.
        #[serde(default)]
        half_angle_deg: f64,
    },
    /// A small ball.
    Point {
        /// Where.
        position: [f64; 3],
        /// Irradiance times distance².
        intensity: [f64; 3],
        /// Its radius, for its mirror image in a coat.
        #[serde(default)]
        radius: f64,
    },
    /// All around: `file` or `sky`.
    Environment {
        /// OpenEXR, latitude and longitude, beside the scene file.
        #[serde(default)]
        file: Option<String>,
        /// One that needs no file.
        #[serde(default)]
        sky: Option<Sky>,
        /// Factor on its radiance.
        #[serde(default = "white")]
        radiance: [f64; 3],
        /// Turn about the vertical, degrees.
        #[serde(default)]
        turn_deg: f64,
    },
}

impl SceneFile {
    /// Reads the keys; `path` names the file in errors.
    ///
    /// # Errors
    /// [`SceneError::Syntax`] with line and excerpt, or [`SceneError::Format`].
    pub fn from_toml(text: &str, path: &str) -> Result<Self, SceneError> {
        let file: Self = toml::from_str(text)
            .map_err(|e| SceneError::Syntax { path: path.to_owned(), reason: e.to_string() })?;
        if file.format != FORMAT || file.version != 1 {
            return Err(SceneError::Format {
                path: path.to_owned(),
                format: file.format,
                version: file.version,
            });
        }
        Ok(file)
    }
}
