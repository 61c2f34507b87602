//! Files and results that a command gives out: nothing overwritten unasked, nothing half-written, JSON alone on stdout.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::outcome::Failure;

/// Refuses a path that exists (unless `force`) or whose folder does not.
///
/// # Errors
/// [`Failure::Usage`] that says what stands in the way.
pub fn check_free(path: &Path, force: bool) -> Result<(), Failure> {
    if path.is_dir() {
        return Err(Failure::usage(format!(
            "{} is a folder, expected the name of a file to write",
            path.display()
        )));
    }
    if path.exists() && !force {
        return Err(Failure::usage(format!(
            "{} exists and is not overwritten; choose another name or say --force",
            path.display()
        )));
    }
    let parent = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if !parent.is_dir() {
        return Err(Failure::usage(format!("folder {} does not exist; create it first", parent.display())));
    }
    Ok(())
}

/// Refuses to write over a file that is read in the same run, whatever `--force` says: a recording cannot be made again.
///
/// # Errors
/// [`Failure::Usage`] naming it.
pub fn check_apart(output: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    match inputs.iter().any(|i| i.canonicalize().is_ok_and(|i| i == target)) {
        true => Err(Failure::usage(format!(
            "{} is read here and cannot be the output too; choose another name",
            output.display()
        ))),
        false => Ok(()),
    }
}

/// Writes a file whole or not at all: to a temporary neighbour first, then renamed.
///
/// # Errors
/// [`Failure::Failed`] with the system's reason; nothing is left behind.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let temporary = neighbour(path, "partial");
    let attempt = std::fs::File::create(&temporary)
        .and_then(|mut f| f.write_all(bytes).and_then(|()| f.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, path));
    attempt.map_err(|e| {
        let _ = std::fs::remove_file(&temporary);
        Failure::failed(&format!("{} cannot be written", path.display()), e)
    })
}

fn neighbour(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{suffix}"));
    path.with_file_name(name)
}

/// `S.mcap` → `S.white.mcap`, `S.nc`, `S.report.html`: files that belong to a session stand beside it.
#[must_use]
pub fn beside(session: &Path, ending: &str) -> PathBuf {
    let mut name = session.file_stem().unwrap_or_default().to_os_string();
    name.push(".");
    name.push(ending);
    session.with_file_name(name)
}

/// A path for JSON, where bytes that are no UTF-8 cannot stand.
#[must_use]
pub fn shown(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Reads a text file the user named.
///
/// # Errors
/// [`Failure::Usage`] with path and reason.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::usage(format!("{} cannot be read: {e}", path.display())))
}

/// Prints results for people, or as one JSON object.
#[derive(Clone, Copy, Debug)]
pub struct Printer {
    /// One JSON object on stdout and nothing else there.
    pub json: bool,
}

impl Printer {
    /// The result: `json` when JSON is asked for, otherwise `text`.
    #[allow(clippy::print_stdout)] // the one place that writes results
    pub fn result(&self, text: &str, json: &serde_json::Value) {
        let out = if self.json { json.to_string() } else { text.trim_end().to_owned() };
        if !out.is_empty() {
            // a closed pipe (`gonio … | head`) is no failure
            let _ = writeln!(std::io::stdout(), "{out}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_session_stand_beside_it() {
        assert_eq!(beside(Path::new("a/S.mcap"), "nc"), Path::new("a/S.nc"));
        assert_eq!(beside(Path::new("S.mcap"), "white.mcap"), Path::new("S.white.mcap"));
    }

    #[test]
    fn an_existing_file_is_kept_unless_forced() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let p = dir.path().join("x.csv");
        write_whole(&p, b"1").expect("written");
        assert_eq!(check_free(&p, false).expect_err("exists").code(), 2);
        check_free(&p, true).expect("forced");
        assert!(check_free(&dir.path().join("no/x.csv"), true).is_err());
    }
}
