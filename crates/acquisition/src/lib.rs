//! From raw frames to a measured BRDF, and the scan that takes the frames.
pub mod holder;
pub mod optics;
pub mod pixel_map;
