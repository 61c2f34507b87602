//! The machine: QEMU with Debian's kernel, this machine's files under a layer of memory, and a bus to plug devices into.
//!
//! The guest says on its console how its job ended. A guest that ends without saying so, whatever QEMU's own exit status, has failed.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::super::line::PORT;

/// Words before the exit status on the guest's console.
const MARK: &str = "gonio-hil exit code ";
/// Lines of the console that are shown of a failed run.
const TAIL: usize = 30;
const MEMORY_MB: u32 = 1536;

/// Kernel and memory disk, as `scripts/hil set-up` leaves them.
#[derive(Clone, Debug)]
pub struct Files {
    /// Kernel.
    pub kernel: PathBuf,
    /// Memory disk.
    pub initrd: PathBuf,
}

/// Why a machine does not run.
#[derive(Debug, thiserror::Error)]
pub enum MachineError {
    /// Nothing to boot.
    #[error("{0} is not there; run `scripts/hil set-up` first")]
    NotSetUp(PathBuf),
    /// No QEMU.
    #[error("qemu-system-x86_64 cannot be started ({0}); run `scripts/hil set-up` first")]
    NoQemu(io::Error),
    /// The folder for the run cannot be used.
    #[error("{path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's words.
        source: io::Error,
    },
}

/// Where QEMU listens.
#[derive(Clone, Debug)]
pub struct Sockets {
    /// Serial adapter.
    pub serial: PathBuf,
    /// USB stage.
    pub usb: PathBuf,
    /// Camera.
    pub camera: PathBuf,
    /// Control channel.
    pub control: PathBuf,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The guest said this status.
    Status(i32),
    /// The machine ended and said nothing.
    Silent(String),
    /// It did not end in time and was stopped.
    TooLate(Duration),
}

/// A running machine. Dropping it switches it off.
#[derive(Debug)]
pub struct Machine {
    child: Child,
    console: PathBuf,
    sockets: Sockets,
    started: Instant,
}

impl Machine {
    /// Boots a machine that runs the shell script `job`, which sees `folder` at `/gonio-job`. Sockets and console go to `folder` too; its
    /// path must be short, as paths of sockets are.
    ///
    /// # Errors
    /// [`MachineError`].
    pub fn boot(files: &Files, folder: &Path, job: &str) -> Result<Machine, MachineError> {
        for file in [&files.kernel, &files.initrd] {
            if !file.exists() {
                return Err(MachineError::NotSetUp(file.clone()));
            }
        }
        let at = |source| MachineError::Folder { path: folder.to_path_buf(), source };
        std::fs::write(folder.join("run"), job).map_err(at)?;
        let sockets = Sockets {
            serial: folder.join("serial"),
            usb: folder.join("usb"),
            camera: folder.join("camera"),
            control: folder.join("control"),
        };
        let console = folder.join("console.log");
        let words = File::create(folder.join("qemu.log")).map_err(at)?;
        let child = Command::new("qemu-system-x86_64")
            .args(arguments(files, folder, &console, &sockets))
            .stdin(Stdio::null())
            .stdout(words.try_clone().map_err(at)?)
            .stderr(words)
            .spawn()
            .map_err(MachineError::NoQemu)?;
        Ok(Machine { child, console, sockets, started: Instant::now() })
    }

    /// Where QEMU listens, or will in a moment.
    #[must_use]
    pub fn sockets(&self) -> &Sockets {
        &self.sockets
    }

    /// Waits until the machine has switched itself off, at most `longest` from its start, and says how it ended.
    pub fn wait(&mut self, longest: Duration) -> Ended {
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return self.ended(status),
                Ok(None) if self.started.elapsed() > longest => {
                    let _ = self.child.kill();
                    let _ = self.child.wait();
                    return Ended::TooLate(longest);
                }
                Ok(None) => std::thread::sleep(Duration::from_millis(20)),
                Err(error) => return Ended::Silent(error.to_string()),
            }
        }
    }

    /// It still runs.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    fn ended(&self, status: ExitStatus) -> Ended {
        match said_status(&self.console_text()) {
            Some(code) => Ended::Status(code),
            None => Ended::Silent(format!("QEMU ended with {status}, the guest said no exit code")),
        }
    }

    fn console_text(&self) -> String {
        std::fs::read(&self.console).map(|b| String::from_utf8_lossy(&b).into_owned()).unwrap_or_default()
    }

    /// What the guest's kernel said when it fell over, if it did: its fault, not that of what is tested on it.
    #[must_use]
    pub fn kernel_fault(&self) -> Option<String> {
        said_fault(&self.console_text()).map(ToOwned::to_owned)
    }

    /// The last lines of the guest's console.
    #[must_use]
    pub fn console_tail(&self) -> String {
        let text = self.console_text();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(TAIL)..].join("\n")
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The status said last on a console.
fn said_status(console: &str) -> Option<i32> {
    let (_, after) = console.rsplit_once(MARK)?;
    let digits: String = after.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().ok()
}

