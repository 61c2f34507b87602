//! The virtual instrument: firmware behaviour and ray-traced optics
pub mod firmware;
pub mod world;
