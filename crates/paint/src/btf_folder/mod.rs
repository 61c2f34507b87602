//! A flake BTF as other programs keep it: a folder of pictures, one per pair of angles, and a TOML that says which is which.
//!
//! ```toml
//! format = "gonio-flake-btf"
//! version = 1
//! texel_mm = 0.02            # side of a texel on the surface
//! coat_index = 1.5           # the angles are inside a coat of this index; left out: no coat
//! through = "two-way"        # texels are those of the base, T(θi)T(θo)/n² divided out; "refracted-only": as seen outside
//!
//! [[slice]]
//! half_deg = 0.0
//! incidence_deg = 0.0
//! file = "slice_00_00.exr"   # or .png of 16 bits
//! full_scale = 0.5           # of a PNG: what 65535 stands for, 1/sr; 1 where it is left out
//! ```
//!
//! Texels are linear RGB (Rec. 709, D65) in 1/sr. All slices have one size, and each pair of a half angle and an angle of incidence has one. Pictures are
//! told apart by their content.

mod error;
mod index;
mod picture;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use error::BtfFolderError;
pub use index::INDEX_NAME;
pub use read::{BtfFolder, read_btf_folder};
pub use write::{SliceFormat, write_btf_folder};
