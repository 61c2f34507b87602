//! The native file: a measured table as NetCDF classic.
//!
//! ```text
//! dimensions  theta_i, theta_o, phi, channel (3), bound (2), channel_name_length (5)
//! double      theta_i(theta_i), theta_o(theta_o), phi(phi)                degrees
//! double      theta_o_bnds(theta_o, bound), phi_bnds(phi, bound)          degrees, bins of the cells
//! char        channel_name(channel, channel_name_length)                 red, green, blue
//! float       brdf, sigma [, brdf_base, brdf_node, sigma_PART…] (theta_i, theta_o, phi, channel)    1/sr
//! byte        flag(theta_i, theta_o, phi)                                 0 measured, 1 filled, 2 extrapolated, 3 invalid
//! global      gonio_format, gonio_format_version, Conventions, value, lamp_half_angle_deg, azimuth_convention, …, gonio_digest
//! ```
//!
//! A sample that looks different when it is turned has one dimension more, phi_i (azimuth of the light on the sample), first of all, and phi over the whole circle.
//!
//! `gonio_digest` is the SHA-256 of the whole file with the 64 digits of the digest itself written as `0`; it covers header,
//! data and padding, so any changed bit is found. Files are the same byte for byte whenever the table is the same.
//! [`write`] makes the bytes, [`read`] takes ours and any classic file that has these variables; [`classic`] is the bounded reader below both.

mod anisotropic;
pub(crate) mod classic;
mod digest;
mod read;
mod write;

pub use anisotropic::{has_azimuths, read as read_anisotropic, write as write_anisotropic};
pub use read::read;
pub use write::write;

/// Name of the format in error messages.
const NAME: &str = "NetCDF";
/// Value of `gonio_format`.
const FORMAT: &str = "gonio measured BRDF";
/// Value of `gonio_format_version`.
const FORMAT_VERSION: &str = "1";
/// Attribute that holds the digest.
const DIGEST: &str = "gonio_digest";
/// All that begins so is ours; a file with any such attribute must have the whole set and a right digest.
const OURS: &str = "gonio_";
/// Prefix of the variables that keep the parts of sigma apart.
const PART: &str = "sigma_";
/// Attributes written from the table itself, so not part of `Measured::attributes`.
const RESERVED: [&str; 7] = [
    "Conventions",
    "value",
    "lamp_half_angle_deg",
    "azimuth_convention",
    "polar_convention",
    "brdf_convention",
    "colour_space",
];

#[cfg(test)]
mod tests;
