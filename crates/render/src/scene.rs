//! Scenes: a camera or a range of them, an object, lights; read from one small TOML.
//!
//! Right-handed, y up, x to the right for a camera that looks along −z. Every view (a place of the camera, a turn of the turntable) is kept in the
//! object's frame: lights and camera are turned back instead of the object, so that one tree over its triangles serves all.

mod build;
mod camera;
mod error;
mod file;

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Vec3, colour};

use crate::light::Lamp;
use crate::mesh::MeshFinding;
use crate::trace::Body;

pub use camera::Camera;
pub use error::SceneError;
pub use file::{FORMAT, SceneFile};

/// A scene ready to be rendered.
#[derive(Debug)]
pub struct Scene {
    /// Its name.
    pub name: String,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Brightening asked for; `None` shows a perfect diffuser in the best light as white.
    pub exposure: Option<f64>,
    /// What is seen.
    pub body: Body,
    /// Each place of the camera and turn of the object.
    pub views: Vec<View>,
    /// What was done to the mesh.
    pub findings: Vec<MeshFinding>,
    /// Whether pixels beside the object show the environment.
    pub show_environment: bool,
}

/// One picture of a scene, in the object's frame.
#[derive(Clone, Debug)]
pub struct View {
    /// The camera.
    pub camera: Camera,
    /// The lights.
    pub lamps: Vec<Lamp>,
}

impl Scene {
    /// Radiance of a perfect diffuser where the light is best (luminance, over 1024 directions of its normal at the object's middle): what counts as white,
    /// divided by the exposure asked for.
    #[must_use]
    pub fn white(&self) -> f64 {
        let (centre, _) = self.body.ball();
        let best = |v: &View| {
            sphere_of_directions(1024)
                .map(|n| {
                    let e = v
                        .lamps
                        .iter()
                        .map(|l| l.irradiance(centre, n))
                        .fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
                    colour::luminance(e)
                })
                .fold(0.0, f64::max)
        };
        // an environment has thousands of texels: the first view stands for all, whose lights are the same ones turned
        let e = self.views.first().map_or(0.0, best);
        if e > 0.0 { e / std::f64::consts::PI / self.exposure.unwrap_or(1.0) } else { 1.0 }
    }

    /// The scene with fewer pixels and samples, the picture's shape kept: at most `side` pixels across and down.
    #[must_use]
    pub fn smaller(mut self, side: u32, samples: u32) -> Self {
        let largest = self.size[0].max(self.size[1]);
        if largest > side {
            self.size =
                self.size.map(|n| (u64::from(n) * u64::from(side) / u64::from(largest)).max(1) as u32);
        }
        self.samples = self.samples.min(samples.max(1));
        self
    }
}

/// Unit directions spread evenly over the sphere (a spiral).
pub(crate) fn sphere_of_directions(n: u32) -> impl Iterator<Item = Vec3> {
    (0..n).map(move |k| {
        let y = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(n);
        let (s, c) = (f64::from(k) * 2.399_963_229_728_653).sin_cos();
        let r = (1.0 - y * y).max(0.0).sqrt();
        Vec3::new(r * c, y, r * s)
    })
}

/// Sum of two colours.
pub(crate) fn plus(a: Rgb, b: Rgb) -> Rgb {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Angles of a range: the first alone where there is one step; a full turn does not repeat its start.
pub(crate) fn steps(from_deg: f64, to_deg: f64, steps: u32) -> Vec<Angle> {
    let n = steps.max(1);
    let whole = (to_deg - from_deg).abs() >= 360.0 - 1e-9;
    let parts = if whole { n } else { (n - 1).max(1) };
    (0..n)
        .map(|k| Angle::from_degrees(from_deg + (to_deg - from_deg) * f64::from(k) / f64::from(parts)))
        .collect()
}
