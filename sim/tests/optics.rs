//! Laws of the virtual optics, checked from outside.

#[path = "optics/geometry.rs"]
mod geometry;
#[path = "optics/noise.rs"]
mod noise;
#[path = "optics/radiometry.rs"]
mod radiometry;
#[path = "optics/virtual_camera.rs"]
mod virtual_camera;
#[path = "optics/visibility.rs"]
mod visibility;

use gonio_instrument::{Description, Misalignment, builtin};

/// A built-in instrument.
fn instrument(name: &str) -> Description {
    builtin::description(name).expect("a built-in name").expect("readable")
}

/// The built-in errors of a real instrument.
fn errors() -> Misalignment {
    builtin::misalignment().expect("readable")
}
