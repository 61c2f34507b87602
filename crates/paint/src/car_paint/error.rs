//! Why something is no car paint.

use super::ContainerError;
use crate::FlakeBtfError;

/// A paint that cannot be made or read.
#[derive(Debug, thiserror::Error)]
pub enum CarPaintError {
    /// An axis of a table.
    #[error("the {name} axis has {found}, expected {expected}")]
    Axis {
        /// Which axis.
        name: &'static str,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Another number of values than the axes ask for.
    #[error("{what} has {found} values, expected {expected} by its axes")]
    Count {
        /// Of what.
        what: &'static str,
        /// Given.
        found: usize,
        /// By the axes.
        expected: usize,
    },
    /// A number outside its bounds.
    #[error("{key} = {found} in a car paint: expected {expected}; correct it")]
    Value {
        /// Its name.
        key: String,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Flake textures that are none.
    #[error(transparent)]
    Flakes(#[from] FlakeBtfError),
    /// The file itself is damaged.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// The file is whole, but not what a car paint needs.
    #[error("car-paint file: {what} is {found}, expected {expected}; make the file again from its source")]
    Content {
        /// What was looked for.
        what: String,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: String,
    },
    /// A line of a published table.
    #[error("line {line}, column {column}: found {found}, expected {expected}")]
    Line {
        /// From 1.
        line: usize,
        /// Name of the column.
        column: String,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// None, or an unknown one, of several paints named.
    #[error("paint \"{name}\" is not in the table; name one as FILE#NAME: {known}")]
    Unknown {
        /// Asked for.
        name: String,
        /// Those that are there.
        known: String,
    },
}

impl CarPaintError {
    pub(super) fn value(
        key: impl Into<String>,
        found: impl std::fmt::Display,
        expected: &'static str,
    ) -> Self {
        Self::Value { key: key.into(), found: found.to_string(), expected }
    }

    pub(super) fn content(
        what: impl Into<String>,
        found: impl std::fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Content { what: what.into(), found: found.to_string(), expected: expected.into() }
    }
}
