//! From raw frames to a measured BRDF: calibration, exposure merge, gridding, filling, the scan engine
