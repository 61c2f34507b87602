//! Angles, directions, frames; Fresnel and Snell; flake space; colour
