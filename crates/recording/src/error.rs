//! What can go wrong with a session file; every text says what was found and what to do next.

use std::path::{Path, PathBuf};

/// An error of this room. It can be cloned, because what fails on the journal's thread is told again at every later call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// The output is already there.
    #[error("{} exists; choose another name, continue it with --resume, or overwrite it with --force", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file is not there.
    #[error("{} is not there; check the name of the session file", path.display())]
    Absent {
        /// The file.
        path: PathBuf,
    },
    /// The folder of an output is not there.
    #[error("{} cannot be created: its folder is not there; make the folder or choose another place", path.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
    },
    /// The user may not read or write it.
    #[error("permission to {action} {} was denied; check the owner and mode of the file and its folder", path.display())]
    Denied {
        /// `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
    },
    /// Another program is writing it.
    #[error("{} is being written by another program; wait for its scan or end it with `gonio stop`", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// No room left while writing.
    #[error(
        "the disk is full: {} cannot grow past {written} bytes; the poses finished so far are kept, free some space and continue with --resume",
        path.display()
    )]
    DiskFull {
        /// The file.
        path: PathBuf,
        /// Bytes that are safely on disk.
        written: u64,
    },
    /// Too little room to begin.
    #[error(
        "{} has {free} bytes free and this plan may need {needed}; free some space or record elsewhere",
        path.display()
    )]
    NotEnoughSpace {
        /// The folder or file asked about.
        path: PathBuf,
        /// Bytes the plan may need.
        needed: u64,
        /// Bytes free.
        free: u64,
    },
    /// Any other word of the operating system.
    #[error("{}: cannot {action}: {reason}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// Not one of our sessions.
    #[error("{} is not a gonio session: {found}; was another file meant?", path.display())]
    NotASession {
        /// The file.
        path: PathBuf,
        /// What was found instead.
        found: String,
    },
    /// A version this program does not know.
    #[error("{} has session format version {found}, this program reads version {known}; update gonio", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Version found.
        found: u32,
        /// Newest version known.
        known: u32,
    },
    /// A part of the file does not verify.
    #[error("{}, byte {offset}: {what}; see `gonio verify`, and copy what is whole with `gonio recover`", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where the damaged part begins.
        offset: u64,
        /// What is wrong with it.
        what: String,
    },
    /// A pose that the session does not hold.
    #[error("{} holds no whole pose {index}", path.display())]
    NoSuchPose {
        /// The file.
        path: PathBuf,
        /// The pose asked for.
        index: u32,
    },
    /// A part that the session does not hold.
    #[error(
        "{} holds no readable {name}; see `gonio verify` (`gonio replay --instrument` takes a description from elsewhere)",
        path.display()
    )]
    NoSuchPart {
        /// The file.
        path: PathBuf,
        /// Name of the attachment.
        name: String,
    },
    /// A frame whose size and pixels disagree.
    #[error(
        "a frame of {width} × {height} pixels came with {pixels} values; the camera back end is at fault"
    )]
    BadFrame {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Values delivered.
        pixels: usize,
    },
    /// More frames at one pose than a chunk may hold.
    #[error("pose {index} has grown past {limit} bytes; lower plan.repeats or plan.max_exposures")]
    PoseTooLarge {
        /// The pose.
        index: u32,
        /// Most bytes of one chunk.
        limit: u64,
    },
    /// The calls came in an order that has no meaning.
    #[error("the journal was told to {call} {state}; this is a fault of the program")]
    Order {
        /// The call.
        call: &'static str,
        /// The state it came in.
        state: &'static str,
    },
    /// A continued scan is not the scan that was begun.
    #[error("{} was begun with another {what}; continue it with the same one, or record a new session", path.display())]
    Mismatch {
        /// The session.
        path: PathBuf,
        /// What differs.
        what: &'static str,
    },
    /// A description that cannot be written or read.
    #[error("the {what} of the session cannot be used: {reason}")]
    Header {
        /// Which part.
        what: &'static str,
        /// The parser's words.
        reason: String,
    },
    /// The journal's thread has ended.
    #[error("the journal of {} has stopped; what was finished is kept, continue with --resume", path.display())]
    Stopped {
        /// The file.
        path: PathBuf,
    },
}

impl RecordingError {
    /// Turns the system's error into ours; `written` is what is safely on disk.
    pub(crate) fn io(action: &'static str, path: &Path, written: u64, e: &std::io::Error) -> Self {
        use std::io::ErrorKind::{
            AlreadyExists, NotFound, PermissionDenied, QuotaExceeded, ReadOnlyFilesystem, StorageFull,
        };
        let path = path.to_owned();
        match e.kind() {
            NotFound if action == "open" => Self::Absent { path },
            NotFound if action == "create" => Self::NoFolder { path },
            AlreadyExists => Self::Exists { path },
            PermissionDenied | ReadOnlyFilesystem => {
                let action = if matches!(action, "open" | "read") { "read" } else { "write" };
                Self::Denied { action, path }
            }
            StorageFull | QuotaExceeded => Self::DiskFull { path, written },
            _ => Self::Io { action, path, reason: e.to_string() },
        }
    }
}
