//! Where a segment is written to: a file, or in tests something that runs out of room.

use std::fs::File;
use std::io::{Seek as _, SeekFrom, Write as _};

/// An output that grows at its end, can be made durable, and can be cut back.
pub(crate) trait Medium: Send {
    /// Appends all bytes.
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()>;
    /// Returns when everything appended is on the disk.
    fn sync(&mut self) -> std::io::Result<()>;
    /// Cuts back to `length` and appends from there.
    fn cut(&mut self, length: u64) -> std::io::Result<()>;
}

impl Medium for File {
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.write_all(bytes)
    }

    fn sync(&mut self) -> std::io::Result<()> {
        self.sync_data()
    }

    fn cut(&mut self, length: u64) -> std::io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(|_| ())
    }
}
