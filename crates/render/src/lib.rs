//! Scenes, plots and pictures of reflectance, and the report that holds them.
//!
//! [`plots`] draw measured tables and fits: the measurement unfolded, the lobe in the plane of incidence, coverage, uncertainty.
//! [`sphere`] renders a ball from anything that is a [`Brdf`](gonio_brdf::Brdf), in linear light for OpenEXR files and as sRGB for screens.
//! [`scene`] reads a camera, an object ([`mesh`]) and lights ([`light`]); [`trace`] makes pictures of it, and lists the geometries that a picture is made of.
//! [`report`] puts pictures and numbers into one HTML file that needs nothing else.
//!
//! A picture is a [`Picture`]: sRGB pixels and a way into a PNG file. The same input gives the same pixels. Devices, sessions and
//! fitting are not known here: numbers and words arrive as data.

pub mod draw;
pub mod light;
pub mod map_exr;
pub mod mesh;
pub mod picture;
pub mod plots;
pub mod report;
pub mod scene;
pub mod shaders;
pub mod sphere;
pub mod trace;

pub use map_exr::MapImage;
pub use picture::{Picture, PictureError, Srgb};
pub use report::Report;
pub use scene::{Scene, SceneError};
