//! The firmware behind a pseudo-terminal: to a host it is a serial port.
//!
//! The terminal is raw, so no byte is changed on its way. One slave is held open here: otherwise the master would read errors whenever
//! no host has the port open. A host that goes away is noticed by its heartbeats ceasing, as on a real line.
//!
//! The plug can be pulled, by [`Pty::pull`] or by a scheduled hang-up: the terminal is closed, the firmware goes on without it, and a new
//! terminal takes its place when it is plugged in again.

use super::Served;
use crate::firmware::Firmware;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest sleep, so that a stop is noticed.
const LONGEST_SLEEP: Duration = Duration::from_millis(10);
/// How often the firmware is looked after while the plug is pulled.
const UNPLUGGED_SLEEP: Duration = Duration::from_millis(1);
/// Bytes kept for a host that does not read; what comes after is lost, as on a real line.
const BACKLOG: usize = 16 * 1024;

/// Why no pseudo-terminal could be served.
#[derive(Debug, thiserror::Error)]
pub enum PtyError {
    /// The system gives none.
    #[error("the system gives no pseudo-terminal ({0}); is /dev/pts mounted, and are any left?")]
    Open(Errno),
    /// The name leads to another terminal that is there.
    #[error(
        "{} leads to {}, which another program serves; end that one, or choose another name for the pseudo-terminal",
        link.display(),
        to.display()
    )]
    InUse {
        /// The link.
        link: PathBuf,
        /// Where it leads.
        to: PathBuf,
    },
    /// The name for it is taken by something that is not a link.
    #[error("{0} exists and is not a link; choose another name for the pseudo-terminal")]
    NotALink(PathBuf),
    /// The name for it cannot be made.
    #[error("the link {path} to the pseudo-terminal cannot be made: {source}")]
    Link {
        /// Its path.
        path: PathBuf,
        /// The system's words.
        source: std::io::Error,
    },
    /// No thread.
    #[error("the firmware's thread cannot be started: {0}")]
    Thread(std::io::Error),
}

/// A served pseudo-terminal.
#[derive(Debug)]
pub struct Pty {
    /// Where the host opens it: the link if one was asked for, else the terminal itself as it was at first.
    pub path: PathBuf,
    plug: Arc<Plug>,
    served: Served,
}

/// What the firmware's thread and the owner of the terminal share.
#[derive(Debug)]
struct Plug {
    link: Option<PathBuf>,
    /// Somebody holds the plug in his hand.
    pulled: AtomicBool,
    /// The terminal there is now.
    target: Mutex<Option<PathBuf>>,
}

/// The name under which the terminal is found now; it changes where no link leads to it and the plug was pulled.
#[derive(Clone, Debug)]
pub struct PortName(Arc<Plug>);

impl PortName {
    /// The link, or the terminal; `None` while the plug is pulled.
    #[must_use]
    pub fn path(&self) -> Option<PathBuf> {
        let target = self.0.target();
        target.map(|target| self.0.link.clone().unwrap_or(target))
    }
}

impl Plug {
    fn target(&self) -> Option<PathBuf> {
        self.target.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set_target(&self, target: Option<PathBuf>) {
        *self.target.lock().unwrap_or_else(PoisonError::into_inner) = target;
    }

    /// Removes the link, never what it might have been replaced by.
    fn unlink(&self) {
        if let (Some(link), Some(target)) = (&self.link, self.target())
            && std::fs::read_link(link).is_ok_and(|to| to == target)
        {
            let _ = std::fs::remove_file(link);
        }
    }
}

impl Pty {
    /// Ends the firmware; a host sees the port hang up.
    pub fn stop(&mut self) {
        self.served.stop();
        self.plug.unlink();
        self.plug.set_target(None);
    }

