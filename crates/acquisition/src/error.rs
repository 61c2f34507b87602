//! What can be wrong with frames, references and settings.

use gonio_brdf::ModelError;

/// An acquisition that cannot go on; the text says what to do next.
#[derive(Debug, thiserror::Error)]
pub enum AcquisitionError {
    /// A frame of another size than the instrument's camera.
    #[error(
        "pose {pose} holds a frame of {found_width} x {found_height} pixels, the instrument \"{instrument}\" has {width} x {height}; give the instrument the session was taken with"
    )]
    FrameSize {
        /// Place in the plan.
        pose: u32,
        /// Name of the instrument.
        instrument: String,
        /// Columns found.
        found_width: u32,
        /// Rows found.
        found_height: u32,
        /// Columns expected.
        width: u32,
        /// Rows expected.
        height: u32,
    },
    /// Fewer pixel values than width × height.
    #[error(
        "pose {pose} holds a frame of {found} pixel values, expected {expected}; the recording is damaged, run `gonio verify`"
    )]
    FrameLength {
        /// Place in the plan.
        pose: u32,
        /// Values found.
        found: usize,
        /// Values expected.
        expected: usize,
    },
    /// A pose without a usable frame of the lamp's light.
    #[error(
        "pose {pose} holds no frame taken with the shutter open and the lamp burning; scan that pose again"
    )]
    NoLight {
        /// Place in the plan.
        pose: u32,
    },
    /// A θi that no row of the grid stands for.
    #[error(
        "pose {pose} stands at {theta_i_deg:.3} degrees of incidence, {off_deg:.3} from the nearest row of the grid (at most {limit_deg} is allowed); choose a grid that holds it"
    )]
    OffGrid {
        /// Place in the plan.
        pose: u32,
        /// Angle of incidence.
        theta_i_deg: f64,
        /// Distance from the nearest row.
        off_deg: f64,
        /// Largest distance allowed.
        limit_deg: f64,
    },
    /// A reference past its last day.
    #[error(
        "the certificate of reference {serial} expired on {expires} (today is {today}); have it certified again, or pass --accept-stale, which is recorded"
    )]
    Expired {
        /// Serial number.
        serial: String,
        /// Last day of validity.
        expires: String,
        /// The day it was held against.
        today: String,
    },
    /// A reference measured on another instrument.
    #[error(
        "the reference was measured on instrument \"{found}\" whose {part} differs from that of \"{expected}\"; scan the reference on this instrument, or pass --accept-stale, which is recorded"
    )]
    OtherInstrument {
        /// Instrument of the reference.
        found: String,
        /// Instrument in use.
        expected: String,
        /// What differs.
        part: &'static str,
    },
    /// A certificate whose BRDF cannot be read.
    #[error("the BRDF in the certificate of reference {serial}: {source}")]
    Certificate {
        /// Serial number.
        serial: String,
        /// What is wrong.
        source: ModelError,
    },
    /// A certificate whose table cannot be used.
    #[error("the table in the certificate of reference {serial}: {reason}")]
    CertificateTable {
        /// Serial number.
        serial: String,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// A reference session that saw nothing.
    #[error(
        "the white reference session holds no pose in which a pixel sees the reference; scan the white reference again"
    )]
    EmptyReference,
    /// A setting outside what can be.
    #[error("{name} = {found}, expected {expected}")]
    Setting {
        /// Which.
        name: &'static str,
        /// What was given.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
}
