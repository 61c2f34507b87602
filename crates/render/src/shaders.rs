//! What renderers take over as WGSL: the look-ups of flake map and colour map, and flakes drawn from statistics, one file each.

/// The file: `gonio_flake_map(light, view)` and `gonio_colour_map(light, view)`, with their headers and buffers in bindings 0 to 3 of group 0.
pub const LOOK_UP_WGSL: &str = include_str!("../shaders/look_up.wgsl");

/// Flakes of car paints drawn from their statistics, two to four paints blended: `gonio_flakes(light, view, position_mm)`, with its header and
/// buffers in bindings 0 to 4 of group 0.
pub const FLAKES_WGSL: &str = include_str!("../shaders/flakes.wgsl");
