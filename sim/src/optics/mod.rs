//! The optics of the virtual instrument, traced from the sensor to the lamp.
//!
//! A pixel's ray leaves the pupil ([`camera`]), is reflected by the ellipsoid ([`mirror`]), passes what the holder leaves free
//! ([`holder`]) and meets the sample ([`sample`]), which sends back the light of the [`lamp`]. [`radiance`] makes a map of electron rates of a pose
//! from that, [`sensor`] raw frames from the map. Mirror, lens and frame chain are written here and nowhere shared.

pub mod camera;
mod footprint;
pub mod holder;
pub mod lamp;
pub mod mirror;
mod pixel_mean;
pub mod radiance;
pub mod sample;
pub mod sensor;
pub mod stray;
pub mod texture;
mod turn;

pub use radiance::{RateMap, Sight, VirtualOptics};
pub use sample::Sample;
pub use sensor::Sensor;
pub use texture::TextureOptics;
