//! What can be wrong with a folder of slices.

use std::path::PathBuf;

use crate::FlakeBtfError;

/// A folder that is no flake BTF.
#[derive(Debug, thiserror::Error)]
pub enum BtfFolderError {
    /// The operating system refused.
    #[error("{}: {source}; check the name and the permissions", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The TOML cannot be read.
    #[error("{}: {reason}", path.display())]
    Index {
        /// The TOML.
        path: PathBuf,
        /// What is wrong, with its place.
        reason: String,
    },
    /// A value in the TOML that cannot be used.
    #[error("{}: {key} = {found}, expected {expected}", path.display())]
    Value {
        /// The TOML.
        path: PathBuf,
        /// The key.
        key: String,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Pairs of angles without a slice.
    #[error(
        "{}: {count} of {total} slices are missing, the first at half angle {half_deg}°, incidence {incidence_deg}°; every pair of angles that occur needs one",
        path.display()
    )]
    Missing {
        /// The TOML.
        path: PathBuf,
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
        /// The first.
        half_deg: f64,
        /// The first.
        incidence_deg: f64,
    },
    /// A pair of angles with two slices.
    #[error(
        "{}: half angle {half_deg}°, incidence {incidence_deg}° has two slices, {first} and {second}; keep one",
        path.display()
    )]
    Twice {
        /// The TOML.
        path: PathBuf,
        /// Half angle.
        half_deg: f64,
        /// Angle of incidence.
        incidence_deg: f64,
        /// File of one.
        first: String,
        /// File of the other.
        second: String,
    },
    /// A picture that cannot be read as texels.
    #[error("{}: {reason}", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A picture of another size than the first.
    #[error(
        "{}: {} × {} texels, the first slice has {} × {}; all slices need one size",
        path.display(), found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// The picture.
        path: PathBuf,
        /// Its size.
        found: [usize; 2],
        /// That of the first.
        expected: [usize; 2],
    },
    /// A texel that is not a finite number.
    #[error("{}: the texel at x = {x}, y = {y} is not a finite number; mend the picture", path.display())]
    NotFinite {
        /// The picture.
        path: PathBuf,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
    },
    /// A slice that is negative on average.
    #[error(
        "{}: its mean is {mean:.3e} 1/sr in channel {channel}; noise about nothing may be negative, a whole slice may not: subtract less of the base from it",
        path.display()
    )]
    Negative {
        /// The picture.
        path: PathBuf,
        /// Mean, 1/sr.
        mean: f64,
        /// 0 red, 1 green, 2 blue.
        channel: usize,
    },
    /// Something else is wrong with the textures as a whole.
    #[error(transparent)]
    Btf(#[from] FlakeBtfError),
    /// Files are there already.
    #[error("{} exists already and is not overwritten; remove it, choose another name or give --force", .0.display())]
    Exists(PathBuf),
}
