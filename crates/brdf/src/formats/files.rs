//! Files whole or not at all: read with a look at what they are, written aside and renamed.

use std::io::Write as _;
use std::path::Path;

use super::{FormatError, Problem};

/// All bytes of a regular file.
///
/// # Errors
/// [`FormatError`] where there is none or it cannot be read; devices and pipes, which may never end, are refused.
pub fn read_file(path: &Path) -> Result<Vec<u8>, FormatError> {
    let read = || {
        let kind = std::fs::metadata(path)?;
        if !kind.is_file() {
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "is not a regular file"));
        }
        std::fs::read(path)
    };
    read().map_err(|e| FormatError::new(path, e))
}

/// Writes `bytes` so that `path` is either the whole new file or what it was: to a file beside it, synced, then renamed.
///
/// # Errors
/// [`Problem::Exists`] where something is there and `force` is not given; what the system says otherwise. Nothing is left behind.
pub fn write_file(path: &Path, bytes: &[u8], force: bool) -> Result<(), FormatError> {
    let fail = |e: std::io::Error| FormatError::new(path, e);
    if !force && path.symlink_metadata().is_ok() {
        return Err(FormatError::new(path, Problem::Exists));
    }
    let Some(name) = path.file_name() else {
        return Err(fail(std::io::Error::new(std::io::ErrorKind::InvalidInput, "is not the name of a file")));
    };
    let mut aside = std::ffi::OsString::from(".");
    aside.push(name);
    aside.push(format!(".{}.part", std::process::id()));
    let aside = path.with_file_name(aside);
    let written = (|| {
        let mut file = std::fs::OpenOptions::new().write(true).create_new(true).open(&aside)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        drop(file);
        if force {
            std::fs::rename(&aside, path)
        } else {
            // a hard link refuses where a rename would replace a file that came in between
            match std::fs::hard_link(&aside, path) {
                Err(e) if e.kind() != std::io::ErrorKind::AlreadyExists => std::fs::rename(&aside, path),
                done => {
                    std::fs::remove_file(&aside)?;
                    done
                }
            }
        }
    })();
    written.map_err(|e| {
        // the file aside may not exist; what counts is the first error
        let _ = std::fs::remove_file(&aside);
        match e.kind() {
            std::io::ErrorKind::AlreadyExists if !force => FormatError::new(path, Problem::Exists),
            _ => fail(e),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_overwritten_without_force_and_nothing_is_left_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.nc");
        write_file(&path, b"one", false).unwrap();
        assert!(matches!(write_file(&path, b"two", false).unwrap_err().problem, Problem::Exists));
        assert_eq!(read_file(&path).unwrap(), b"one");
        write_file(&path, b"two", true).unwrap();
        assert_eq!(read_file(&path).unwrap(), b"two");
        let absent = dir.path().join("absent/b.nc");
        assert!(matches!(write_file(&absent, b"x", false).unwrap_err().problem, Problem::Io(_)));
        assert!(write_file(dir.path(), b"x", true).is_err());
        assert!(read_file(dir.path()).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