    /// Pulls the plug: the port hangs up and its name is gone on return; the firmware lives on.
    pub fn pull(&self) {
        self.plug.pulled.store(true, Ordering::SeqCst);
        while self.plug.target().is_some() && self.served.is_running() {
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Plugs it in again: the port is there on return.
    pub fn plug(&self) {
        self.plug.pulled.store(false, Ordering::SeqCst);
        while self.plug.target().is_none() && self.served.is_running() {
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Where to look for the port after it hung up.
    #[must_use]
    pub fn name(&self) -> PortName {
        PortName(Arc::clone(&self.plug))
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        self.stop();
    }
}

/// An open terminal. `_slave` is only held.
struct Terminal {
    master: OwnedFd,
    _slave: OwnedFd,
    target: PathBuf,
}

impl Terminal {
    fn open() -> Result<Terminal, PtyError> {
        let master =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).map_err(PtyError::Open)?;
        grantpt(&master).map_err(PtyError::Open)?;
        unlockpt(&master).map_err(PtyError::Open)?;
        let name = ptsname(&master, Vec::new()).map_err(PtyError::Open)?;
        let slave = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())
            .map_err(PtyError::Open)?;
        let mut termios = tcgetattr(&slave).map_err(PtyError::Open)?;
        termios.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &termios).map_err(PtyError::Open)?;
        let flags = rustix::fs::fcntl_getfl(&master).map_err(PtyError::Open)?;
        rustix::fs::fcntl_setfl(&master, flags | OFlags::NONBLOCK).map_err(PtyError::Open)?;
        let target = PathBuf::from(name.to_string_lossy().into_owned());
        Ok(Terminal { master, _slave: slave, target })
    }
}

/// Runs the firmware on a thread behind a new pseudo-terminal; `link`, if given, becomes a symbolic link to it (an old link of
/// that name that leads nowhere is replaced).
///
/// # Errors
/// [`PtyError`].
pub fn serve_pty(firmware: Firmware, link: Option<&Path>) -> Result<Pty, PtyError> {
    let terminal = Terminal::open()?;
    if let Some(link) = link {
        make_link(&terminal.target, link)?;
    }
    let path = link.map_or_else(|| terminal.target.clone(), Path::to_path_buf);
    let plug = Arc::new(Plug {
        link: link.map(Path::to_path_buf),
        pulled: AtomicBool::new(false),
        target: Mutex::new(Some(terminal.target.clone())),
    });
    let stop = Arc::new(AtomicBool::new(false));
    let (seen, shared) = (Arc::clone(&stop), Arc::clone(&plug));
    let thread = std::thread::Builder::new()
        .name("gonio-firmware".into())
        .spawn(move || run(firmware, terminal, &shared, &seen))
        .map_err(PtyError::Thread)?;
    Ok(Pty { path, plug, served: Served::new(stop, thread) })
}

fn make_link(target: &Path, link: &Path) -> Result<(), PtyError> {
    let error = |source| PtyError::Link { path: link.to_path_buf(), source };
    match std::fs::symlink_metadata(link) {
        Ok(found) if found.file_type().is_symlink() => {
            // a terminal that is still there is served by somebody, unless it is the one just opened under an old number
            if let Ok(to) = std::fs::read_link(link)
                && to != target
                && to.exists()
            {
                return Err(PtyError::InUse { link: link.to_path_buf(), to });
            }
            std::fs::remove_file(link).map_err(error)?;
        }
        Ok(_) => return Err(PtyError::NotALink(link.to_path_buf())),
        Err(_) => {}
    }
    std::os::unix::fs::symlink(target, link).map_err(error)
}

fn run(mut firmware: Firmware, terminal: Terminal, plug: &Plug, stop: &AtomicBool) {
    let start = Instant::now();
    let mut terminal = Some(terminal);
    let mut input = [0u8; 4096];
    let mut out = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let away = plug.pulled.load(Ordering::SeqCst) || firmware.is_unplugged(start.elapsed());
        if away && terminal.is_some() {
            plug.unlink();
            terminal = None;
            plug.set_target(None);
        } else if !away && terminal.is_none() {
            terminal = plug_in(plug);
        }
        let Some(Terminal { master, .. }) = &terminal else {
            firmware.poll(start.elapsed(), &mut out);
            // said into nowhere
            out.clear();
            std::thread::sleep(UNPLUGGED_SLEEP);
            continue;
        };
        // Bytes before time: a late thread must not find a lease expired whose renewal is waiting.
        loop {
            match rustix::io::read(master, &mut input) {
                Ok(0) | Err(Errno::AGAIN) => break,
                Ok(n) => firmware.receive(start.elapsed(), input.get(..n).unwrap_or(&[])),
                Err(Errno::INTR) => {}
                // EIO: no slave is open; cannot be while one is held, and would pass.
                Err(_) => break,
            }
        }
        firmware.poll(start.elapsed(), &mut out);
        match rustix::io::write(master, &out) {
            Ok(n) => drop(out.drain(..n)),
            Err(_) => out.truncate(BACKLOG),
        }
        let now = start.elapsed();
        let sleep = firmware.next_timeout(now).saturating_sub(now).min(LONGEST_SLEEP);
        let wanted = if out.is_empty() { PollFlags::IN } else { PollFlags::IN | PollFlags::OUT };
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(sleep.subsec_nanos()) };
        let _ = poll(&mut [PollFd::new(master, wanted)], Some(&timeout));
    }
}

/// A new terminal under the old name; one that cannot be had now is tried again.
fn plug_in(plug: &Plug) -> Option<Terminal> {
    let terminal = Terminal::open().ok()?;
    if let Some(link) = &plug.link {
        make_link(&terminal.target, link).ok()?;
    }
    plug.set_target(Some(terminal.target.clone()));
    Some(terminal)
}
