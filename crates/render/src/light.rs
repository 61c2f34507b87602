//! Lights of a scene: from one direction, from a point, from all around.

mod environment;

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Vec3};

pub use environment::{Environment, Sky};

/// A light. Directions and places are those of the scene: x to the right, y up.
#[derive(Clone, Debug)]
pub enum Lamp {
    /// At infinity.
    Directional {
        /// Unit vector towards it.
        towards: Vec3,
        /// Irradiance on a surface that faces it.
        irradiance: Rgb,
        /// Angular radius; a coat mirrors a disc of this size. The base coat sees its centre.
        half_angle: Angle,
    },
    /// A small ball.
    Point {
        /// Where it is.
        position: Vec3,
        /// Radiant intensity: irradiance times distance².
        intensity: Rgb,
        /// Radius, for its mirror image in a coat.
        radius: f64,
    },
    /// A map around the scene.
    Environment(Environment),
}

impl Lamp {
    /// The light as seen from an object that is turned by `angle` about the vertical: the light is turned back.
    #[must_use]
    pub fn turned_back(&self, angle: Angle) -> Self {
        let back = gonio_optics::Rotation::about_axis(Vec3::Y, -angle);
        match self {
            Self::Directional { towards, irradiance, half_angle } => Self::Directional {
                towards: back.apply(*towards),
                irradiance: *irradiance,
                half_angle: *half_angle,
            },
            Self::Point { position, intensity, radius } => {
                Self::Point { position: back.apply(*position), intensity: *intensity, radius: *radius }
            }
            Self::Environment(e) => Self::Environment(e.turned(-angle)),
        }
    }

    /// Irradiance that it gives a surface at `place` with unit normal `n`, nothing in between. Of an environment the sum over blocks of its texels.
    #[must_use]
    pub fn irradiance(&self, place: Vec3, n: Vec3) -> Rgb {
        match self {
            Self::Directional { towards, irradiance, .. } => irradiance.map(|e| e * towards.dot(n).max(0.0)),
            Self::Point { position, intensity, .. } => {
                let d = *position - place;
                let r2 = d.norm_squared().max(1e-12);
                intensity.map(|i| i * d.dot(n).max(0.0) / (r2 * r2.sqrt()))
            }
            Self::Environment(e) => e.irradiance(n),
        }
    }
}
