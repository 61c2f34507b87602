//! Session journal: what a scan records, and how it is read back, checked, mended, continued and replayed.
//!
//! A session is an MCAP file with one chunk per pose, on the disk before the pose counts as done; `docs/session-file.md`
//! gives the layout. The records are written and read here rather than by a general library, for three reasons: a seal behind each pose
//! closes what MCAP's checksums leave open and finds the way after damage; an unfinished file can be finished in
//! place, and whole chunks copied as they are; and nothing read from a damaged file can panic, ask for gigabytes, or come
//! out before its checksum is known. The tests hold the files against MCAP's own readers.
//!
//! This room knows no device and no measurement: who drives a scan calls [`Writer`], who recomputes one runs the same code
//! over [`replay::ReplayStage`] and [`replay::ReplayCamera`].

mod bytes;
mod chunk;
mod chunk_builder;
mod definitions;
mod digest;
mod encode;
pub mod error;
pub mod header;
pub mod info;
pub mod layout;
mod medium;
mod message;
pub mod paths;
pub mod recover;
pub mod replay;
pub mod resume;
mod schema;
mod seal;
mod segment;
mod segment_writer;
pub mod session;
pub mod space;
pub mod verify;
pub mod writer;

pub use chunk::RecordedPose;
pub use error::RecordingError;
pub use header::{Attachment, Devices, Header, SessionRecord};
pub use info::{Info, info};
pub use medium::FileFaults;
pub use recover::recover;
pub use resume::{Progress, progress, resume, resume_with};
pub use segment::Finding;
pub use session::{Event, Note, Session, WireBytes};
pub use space::{check_space, free_space, space_needed, space_per_pose};
pub use verify::{LostPose, Report, Status, verify};
pub use writer::{Clock, Direction, Level, Writer, WriterOptions, now};
