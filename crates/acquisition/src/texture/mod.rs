//! Textures of single flakes from the texture camera's frames ([`gonio_instrument::TextureCamera`]).
//!
//! The light of a pixel is `rate = k E0 g · f cos θi`; a white reference seen at the same tilts gives k E0 g pixel by pixel. Each head's picture is laid onto a
//! square raster fixed to the sample, so that a flake stays at its texel from slice to slice: a texel takes the pixels of each colour that lie within
//! one tile of the filter pattern, weighted by a tent (linear interpolation on the lattice of that colour). A slice belongs to the half angle and the angle of
//! incidence of its tilt and head inside the coat, and becomes f of the base (T(θi)T(θo)/n² divided out) where an index is given.
//!
//! Heads within the mirror image of the lamp see the coat's gloss and nothing else; they are left out.

mod grid;
mod heads;
mod reduce;
mod white;

pub use grid::{GridChoice, choose};
pub use heads::interest;
pub use reduce::{TextureReducer, TextureSlice};
pub use white::{TextureWhite, TextureWhiteBuilder};

/// Textures that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TextureError {
    /// The session was taken with another camera.
    #[error("the session does not hold frames of a texture camera; record one with `gonio scan --texture`")]
    NoTextures,
    /// A pose that cannot be merged.
    #[error(transparent)]
    Frames(#[from] crate::AcquisitionError),
    /// No white pose.
    #[error(
        "the white reference has no pose that lights the texture camera; scan it with `gonio scan --texture --kind white`"
    )]
    NoWhite,
    /// The reference is of other heads.
    #[error(
        "the white reference was taken with other heads than the sample; scan it again with this instrument"
    )]
    OtherHeads,
    /// The slices do not cover a grid of angles.
    #[error(
        "no grid of at least 2 × 2 slices, {step_deg}° apart, is covered by the {slices} slices recorded to within {tolerance_deg}°; scan more tilts or choose a coarser step"
    )]
    NoGrid {
        /// Recorded.
        slices: usize,
        /// Asked for.
        step_deg: f64,
        /// Allowed.
        tolerance_deg: f64,
    },
}
