//! File formats, one file each, told apart by content.
//!
//! [`open`] reads any of them as [`Loaded`], [`save`] writes ours. Readers and writers work on bytes and know no path ([`Problem`]);
//! [`read_file`] and [`write_file`] touch the disk and put the path to what went wrong ([`FormatError`]). Nothing is overwritten
//! unless asked, nothing half-written stays behind, and no damaged file makes a reader panic or allocate more than its size justifies.

pub mod cornell;
mod csv_rows;
pub(crate) mod cursor;
mod describe;
mod detect;
mod error;
mod files;
pub mod geometry_csv;
mod half_difference;
mod loaded;
pub mod mbsdf;
pub mod measured_csv;
pub mod merl;
pub mod nbrdf;
pub mod netcdf;
pub mod rgl;
mod save;

pub use describe::{Axes, Cells, Summary};
pub use detect::{Format, detect};
pub use error::{FormatError, Problem};
pub use files::{read_file, write_file};
pub use loaded::{Function, Loaded, identify, open};
pub use save::{Saved, Target, save};

#[cfg(test)]
mod tests;
