//! Names of the files in the folder that host and guest share.

/// The instrument's description.
pub const INSTRUMENT: &str = "instrument.toml";
/// Certificate of the white reference.
pub const CERTIFICATE: &str = "certificate.json";
/// The scan of the white reference through USB.
pub const WHITE: &str = "usb-white.mcap";
/// The scan of the sample through USB.
pub const SAMPLE: &str = "usb-sample.mcap";
