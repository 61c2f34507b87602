//! The virtual instrument: firmware behaviour and ray-traced optics
