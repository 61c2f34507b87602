//! The udev rules that come with the program: are they there, and putting them there.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::outcome::Failure;
use crate::output::write_whole;

/// The rules.
pub const RULES: &str = include_str!("../../../udev/70-gonio.rules");
/// Their file name.
pub const FILE: &str = "70-gonio.rules";
/// Where a system keeps rules of its own.
pub const FOLDER: &str = "/etc/udev/rules.d";
/// Where packages put theirs.
const PACKAGED: [&str; 2] = ["/usr/lib/udev/rules.d", "/lib/udev/rules.d"];

/// Whether the rules are in force.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// They are, from this file.
    Installed(PathBuf),
    /// Another version of them is.
    Other(PathBuf),
    /// They are not.
    Missing,
    /// This machine has no udev.
    NoUdev,
}

impl State {
    /// In one word, for machines.
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Installed(_) => "installed",
            Self::Other(_) => "other version",
            Self::Missing => "missing",
            Self::NoUdev => "no udev",
        }
    }

    /// The file, where there is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Installed(path) | Self::Other(path) => Some(path),
            _ => None,
        }
    }
}

/// Looks for the rules in the folder, then where packages put them. A file in the folder hides those of packages.
pub fn state(folder: &Path) -> State {
    let mut folders = vec![folder.to_path_buf()];
    if folder == Path::new(FOLDER) {
        folders.extend(PACKAGED.iter().map(PathBuf::from));
    }
    for path in folders.iter().map(|f| f.join(FILE)) {
        match std::fs::read(&path) {
            Ok(bytes) if bytes == RULES.as_bytes() => return State::Installed(path),
            Ok(_) => return State::Other(path),
            Err(_) => {}
        }
    }
    if folders.iter().any(|f| f.is_dir()) { State::Missing } else { State::NoUdev }
}

/// What installing did.
pub struct Installed {
    /// The file.
    pub path: PathBuf,
    /// What was done with it.
    pub what: &'static str,
    /// udev has been told.
    pub reloaded: bool,
    /// What is to do now.
    pub next: String,
}

/// Writes the rules into the folder and has udev read them.
///
/// # Errors
/// [`Failure::Usage`] where other rules are in the way, [`Failure::Failed`] with the command line where this takes an administrator.
pub fn install(folder: &Path, force: bool) -> Result<Installed, Failure> {
    // a system whose packages have rules reads this one too, once it is there
    let readable = folder == Path::new(FOLDER) && PACKAGED.iter().any(|p| Path::new(p).is_dir());
    if readable && !folder.is_dir() && std::fs::create_dir_all(folder).is_err() {
        return Err(Failure::Failed(format!(
            "only an administrator may make {}; run: {}",
            folder.display(),
            sudo_line(folder, force)
        )));
    }
    if !folder.is_dir() {
        return Err(Failure::failed(
            &format!("{} is not there", folder.display()),
            "this machine has no udev, or keeps its rules elsewhere; name the folder with --rules-folder",
        ));
    }
    let path = folder.join(FILE);
    let what = match std::fs::read(&path) {
        Ok(bytes) if bytes == RULES.as_bytes() => "is installed already",
        Ok(_) if !force => {
            return Err(Failure::usage(format!(
                "{} is there with other rules and is not overwritten; look at the difference, then say --force",
                path.display()
            )));
        }
        Ok(_) => "replaced",
        Err(e) if e.kind() == ErrorKind::NotFound => "installed",
        Err(e) => return Err(Failure::failed(&format!("{} cannot be read", path.display()), e)),
    };
    if what != "is installed already" {
        if !may_write(folder) {
            return Err(Failure::Failed(format!(
                "only an administrator may write to {}; run: {}",
                folder.display(),
                sudo_line(folder, force)
            )));
        }
        write_whole(&path, RULES.as_bytes())?;
    }
    // rules for another root are read when that one starts
    let reloaded = folder == Path::new(FOLDER) && reload();
    let next = if reloaded {
        "devices plugged in now have their permissions; log in again if you were added to a group".to_owned()
    } else {
        "have udev read them (`sudo udevadm control --reload && sudo udevadm trigger`), or plug the devices in anew".to_owned()
    };
    Ok(Installed { path, what, reloaded, next })
}

fn may_write(folder: &Path) -> bool {
    rustix::fs::access(folder, rustix::fs::Access::WRITE_OK).is_ok()
}

/// The command line that an administrator runs.
pub fn sudo_line(folder: &Path, force: bool) -> String {
    let program = std::env::current_exe().map_or_else(|_| "gonio".to_owned(), |p| p.display().to_string());
    let mut line = format!("sudo {program} doctor --install-udev");
    if folder != Path::new(FOLDER) {
        line += &format!(" --rules-folder {}", folder.display());
    }
    if force {
        line += " --force";
    }
    line
}

fn reload() -> bool {
    let udevadm = |arguments: &[&str]| {
        Command::new("udevadm").args(arguments).output().is_ok_and(|output| output.status.success())
    };
    let trigger =
        ["trigger", "--subsystem-match=usb", "--subsystem-match=tty", "--subsystem-match=video4linux"];
    udevadm(&["control", "--reload"]) && udevadm(&trigger)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_installed_once_and_never_written_over_unasked() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(state(folder.path()), State::Missing);
        let first = install(folder.path(), false).expect("installed");
        assert_eq!((first.what, first.reloaded), ("installed", false));
        assert_eq!(state(folder.path()), State::Installed(first.path.clone()));
        assert_eq!(install(folder.path(), false).expect("again").what, "is installed already");
        std::fs::write(&first.path, "# mine\n").expect("changed");
        assert_eq!(state(folder.path()), State::Other(first.path.clone()));
        let refused = install(folder.path(), false).err().expect("refused");
        assert!(refused.code() == 2 && refused.to_string().contains("--force"), "{refused}");
        assert_eq!(std::fs::read_to_string(&first.path).expect("text"), "# mine\n");
        assert_eq!(install(folder.path(), true).expect("replaced").what, "replaced");
        assert_eq!(std::fs::read_to_string(&first.path).expect("text"), RULES);
    }

    #[test]
    fn a_machine_without_udev_is_told_so() {
        let nowhere = Path::new("/nowhere/rules.d");
        assert_eq!(state(nowhere), State::NoUdev);
        let failed = install(nowhere, false).err().expect("no folder");
        assert!(failed.code() == 1 && failed.to_string().contains("--rules-folder"), "{failed}");
        assert!(
            sudo_line(nowhere, true)
                .ends_with("doctor --install-udev --rules-folder /nowhere/rules.d --force")
        );
    }

    #[test]
    fn the_rules_name_the_stage_as_the_driver_finds_it() {
        use gonio_driver::transport::usb::{PRODUCT, STAGE_CLASS, VENDOR};
        let (class, subclass, protocol) = STAGE_CLASS;
        assert!(RULES.contains(&format!(":{class:02x}{subclass:02x}{protocol:02x}:")));
        assert!(RULES.contains(&format!("ATTR{{idVendor}}==\"{VENDOR:04x}\"")));
        assert!(RULES.contains(&format!("ATTR{{idProduct}}==\"{PRODUCT:04x}\"")));
        let number: u32 = FILE.split('-').next().and_then(|n| n.parse().ok()).expect("a number");
        assert!(number < 73, "uaccess is acted on by 73-seat-late.rules");
    }
}
