//! What the stories share: golden tables, real measurements through `GONIO_DATA`, an imperfect virtual instrument, and the reliability campaigns.
//!
//! Real measurements are not part of the project. A story asks for them with [`real_data`]; where `GONIO_DATA` is unset it says so and ends,
//! where it is set and a file is missing the story fails. Every story writes one line to stderr past the capture of the test harness, so that
//! `cargo test 2>&1 | grep -o 'real data ran:' | wc -l` and the same with `real data did not run:` count them (the harness may have written the
//! beginning of the line).

pub mod campaign;
pub mod imperfect;

use std::ffi::OsString;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The variable that names the folder, an absolute path.
pub const VARIABLE: &str = "GONIO_DATA";

/// The folder of real measurements.
#[derive(Clone, Debug)]
pub struct RealData {
    folder: PathBuf,
}

/// The folder, or `None` where it is not given; `story` is named in the line that is counted.
///
/// # Panics
/// Where `GONIO_DATA` is set to something that is not an absolute path of a folder.
#[must_use]
pub fn real_data(story: &str) -> Option<RealData> {
    let found = locate(std::env::var_os(VARIABLE));
    match &found {
        Some(_) => say(&format!("real data ran: {story}")),
        None => say(&format!("real data did not run: {story} ({VARIABLE} is not set)")),
    }
    found
}

/// One line past the harness's capture, which takes the print macros only.
pub fn say(line: &str) {
    // a closed stderr must not fail a story
    let _ = writeln!(std::io::stderr(), "{line}");
}

fn locate(value: Option<OsString>) -> Option<RealData> {
    let folder = PathBuf::from(value.filter(|v| !v.is_empty())?);
    assert!(
        folder.is_absolute() && folder.is_dir(),
        "{VARIABLE} is {folder:?}, expected the absolute path of a folder"
    );
    Some(RealData { folder })
}

impl RealData {
    /// A file of the folder.
    ///
    /// # Panics
    /// Where it is missing: a story that is asked to run must not pass without its data.
    #[must_use]
    pub fn file(&self, relative: &str) -> PathBuf {
        let path = self.folder.join(relative);
        assert!(path.is_file(), "{VARIABLE} is set but {} is missing", path.display());
        path
    }
}

/// A golden file of the project, under `tests/golden`.
#[must_use]
pub fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden").join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_folder_is_no_failure_and_a_wrong_one_is() {
        assert!(locate(None).is_none() && locate(Some(OsString::new())).is_none());
        for wrong in ["relative/folder", "/no/such/folder/anywhere"] {
            assert!(std::panic::catch_unwind(|| locate(Some(OsString::from(wrong)))).is_err(), "{wrong}");
        }
        let here = locate(Some(OsString::from(env!("CARGO_MANIFEST_DIR")))).unwrap();
        assert!(here.file("Cargo.toml").is_file());
        assert!(std::panic::catch_unwind(|| here.file("absent.bin")).is_err());
    }
}
