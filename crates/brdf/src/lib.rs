//! Reflectance models, measured tables and their file formats.
//!
//! Everything that can be asked "what is f for this light and this view?" is a [`Brdf`]: one file per model in [`models`],
//! measured grids in [`measured`], scattered measurements in [`scattered`], one file per format in [`formats`].
//! Where data came from (a device, a session, another laboratory) is not known here.
//!
//! `f` is the BRDF in 1/sr without the cosine, linear Rec. 709 RGB.

pub mod anisotropic;
pub mod average;
pub mod export;
pub mod formats;
pub mod grid;
pub mod maps;
pub mod measured;
pub mod models;
pub mod scattered;

use gonio_optics::Vec3;

pub use anisotropic::Anisotropic;
pub use grid::Grid;
pub use measured::{Flag, Meaning, Measured};
pub use models::{Coat, Model, ModelError, ModelFile};
pub use scattered::{Scattered, ScatteredPoint};

/// Linear RGB, Rec. 709 primaries, D65.
pub type Rgb = [f64; 3];

/// A bidirectional reflectance distribution function.
pub trait Brdf: Send + Sync {
    /// f in 1/sr for unit directions in the sample frame, both pointing away from the surface (z is the normal).
    ///
    /// Zero where either is below the horizon; finite and not negative everywhere for models. Light and view may be any azimuths.
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb;

    /// How sharp the narrowest feature about the mirror direction is: the exponent n of the Ashikhmin–Shirley lobe (n·h)^n with the
    /// same curvature at its peak; 0 where nothing is sharper than a few degrees. Averages choose their quadrature by it.
    fn sharpness(&self) -> f64 {
        0.0
    }
}

impl<T: Brdf + ?Sized> Brdf for std::sync::Arc<T> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        (**self).eval(light, view)
    }

    fn sharpness(&self) -> f64 {
        (**self).sharpness()
    }
}

impl<T: Brdf + ?Sized> Brdf for Box<T> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        (**self).eval(light, view)
    }

    fn sharpness(&self) -> f64 {
        (**self).sharpness()
    }
}
