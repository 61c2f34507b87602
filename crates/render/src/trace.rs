//! Light carried from the lights over the object to the camera.
//!
//! [`render`] makes a picture on all cores; [`gather`] writes down instead which local geometries a picture is made of, each with what it contributes per
//! unit of f: the same rays, so that a picture can be made again for any other reflectance without tracing. The result does not depend on the number of
//! threads.

mod body;
mod gathered;
mod lobe;
mod picture;
mod sequence;
mod shade;

pub use body::{Body, Hit};
pub use gathered::{Gathered, gather};
pub use picture::{Paint, Placed, PlacedBrdf, RenderOptions, render};
