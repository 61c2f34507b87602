//! What can be wrong with a file, with the place and what to do next.

use std::path::{Path, PathBuf};

use crate::ModelError;

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct FormatError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub problem: Problem,
}

impl FormatError {
    pub(crate) fn new(path: &Path, problem: impl Into<Problem>) -> Self {
        Self { path: path.to_owned(), problem: problem.into() }
    }
}

/// What to do about the words of the operating system.
fn advice(e: &std::io::Error) -> &'static str {
    use std::io::ErrorKind;
    match e.kind() {
        ErrorKind::NotFound => "; check the name of the file",
        ErrorKind::PermissionDenied => "; check the owner and mode of the file and its folder",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "; make room or choose another place",
        _ => "",
    }
}

/// What is wrong, without the path: the readers work on bytes and do not know where these came from.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The operating system refused.
    #[error("{}{}", .0, advice(.0))]
    Io(#[from] std::io::Error),
    /// The output is there already.
    #[error("exists already and is not overwritten; remove it, choose another name or give --force")]
    Exists,
    /// No known content.
    #[error("content is not known (it begins with {beginning}); known are {known}")]
    Unknown {
        /// The first bytes, printable.
        beginning: String,
        /// The formats that would be accepted.
        known: &'static str,
    },
    /// The file ends too early, or a count in it is larger than the file.
    #[error(
        "{format} file is truncated or damaged: {what} at byte {offset} needs {needed} bytes, the file has {available} left"
    )]
    Truncated {
        /// Name of the format.
        format: &'static str,
        /// What was being read.
        what: String,
        /// Where.
        offset: u64,
        /// Bytes it would take.
        needed: u64,
        /// Bytes there are.
        available: u64,
    },
    /// A value that the format does not allow, in a binary file.
    #[error("{format} file is damaged or of another kind: {what} is {found}, expected {expected}")]
    Malformed {
        /// Name of the format.
        format: &'static str,
        /// What was being read.
        what: String,
        /// What the file says.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// A value that cannot be used, in a text file.
    #[error("line {line}, column {column}: found {found}, expected {expected}")]
    Line {
        /// Line in the file, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// What the file says.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// The digest in the file does not belong to its content.
    #[error(
        "the digest in the file is {stated}, its content has {computed}: the file was damaged, or changed by another program; take it \
         from its source again, or, if the change was meant, delete the attributes whose names begin with `gonio_`"
    )]
    Digest {
        /// SHA-256 written in the file.
        stated: String,
        /// SHA-256 of what is there.
        computed: String,
    },
    /// Several materials in the file and none, or an unknown one, named.
    #[error("material \"{name}\" is not in the file; name one as FILE#NAME: {available}")]
    Material {
        /// What was asked for.
        name: String,
        /// Names that the file holds, shortened.
        available: String,
    },
    /// A `model.json` that cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A flake map that cannot be used.
    #[error(transparent)]
    FlakeMap(#[from] crate::maps::MapFileError),
    /// The content cannot be written in the format asked for.
    #[error("{content} cannot be written as {format}: {advice}")]
    Unsuitable {
        /// What was to be written.
        content: String,
        /// The format asked for.
        format: &'static str,
        /// What to do instead.
        advice: String,
    },
}

impl Problem {
    pub(crate) fn malformed(
        format: &'static str,
        what: impl Into<String>,
        found: impl std::fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Malformed { format, what: what.into(), found: found.to_string(), expected: expected.into() }
    }

    pub(crate) fn line(
        line: u64,
        column: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Line { line, column: column.into(), found: found.into(), expected: expected.into() }
    }
}