/// The line in which a kernel says that it made a mistake.
fn said_fault(console: &str) -> Option<&str> {
    let first =
        |mark: &str| console.lines().find(|l| l.starts_with('[') && l.contains(mark)).map(str::trim_end);
    first("] BUG: ").or_else(|| first("] Oops")).or_else(|| first("] Kernel panic"))
}

fn arguments(files: &Files, folder: &Path, console: &Path, sockets: &Sockets) -> Vec<String> {
    let path = |p: &Path| p.display().to_string();
    let mut a: Vec<String> = Vec::new();
    let mut add = |words: &[&str]| a.extend(words.iter().map(|w| (*w).to_owned()));
    // one processor: the emulation of two costs more than it gives
    add(&["-machine", "pc", "-accel", "tcg", "-smp", "1", "-m", &MEMORY_MB.to_string()]);
    add(&["-nodefaults", "-no-user-config", "-no-reboot", "-display", "none"]);
    add(&["-kernel", &path(&files.kernel), "-initrd", &path(&files.initrd)]);
    add(&["-append", "console=ttyS0 quiet oops=panic panic=-1 mitigations=off"]);
    add(&["-serial", &format!("file:{}", path(console))]);
    add(&["-fsdev", "local,id=host,path=/,security_model=none,readonly=on,multidevs=remap"]);
    add(&["-device", "virtio-9p-pci,fsdev=host,mount_tag=host"]);
    add(&["-fsdev", &format!("local,id=job,path={},security_model=none", path(folder))]);
    add(&["-device", "virtio-9p-pci,fsdev=job,mount_tag=job"]);
    add(&["-device", "virtio-serial-pci", "-device", &format!("virtserialport,chardev=control,name={PORT}")]);
    add(&["-device", "qemu-xhci,id=bus"]);
    for (id, socket) in [
        ("control", &sockets.control),
        ("serial", &sockets.serial),
        ("usb", &sockets.usb),
        ("camera", &sockets.camera),
    ] {
        add(&["-chardev", &format!("socket,id={id},path={},server=on,wait=off", path(socket))]);
    }
    add(&["-device", "usb-serial,chardev=serial,bus=bus.0"]);
    add(&["-device", "usb-redir,chardev=usb,bus=bus.0,debug=0"]);
    add(&["-device", "usb-redir,chardev=camera,bus=bus.0,debug=0"]);
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_guest_says_last_counts() {
        assert_eq!(said_status("boot\ngonio-hil exit code 0\r\n[ 9.2] reboot: Power down"), Some(0));
        assert_eq!(said_status("gonio-hil exit code 0\ngonio-hil exit code 3\n"), Some(3));
        assert_eq!(said_status("Kernel panic - not syncing"), None);
        assert_eq!(said_status("gonio-hil exit code "), None);
    }

    #[test]
    fn a_kernel_that_fell_over_is_told_from_a_test_that_did() {
        let console = "[   45.1] Freeing memory\n[   45.2] BUG: kernel NULL pointer dereference, address: 00000000000000b0\r\n[   45.3] Oops: 0002 [#1]\n";
        assert_eq!(
            said_fault(console),
            Some("[   45.2] BUG: kernel NULL pointer dereference, address: 00000000000000b0")
        );
        assert_eq!(said_fault("thread 'main' panicked: BUG: of ours\ngonio-hil exit code 1\n"), None);
    }

    #[test]
    fn without_a_set_up_it_says_how_to_make_one() {
        let nothing = Files { kernel: "/nowhere/vmlinuz".into(), initrd: "/nowhere/initrd".into() };
        let error = Machine::boot(&nothing, Path::new("/tmp"), "").expect_err("nothing to boot").to_string();
        assert!(error.contains("scripts/hil set-up"), "{error}");
    }
}
