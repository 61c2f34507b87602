//! How a command ends: the exit codes of the contract, and errors that say what to do next.

use std::process::ExitCode;

/// A command that did its work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for was done: exit 0.
    Done,
    /// Done, but something unplanned is missing; the text says what: exit 3.
    WithLoss(String),
}

/// A command that did not.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The work failed: exit 1.
    #[error("{0}")]
    Failed(String),
    /// The command line or an input file asks for what cannot be: exit 2.
    #[error("{0}")]
    Usage(String),
    /// A device failed: exit 4.
    #[error("{0}")]
    Device(String),
}

impl Failure {
    /// A failure of the work, with what was being done.
    pub fn failed(doing: &str, why: impl std::fmt::Display) -> Self {
        Self::Failed(format!("{doing}: {why}"))
    }

    /// A request that cannot be met as it stands.
    pub fn usage(what: impl std::fmt::Display) -> Self {
        Self::Usage(what.to_string())
    }

    /// Exit code of the contract.
    #[must_use]
    pub const fn code(&self) -> u8 {
        match self {
            Self::Failed(_) => 1,
            Self::Usage(_) => 2,
            Self::Device(_) => 4,
        }
    }
}

impl From<gonio_instrument::DeviceError> for Failure {
    fn from(e: gonio_instrument::DeviceError) -> Self {
        Self::Device(e.to_string())
    }
}

/// A line on stderr; where the terminal is closed nobody reads it, and nothing fails for that.
pub(crate) fn told(line: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Exit code of an outcome; prints the one error line, or what was lost, on stderr.
#[must_use]
pub fn exit_code(result: &Result<Outcome, Failure>) -> ExitCode {
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::WithLoss(what)) => {
            told(&format!("warning: done with loss: {what}"));
            ExitCode::from(3)
        }
        Err(e) => {
            told(&format!("error: {e}"));
            ExitCode::from(e.code())
        }
    }
}
