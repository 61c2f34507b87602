//! How a scan is watched and stopped from another terminal.
//!
//! Each running scan listens on a Unix socket named by its process id, in a folder only its user can enter. One JSON
//! object a line: `{"ask": "status" | "stop" | "emergency-stop" | "pause" | "resume"}`, answered by one [`ScanState`].

use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use gonio_instrument::{Cancel, LinkStatistics};
use serde::{Deserialize, Serialize};

/// What a scan tells of itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanState {
    /// Process id.
    pub pid: u32,
    /// Session file.
    pub session: String,
    /// What is measured.
    pub kind: String,
    /// Step it is at.
    pub step: String,
    /// Poses done.
    pub poses_done: u32,
    /// Poses of the plan.
    pub poses_total: u32,
    /// Estimated time to the end, seconds.
    pub remaining_s: f64,
    /// Whether it is paused.
    pub paused: bool,
    /// Last fit, in words.
    pub fit: String,
    /// What the scan waits for; empty while it goes on.
    #[serde(default)]
    pub waiting_for: String,
    /// How the link to the stage is doing.
    #[serde(default)]
    pub link: LinkStatistics,
}

/// What is asked of a running scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ask {
    /// Tell the state.
    Status,
    /// Stop in a controlled way.
    Stop,
    /// Motion and lamp off at once.
    EmergencyStop,
    /// Hold after the current exposure.
    Pause,
    /// Go on.
    Resume,
}

#[derive(Serialize, Deserialize)]
struct Request {
    ask: Ask,
}

/// The listening end, inside the scan.
pub struct Control {
    socket: PathBuf,
    state: Arc<Mutex<ScanState>>,
    paused: Arc<AtomicBool>,
}

impl Control {
    /// Starts to listen for this process.
    ///
    /// # Errors
    /// The system's reason; a scan can run without being watched, so callers warn and go on.
    pub fn listen(state: ScanState, cancel: Cancel) -> std::io::Result<Self> {
        let socket = runtime_folder()?.join(format!("{}.sock", std::process::id()));
        let _ = std::fs::remove_file(&socket);
        let listener = UnixListener::bind(&socket)?;
        let state = Arc::new(Mutex::new(ScanState { pid: std::process::id(), ..state }));
        let paused = Arc::new(AtomicBool::new(false));
        let control = Self { socket, state: state.clone(), paused: paused.clone() };
        std::thread::Builder::new().name("control".to_owned()).spawn(move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else { break };
                // one client that misbehaves must not keep others away
                let _ = answer(&stream, &state, &paused, &cancel);
            }
        })?;
        Ok(control)
    }

    /// Changes what is told.
    pub fn update(&self, change: impl FnOnce(&mut ScanState)) {
        change(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Whether a pause is asked for.
    #[must_use]
    pub fn paused(&self) -> bool {
        self.paused.load(Ordering::SeqCst)
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.socket);
    }
}

fn answer(
    stream: &UnixStream,
    state: &Mutex<ScanState>,
    paused: &AtomicBool,
    cancel: &Cancel,
) -> std::io::Result<()> {
    stream.set_read_timeout(Some(Duration::from_secs(2)))?;
    stream.set_write_timeout(Some(Duration::from_secs(2)))?;
    let mut line = String::new();
    BufReader::new(std::io::Read::take(stream, 4096)).read_line(&mut line)?;
    match serde_json::from_str::<Request>(&line).map(|r| r.ask) {
        Ok(Ask::Stop) => cancel.stop(),
        Ok(Ask::EmergencyStop) => cancel.emergency_stop(),
        Ok(Ask::Pause) => paused.store(true, Ordering::SeqCst),
        Ok(Ask::Resume) => paused.store(false, Ordering::SeqCst),
        Ok(Ask::Status) => {}
        Err(e) => return Err(std::io::Error::other(e)),
    }
    let mut told = state.lock().unwrap_or_else(PoisonError::into_inner).clone();
    told.paused = paused.load(Ordering::SeqCst);
    let mut stream = stream;
    writeln!(stream, "{}", serde_json::to_string(&told)?)
}

/// Asks every scan of this user that runs on this machine; leftovers of scans that are gone are cleared away.
///
/// # Errors
/// The system's reason where the folder cannot be read.
pub fn ask_all(ask: Ask) -> std::io::Result<Vec<ScanState>> {
    let mut states = Vec::new();
    for entry in std::fs::read_dir(runtime_folder()?)? {
        let path = entry?.path();
        if path.extension().is_none_or(|e| e != "sock") {
            continue;
        }
        match ask_one(&path, ask) {
            Ok(s) => states.push(s),
            Err(e) if e.kind() == std::io::ErrorKind::ConnectionRefused => {
                let _ = std::fs::remove_file(&path);
            }
            Err(e) => tracing::warn!("{}: {e}", path.display()),
        }
    }
    states.sort_by_key(|s| s.pid);
    Ok(states)
}

fn ask_one(socket: &Path, ask: Ask) -> std::io::Result<ScanState> {
    let mut stream = UnixStream::connect(socket)?;
    stream.set_read_timeout(Some(Duration::from_secs(2)))?;
    writeln!(stream, "{}", serde_json::to_string(&Request { ask })?)?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line)?;
    serde_json::from_str(&line).map_err(std::io::Error::other)
}

/// `$GONIO_RUNTIME_DIR`, `$XDG_RUNTIME_DIR/gonio` or `/tmp/gonio-UID`, private to the user.
fn runtime_folder() -> std::io::Result<PathBuf> {
    let uid = rustix::process::getuid().as_raw();
    let folder = match (std::env::var_os("GONIO_RUNTIME_DIR"), std::env::var_os("XDG_RUNTIME_DIR")) {
        (Some(own), _) => PathBuf::from(own),
        (None, Some(xdg)) if Path::new(&xdg).is_dir() => Path::new(&xdg).join("gonio"),
        _ => std::env::temp_dir().join(format!("gonio-{uid}")),
    };
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&folder)?;
    if std::fs::metadata(&folder)?.uid() != uid {
        return Err(std::io::Error::other(format!("{} belongs to another user", folder.display())));
    }
    Ok(folder)
}
