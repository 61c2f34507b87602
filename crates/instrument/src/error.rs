//! Why a description, plan, misalignment or certificate file was refused.

/// A file of this room that cannot be used. The text names the place and what to do.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// Not TOML, or not the fields that are expected; the parser's text carries line, column and the offending line.
    #[error("{what} cannot be read: {reason}")]
    Syntax {
        /// Which kind of file was expected.
        what: &'static str,
        /// The parser's message with line and excerpt.
        reason: String,
    },
    /// Another kind of file.
    #[error("expected a file with format = \"{expected}\", found \"{found}\"; was another file meant?")]
    Format {
        /// The format name expected.
        expected: &'static str,
        /// The format name found.
        found: String,
    },
    /// A version this program does not know.
    #[error(
        "{what} has version {found}, this program reads version {known}; update gonio or convert the file"
    )]
    Version {
        /// Which kind of file.
        what: &'static str,
        /// Version found.
        found: u32,
        /// Newest version known.
        known: u32,
    },
    /// A number outside what can be.
    #[error("{field} = {found}, expected {expected}")]
    Value {
        /// Full name of the field, `section.field`.
        field: String,
        /// What the file says.
        found: String,
        /// What would be accepted.
        expected: String,
    },
}

impl FileError {
    pub(crate) fn value(field: &str, found: impl std::fmt::Debug, expected: &str) -> Self {
        Self::Value { field: field.to_owned(), found: format!("{found:?}"), expected: expected.to_owned() }
    }
}
