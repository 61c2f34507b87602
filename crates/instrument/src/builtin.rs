//! The instruments that come with the program.

use crate::{Description, FileError, Misalignment};

/// The reference instrument, 1280 × 1024.
pub const REFERENCE: &str = include_str!("../builtin/reference.toml");
/// The same optics before a 160 × 128 camera and a plan of six poses, for tests that need many scans.
pub const TINY: &str = include_str!("../builtin/tiny.toml");
/// Errors of a real instrument, for the virtual one.
pub const MISALIGNMENT: &str = include_str!("../builtin/misalignment.toml");

/// A built-in description by name, `reference` or `tiny`; `None` for any other name.
///
/// # Errors
/// [`FileError`] would mean that the file shipped is damaged.
pub fn description(name: &str) -> Option<Result<Description, FileError>> {
    match name {
        "reference" => Some(Description::from_toml(REFERENCE)),
        "tiny" => Some(Description::from_toml(TINY)),
        _ => None,
    }
}

/// The built-in misalignment.
///
/// # Errors
/// [`FileError`] would mean that the file shipped is damaged.
pub fn misalignment() -> Result<Misalignment, FileError> {
    Misalignment::from_toml(MISALIGNMENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_shipped_is_readable_and_survives_a_round_trip() {
        for name in ["reference", "tiny"] {
            let d = description(name).expect("known name").expect("readable");
            assert_eq!(d.name, name);
            assert_eq!(Description::from_toml(&d.to_toml().expect("writable")).expect("readable"), d);
        }
        assert_eq!(misalignment().expect("readable").tilt_zero_deg, 0.5);
        assert!(description("other").is_none());
    }

    #[test]
    fn a_plan_outside_the_limits_names_the_pose_and_the_limits() {
        let text = REFERENCE.replace("80, 85]", "80, 95]");
        let e = Description::from_toml(&text).expect_err("95 degrees is out of reach").to_string();
        assert!(e.contains("plan.tilt_deg[17]") && e.contains("95") && e.contains("87"), "{e}");
    }
}
