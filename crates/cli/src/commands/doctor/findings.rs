//! What is wrong, each with the command that mends it.

use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

use super::survey::{CameraSeen, Seen};
use super::udev::State;

/// All findings, the graver ones first.
pub fn findings(seen: &Seen) -> Vec<String> {
    let mut out = Vec::new();
    let rules = match &seen.udev {
        State::Installed(_) => {
            "the udev rules are installed: plug the device in anew, or log in at the machine itself"
                .to_owned()
        }
        State::NoUdev => {
            "this machine has no udev: give yourself the device file with `sudo chown $USER PATH`".to_owned()
        }
        State::Missing | State::Other(_) => format!("install the udev rules: `{}`", seen.sudo_line),
    };
    for p in seen.ports.iter().filter(|p| !p.permitted) {
        let group = group_of(Path::new(&p.path)).unwrap_or_else(|| "dialout".to_owned());
        out.push(format!(
            "you may not open {}: add yourself to the group that owns it: `sudo usermod -aG {group} $USER`, then log in again",
            p.path
        ));
    }
    for s in seen.stages.iter().filter(|s| !s.permitted) {
        out.push(format!("you may not open {} ({}): {rules}", s.node.display(), s.description));
    }
    for c in seen.cameras.iter().filter(|c| !c.permitted && !c.no_pictures) {
        let group = group_of(Path::new(&c.path)).unwrap_or_else(|| "video".to_owned());
        out.push(format!(
            "you may not open {}: add yourself to the group that owns it: `sudo usermod -aG {group} $USER`, then log in again; or {rules}",
            c.path
        ));
    }
    if seen.ports.is_empty() && seen.stages.is_empty() {
        out.push(
            "no serial port and no USB stage is there: plug the controller in, then look at `sudo dmesg | tail`; without an instrument use --device sim"
                .to_owned(),
        );
    }
    if !seen.usb_trouble.is_empty() {
        out.push(seen.usb_trouble.clone());
    }
    out.extend(seen.cameras.iter().filter(|c| c.permitted && !c.no_pictures).filter_map(camera));
    if cfg!(feature = "cameras") && seen.genicam.is_empty() && seen.cameras.iter().all(|c| c.no_pictures) {
        out.push(
            "no camera is there: plug it in, then look at `sudo dmesg | tail`; without one use --camera sim or sim:SOCKET".to_owned(),
        );
    }
    if let State::Other(path) = &seen.udev {
        out.push(format!(
            "{} holds other udev rules than this gonio's: `diff` them, then `{}`",
            path.display(),
            seen.sudo_line
        ));
    }
    out
}

/// What a camera that can be opened lacks for measuring.
fn camera(c: &CameraSeen) -> Option<String> {
    let named = format!("{} ({})", c.name, c.description);
    if !c.trouble.is_empty() {
        return Some(format!(
            "{named} does not tell all of itself: {}; plug it in anew, or close the program that has it: `sudo fuser -v {}`",
            c.trouble, c.path
        ));
    }
    if c.formats.iter().all(|(_, _, bits)| bits.is_none()) {
        return Some(format!(
            "{named} gives no raw format: it will do for `gonio preview`, not for measuring; see docs/hardware.md for cameras that do"
        ));
    }
    if c.exposure_s.is_none() {
        return Some(format!(
            "{named} has no exposure time that can be set, so it cannot measure: look at `v4l2-ctl -d {} -l`",
            c.path
        ));
    }
    None
}

/// Name of the group that owns a file.
fn group_of(path: &Path) -> Option<String> {
    let gid = std::fs::metadata(path).ok()?.gid();
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    group_name(&groups, gid)
}

fn group_name(groups: &str, gid: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        // root's own files are not for groups
        (fields.nth(1)?.parse() == Ok(gid) && gid != 0).then(|| name.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_driver::ports::PortInfo;
    use gonio_driver::transport::usb::UsbDevice;

    fn seen() -> Seen {
        let port = PortInfo {
            path: "/dev/ttyUSB7".into(),
            usb_id: None,
            description: "adapter".into(),
            serial: String::new(),
            permitted: true,
        };
        let stage = UsbDevice {
            vendor: 0x1209,
            product: 1,
            serial: "G7".into(),
            description: "gonio stage".into(),
            node: "/dev/bus/usb/001/004".into(),
            permitted: true,
            stage: true,
        };
        let camera = CameraSeen {
            path: "/dev/video0".into(),
            name: "v4l:0".into(),
            description: "eye".into(),
            permitted: true,
            formats: vec![("Y16".into(), vec!["160x128".into()], Some(16))],
            exposure_s: Some([1e-4, 2.0]),
            ..CameraSeen::default()
        };
        let metadata = CameraSeen { path: "/dev/video1".into(), no_pictures: true, ..CameraSeen::default() };
        Seen {
            ports: vec![port],
            stages: vec![stage],
            usb_trouble: String::new(),
            cameras: vec![camera, metadata],
            genicam: Vec::new(),
            udev: State::Installed("/etc/udev/rules.d/70-gonio.rules".into()),
            sudo_line: "sudo gonio doctor --install-udev".into(),
        }
    }

    #[test]
    fn a_machine_that_is_in_order_has_no_findings() {
        assert_eq!(findings(&seen()), Vec::<String>::new());
        assert!(!seen().lines().contains("video1"), "a metadata node is not offered as a camera");
        assert_eq!(seen().json()["cameras"][1]["pictures"], false);
    }

    #[test]
    fn what_is_denied_is_told_with_the_command_that_mends_it() {
        let mut s = seen();
        s.udev = State::Missing;
        s.ports[0].permitted = false;
        s.stages[0].permitted = false;
        s.cameras[0].permitted = false;
        let found = findings(&s);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found[0].contains("ttyUSB7") && found[0].contains("sudo usermod -aG dialout"));
        assert!(found[1].contains("001/004") && found[1].contains("doctor --install-udev"));
        assert!(found[2].contains("video0") && found[2].contains("usermod -aG video"));
        s.udev = State::Installed("x".into());
        assert!(findings(&s)[1].contains("plug the device in anew"), "installed already");
    }

    #[test]
    fn what_is_missing_or_of_no_use_is_told() {
        let mut s = seen();
        (s.ports, s.stages, s.usb_trouble) =
            (Vec::new(), Vec::new(), "USB: this machine shows no USB".into());
        s.udev = State::Other("/etc/udev/rules.d/70-gonio.rules".into());
        s.cameras[0].formats[0] = ("MJPG".into(), Vec::new(), None);
        let found = findings(&s);
        assert!(
            found[0].contains("no serial port and no USB stage") && found[1].contains("no USB"),
            "{found:?}"
        );
        assert!(found[2].contains("gonio preview") && found[3].contains("other udev rules"), "{found:?}");
        let mut s = seen();
        s.cameras[0].exposure_s = None;
        assert!(findings(&s)[0].contains("exposure time"));
        s.cameras[0].trouble = "in use".into();
        assert!(findings(&s)[0].contains("fuser -v /dev/video0"));
        s.cameras.remove(0);
        assert!(findings(&s)[0].contains("no camera"), "a metadata node is none");
    }

    #[test]
    fn groups_are_found_by_their_number() {
        let groups = "root:x:0:\ndialout:x:20:me,you\nvideo:x:44:\n";
        assert_eq!(group_name(groups, 44).as_deref(), Some("video"));
        assert_eq!(group_name(groups, 0), None);
        assert_eq!(group_name("nonsense\n:\n", 3), None);
    }
}
