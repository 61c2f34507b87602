//! File formats, one file each, told apart by content.
//!
//! Readers and writers work on bytes and know no path ([`Problem`]); [`read_file`] and [`write_file`] touch the disk and put the path
//! to what went wrong ([`FormatError`]). Nothing is overwritten unless asked, nothing half-written stays behind, and no damaged file
//! makes a reader panic or allocate more than the file's size justifies.

mod csv_rows;
pub(crate) mod cursor;
mod error;
mod files;
pub mod geometry_csv;
pub mod measured_csv;
pub mod netcdf;

pub use error::{FormatError, Problem};
pub use files::{read_file, write_file};
