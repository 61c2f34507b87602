//! Names of a session's files: `S.mcap`, and `S.2.mcap`, `S.3.mcap` … for what a continued scan adds.

use std::path::{Path, PathBuf};

/// File of segment `number` (from 1) of the session `first`.
#[must_use]
pub fn segment_path(first: &Path, number: u32) -> PathBuf {
    if number <= 1 {
        return first.to_owned();
    }
    let stem = first.file_stem().unwrap_or_default().to_string_lossy();
    let name = match first.extension() {
        Some(e) => format!("{stem}.{number}.{}", e.to_string_lossy()),
        None => format!("{stem}.{number}"),
    };
    first.with_file_name(name)
}

/// Numbers of the continuation segments that lie beside `first`, ascending; gaps are kept visible.
pub(crate) fn continuations(first: &Path) -> Vec<u32> {
    let folder = first.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let stem = first.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = first.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    let mut numbers: Vec<u32> = entries
        .flatten()
        .filter_map(|e| {
            let name = e.file_name();
            let rest = name.to_str()?.strip_prefix(&stem)?.strip_prefix('.')?;
            let digits =
                if extension.is_empty() { rest } else { rest.strip_suffix(&extension)?.strip_suffix('.')? };
            let number: u32 = digits.parse().ok()?;
            // `S.02.mcap` is somebody else's file
            (number >= 2 && number.to_string() == digits).then_some(number)
        })
        .collect();
    numbers.sort_unstable();
    numbers
}

/// A path in JSON; bytes that are no UTF-8 cannot stand there and are replaced.
pub(crate) fn shown<S: serde::Serializer>(path: &Path, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(&path.to_string_lossy())
}

/// Several of them.
pub(crate) fn all_shown<S: serde::Serializer>(paths: &[PathBuf], s: S) -> Result<S::Ok, S::Error> {
    s.collect_seq(paths.iter().map(|p| p.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_named_and_found_beside_the_first() {
        let dir = tempfile::tempdir().expect("a folder");
        let first = dir.path().join("paint.v1.mcap");
        assert_eq!(segment_path(&first, 2), dir.path().join("paint.v1.2.mcap"));
        for name in
            ["paint.v1.mcap", "paint.v1.2.mcap", "paint.v1.4.mcap", "paint.v1.02.mcap", "paint.3.mcap"]
        {
            std::fs::write(dir.path().join(name), b"").expect("written");
        }
        assert_eq!(continuations(&first), [2, 4]);
    }
}
