//! The look-ups of flake map and colour map as one WGSL file that a renderer takes over.

/// The file: `gonio_flake_map(light, view)` and `gonio_colour_map(light, view)`, with their headers and buffers in bindings 0 to 3 of group 0.
pub const LOOK_UP_WGSL: &str = include_str!("../shaders/look_up.wgsl");
