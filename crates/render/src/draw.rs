//! Drawing: an anti-aliased canvas measured in points, the embedded font, colours and colour maps.
//!
//! Shapes are covered exactly (signed-area accumulation), at fractional positions, so lines neither wobble nor snap.

pub(crate) mod canvas;
pub(crate) mod clip;
pub(crate) mod font;
pub mod palette;
mod shape;
pub(crate) mod text;

pub(crate) use text::{Anchor, Text};
