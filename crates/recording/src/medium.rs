//! Where a segment is written to: a file, or one that runs out of room, fails, or is slow.

use std::fs::File;
use std::io::{Error, ErrorKind, Seek as _, SeekFrom, Write as _};
use std::time::Duration;

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

/// How bad the disk is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FileFaults {
    /// It is full after so many bytes.
    pub full_after: Option<u64>,
    /// It fails after so many bytes.
    pub fail_after: Option<u64>,
    /// Chance of each write to fail, 0 to 1.
    pub fail: f64,
    /// Each write takes so much longer.
    pub slow: Duration,
    /// What chances are drawn from.
    pub seed: u64,
}

/// A file on a bad disk: what does not go through leaves half a write behind, as a real one does.
pub(crate) struct FaultyFile {
    file: File,
    faults: FileFaults,
    length: u64,
    state: u64,
}

impl FaultyFile {
    pub(crate) fn new(file: File, faults: FileFaults) -> Self {
        Self { file, faults, length: 0, state: faults.seed }
    }

    /// SplitMix64, in [0, 1).
    fn fraction(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl Medium for FaultyFile {
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        std::thread::sleep(self.faults.slow);
        let end = self.length + bytes.len() as u64;
        let past = |limit: Option<u64>| limit.filter(|&n| end > n);
        let broken = match (past(self.faults.full_after), past(self.faults.fail_after)) {
            (Some(limit), _) => Some((limit, Error::from(ErrorKind::StorageFull))),
            (None, Some(limit)) => Some((limit, Error::other("the disk does not answer (injected)"))),
            (None, None) if self.fraction() < self.faults.fail => Some((
                self.length + bytes.len() as u64 / 2,
                Error::other("the disk does not answer (injected)"),
            )),
            (None, None) => None,
        };
        let Some((limit, error)) = broken else {
            self.file.append(bytes)?;
            self.length = end;
            return Ok(());
        };
        let fits = usize::try_from(limit.saturating_sub(self.length)).unwrap_or(0).min(bytes.len());
        self.file.append(bytes.get(..fits).unwrap_or(bytes))?;
        self.length += fits as u64;
        Err(error)
    }

    fn sync(&mut self) -> std::io::Result<()> {
        self.file.sync()
    }

    fn cut(&mut self, length: u64) -> std::io::Result<()> {
        self.length = length;
        self.file.cut(length)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::{Arc, Mutex};

    use gonio_instrument::{Exposure, Frame, Pose};

    use super::*;
    use crate::segment_writer::SegmentWriter;
    use crate::writer::{Clock, Level, Writer};
    use crate::{RecordingError, Session};

    /// A disk of a given size.
    struct SmallDisk {
        bytes: Arc<Mutex<Vec<u8>>>,
        size: usize,
    }

    impl Medium for SmallDisk {
        fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
            let mut disk = self.bytes.lock().expect("not poisoned");
            let room = (self.size - disk.len()).min(bytes.len());
            disk.extend_from_slice(&bytes[..room]);
            if room < bytes.len() { Err(Error::from(ErrorKind::StorageFull)) } else { Ok(()) }
        }

        fn sync(&mut self) -> std::io::Result<()> {
            Ok(())
        }

        fn cut(&mut self, length: u64) -> std::io::Result<()> {
            self.bytes.lock().expect("not poisoned").truncate(length as usize);
            Ok(())
        }
    }

    fn record(w: &mut Writer, index: u32, size: u32) -> Result<u64, RecordingError> {
        w.begin_pose(index, Pose::default(), Pose::default())?;
        let mut x = 1u64 + u64::from(index);
        let pixels = (0..size * size)
            .map(|_| {
                x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (x >> 48) as u16
            })
            .collect();
        w.frame(&Exposure {
            frame: Frame {
                width: size,
                height: size,
                pixels,
                exposure: Duration::from_millis(1),
                sequence: 0,
                stamp: Duration::ZERO,
                sensor_temperature_c: None,
            },
            lamp_monitor: 1.0,
            shutter_open: true,
        })?;
        w.end_pose()
    }

    #[test]
    fn a_full_disk_costs_the_pose_that_did_not_fit_and_no_other() {
        let instrument = gonio_instrument::builtin::description("tiny").expect("built in").expect("readable");
        let header = crate::Header::new(instrument.clone(), instrument.plan, Default::default());
        let record_0 = crate::SessionRecord::new(&header, 1, Duration::ZERO).expect("made");
        let attachments = crate::header::attachments(&header, &record_0).expect("made");
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let disk = SmallDisk { bytes: Arc::clone(&bytes), size: 100_000 };
        let path = Path::new("small.mcap");
        let segment = SegmentWriter::create(Box::new(disk), path, &attachments, 0).expect("fits");
        let clock = Clock::Steps { start: Duration::ZERO, step: Duration::from_millis(1) };
        let mut w = Writer::over(segment, path, 1, clock);
        let first = record(&mut w, 0, 64).expect("fits");
        record(&mut w, 1, 64).expect("fits");
        // 2 × 256² bytes of noise are more than the disk
        let full = record(&mut w, 2, 256).expect_err("does not fit");
        assert!(matches!(full, RecordingError::DiskFull { written, .. } if written > first), "{full}");
        assert!(full.to_string().contains("--resume"), "{full}");
        assert_eq!(w.event(Duration::ZERO, Level::Error, "?").expect_err("told again"), full);
        assert_eq!(w.finish().expect_err("told at the end"), full);
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("s.mcap");
        std::fs::write(&file, &*bytes.lock().expect("not poisoned")).expect("written");
        let s = Session::open(&file).expect("opens");
        assert!(s.finished(), "closed all the same");
        assert_eq!(s.poses().map(|p| p.expect("whole").index).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(crate::verify(&file).expect("readable").findings, []);
    }
}
