//! A serial port.
//!
//! `serialport` opens, locks and configures the port; bytes go through a second descriptor of the same terminal that stays non-blocking, because
//! `serialport` takes O_NONBLOCK away from its own and then may block in a write for longer than its time-out. The
//! descriptor can also be polled together with a wake-up socket, and shows a hang-up as such.

use super::{Transport, Waker};
use gonio_instrument::DeviceError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use serialport::{ErrorKind, TTYPort};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// Speed where nothing else is asked for; USB serial ports ignore it.
pub const DEFAULT_BAUD: u32 = 921_600;
/// Bytes written at once.
const BLOCK: usize = 512;
/// Bytes kept while the port takes none; what comes after is lost, and sent again by the link.
const BACKLOG: usize = 8 * 1024;

/// An open serial port, held exclusively.
#[derive(Debug)]
pub struct SerialTransport {
    name: String,
    /// Holds lock and settings; never read or written.
    _port: TTYPort,
    fd: OwnedFd,
    wake: UnixStream,
    waker: Waker,
    unsent: VecDeque<u8>,
}

impl SerialTransport {
    /// Opens `path` with 8 data bits, no parity, one stop bit and no flow control.
    ///
    /// # Errors
    /// [`DeviceError::Absent`], [`DeviceError::Denied`], [`DeviceError::InUse`], or [`DeviceError::Io`] for what is no serial port.
    pub fn open(path: &str, baud: u32) -> Result<SerialTransport, DeviceError> {
        // First: once `serialport` holds the port, the kernel refuses everybody but root.
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let fd = rustix::fs::open(path, flags, Mode::empty()).map_err(|errno| open_error(path, errno))?;
        let port = serialport::new(path, baud)
            .timeout(Duration::from_millis(100))
            .open_native()
            .map_err(|error| lock_error(path, &error))?;
        let io =
            |error: std::io::Error| DeviceError::Io { device: path.to_owned(), reason: error.to_string() };
        let (wake, ring) = UnixStream::pair().map_err(io)?;
        wake.set_nonblocking(true).map_err(io)?;
        ring.set_nonblocking(true).map_err(io)?;
        // A full socket means that a wake is waiting already.
        let waker = Waker::new(move || drop((&ring).write(&[1])));
        Ok(SerialTransport { name: path.to_owned(), _port: port, fd, wake, waker, unsent: VecDeque::new() })
    }

    fn error(&self, errno: Errno) -> DeviceError {
        match errno {
            // A terminal whose other side is gone, a USB adapter that was pulled out.
            Errno::IO | Errno::NXIO | Errno::NODEV | Errno::PIPE | Errno::BADF => {
                DeviceError::Gone { device: self.name.clone() }
            }
            other => DeviceError::Io { device: self.name.clone(), reason: other.to_string() },
        }
    }

    fn write_unsent(&mut self) -> Result<(), DeviceError> {
        while !self.unsent.is_empty() {
            let (front, _) = self.unsent.as_slices();
            let block = front.get(..front.len().min(BLOCK)).unwrap_or(front);
            match rustix::io::write(&self.fd, block) {
                Ok(n) => drop(self.unsent.drain(..n)),
                Err(Errno::AGAIN) => return Ok(()),
                Err(Errno::INTR) => {}
                Err(errno) => return Err(self.error(errno)),
            }
        }
        Ok(())
    }
}

impl Transport for SerialTransport {
    fn name(&self) -> &str {
        &self.name
    }

    fn waker(&self) -> Waker {
        self.waker.clone()
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        self.write_unsent()?;
        let wanted = if self.unsent.is_empty() { PollFlags::IN } else { PollFlags::IN | PollFlags::OUT };
        let mut fds = [PollFd::new(&self.fd, wanted), PollFd::new(&self.wake, PollFlags::IN)];
        let timeout = Timespec {
            tv_sec: i64::try_from(timeout.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: i64::from(timeout.subsec_nanos()),
        };
        match poll(&mut fds, Some(&timeout)) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(errno) => return Err(self.error(errno)),
        }
        let came = fds[0].revents();
        if !fds[1].revents().is_empty() {
            // Every wake so far is answered by returning.
            let mut ignored = [0; 64];
            while matches!((&self.wake).read(&mut ignored), Ok(n) if n > 0) {}
        }
        self.write_unsent()?;
        if came.is_empty() || came == PollFlags::OUT {
            return Ok(Vec::new());
        }
        let mut buffer = [0u8; 4096];
        match rustix::io::read(&self.fd, &mut buffer) {
            // Ready, and yet nothing: hung up. In raw mode a terminal never gives an empty read otherwise.
            Ok(0) => Err(DeviceError::Gone { device: self.name.clone() }),
            Ok(n) => Ok(buffer.get(..n).unwrap_or_default().to_vec()),
            Err(Errno::AGAIN | Errno::INTR) if came.contains(PollFlags::HUP) => {
                Err(DeviceError::Gone { device: self.name.clone() })
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(Vec::new()),
            Err(errno) => Err(self.error(errno)),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        if self.unsent.len() + bytes.len() <= BACKLOG {
            self.unsent.extend(bytes);
        }
        self.write_unsent()
    }
}

fn open_error(path: &str, errno: Errno) -> DeviceError {
    let device = path.to_owned();
    match errno {
        Errno::NOENT | Errno::NODEV | Errno::NXIO | Errno::NOTDIR => DeviceError::Absent { device },
        Errno::ACCESS | Errno::PERM => DeviceError::Denied { device },
        Errno::BUSY => DeviceError::InUse { device },
        // An unplugged terminal that still has its name.
        Errno::IO => DeviceError::Absent { device },
        other => DeviceError::Io { device, reason: other.to_string() },
    }
}

fn lock_error(path: &str, error: &serialport::Error) -> DeviceError {
    let device = path.to_owned();
    match error.kind() {
        // `serialport` says "no device" when the port is locked by somebody; that it exists was seen just before.
        ErrorKind::NoDevice => DeviceError::InUse { device },
        ErrorKind::Io(std::io::ErrorKind::PermissionDenied) => DeviceError::Denied { device },
        ErrorKind::Io(std::io::ErrorKind::NotFound) => DeviceError::Absent { device },
        ErrorKind::Io(std::io::ErrorKind::WouldBlock) => DeviceError::InUse { device },
        _ => DeviceError::Io { device, reason: format!("cannot be used as a serial port ({error})") },
    }
}
