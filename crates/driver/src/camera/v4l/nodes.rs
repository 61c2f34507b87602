//! The camera nodes of this machine, and the one that a name means.
//!
//! A camera shows several nodes: one gives pictures, another only what the driver notes beside each frame. Which is which the node itself says
//! when it is opened ([`Role`]); names, serial numbers and places come from sysfs, which everybody may read.

use gonio_instrument::DeviceError;
use rustix::fs::{Access, access};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// How a camera is named on the command line, after `v4l:` or `uvc:`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CameraName {
    /// `/dev/videoN`.
    Number(u32),
    /// A device file by its path, for instance below `/dev/v4l/by-id`.
    Path(PathBuf),
    /// A serial number, or the name that the camera gives itself.
    Words(String),
}

impl FromStr for CameraName {
    type Err = DeviceError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text.trim().is_empty() {
            let reason =
                "expected a number (v4l:0 is /dev/video0), a path, a serial number or a name".to_owned();
            return Err(DeviceError::Io { device: format!("v4l:{text}"), reason });
        }
        Ok(match text.parse() {
            Ok(number) if text.bytes().all(|b| b.is_ascii_digit()) => CameraName::Number(number),
            _ if text.starts_with('/') => CameraName::Path(PathBuf::from(text)),
            _ => CameraName::Words(text.to_owned()),
        })
    }
}

impl fmt::Display for CameraName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CameraName::Number(n) => write!(f, "v4l:{n}"),
            CameraName::Path(path) => write!(f, "v4l:{}", path.display()),
            CameraName::Words(words) => write!(f, "v4l:{words}"),
        }
    }
}

/// What a node is for, from the capabilities of the node itself (`device_caps` of VIDIOC_QUERYCAP).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Gives pictures.
    Pictures,
    /// Gives what the driver notes beside each frame.
    Metadata,
    /// Anything else: an output, a radio, a codec.
    Other,
}

impl Role {
    /// From the bits of `device_caps` (linux/videodev2.h). The device as a whole tells the sum of its nodes: that one must not be asked.
    #[must_use]
    pub const fn of(device_caps: u32) -> Role {
        const VIDEO_CAPTURE: u32 = 0x1;
        const MEMORY_TO_MEMORY: u32 = 0x8000;
        const META_CAPTURE: u32 = 0x0080_0000;
        const STREAMING: u32 = 0x0400_0000;
        if device_caps & VIDEO_CAPTURE != 0
            && device_caps & STREAMING != 0
            && device_caps & MEMORY_TO_MEMORY == 0
        {
            Role::Pictures
        } else if device_caps & META_CAPTURE != 0 {
            Role::Metadata
        } else {
            Role::Other
        }
    }
}

/// The USB device behind a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbIdentity {
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Serial number; empty if it has none.
    pub serial: String,
    /// Bus and ports, as the kernel writes them (`1-2.3`).
    pub place: String,
}

/// A device node, not opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// Its device file.
    pub path: PathBuf,
    /// What the driver calls it; empty where sysfs does not tell.
    pub name: String,
    /// Its place among the nodes of its camera.
    pub index: u32,
    /// The USB device behind it.
    pub usb: Option<UsbIdentity>,
    /// This user may read and write it.
    pub permitted: bool,
}

impl Node {
    /// Serial number of the camera; empty if it has none or does not tell.
    #[must_use]
    pub fn serial(&self) -> &str {
        self.usb.as_ref().map_or("", |usb| &usb.serial)
    }

    /// Whether this is the same camera, plugged in anew perhaps: the same USB ids and serial number, or without a serial number the same place.
    #[must_use]
    pub fn is_same_camera(&self, other: &Node) -> bool {
        match (&self.usb, &other.usb) {
            (Some(a), Some(b)) => {
                let same_ids = (a.vendor, a.product, &a.serial) == (b.vendor, b.product, &b.serial);
                same_ids && self.index == other.index && (!a.serial.is_empty() || a.place == b.place)
            }
            _ => self.path == other.path,
        }
    }
}

/// Where the kernel shows devices; another folder in tests.
#[derive(Clone, Debug)]
pub struct Places {
    /// `/sys/class/video4linux`.
    pub class: PathBuf,
    /// `/dev`.
    pub dev: PathBuf,
}

impl Default for Places {
    fn default() -> Self {
        Places { class: PathBuf::from("/sys/class/video4linux"), dev: PathBuf::from("/dev") }
    }
}

impl Places {
    /// All nodes, by number. None where the kernel shows no cameras.
    #[must_use]
    pub fn nodes(&self) -> Vec<Node> {
        let Ok(entries) = std::fs::read_dir(&self.class) else { return Vec::new() };
        let mut numbered: Vec<(u32, Node)> = entries
            .flatten()
            .filter_map(|e| {
                let name = e.file_name();
                let number = name.to_str()?.strip_prefix("video")?.parse().ok()?;
                Some((number, self.node(number)))
            })
            .collect();
        numbered.sort_by_key(|(number, _)| *number);
        numbered.into_iter().map(|(_, node)| node).collect()
    }

    /// The node of this number, whether it is there or not.
    pub(super) fn node(&self, number: u32) -> Node {
        let folder = self.class.join(format!("video{number}"));
        let path = self.dev.join(format!("video{number}"));
        Node {
            name: line(&folder.join("name")).unwrap_or_default(),
            index: line(&folder.join("index")).and_then(|t| t.parse().ok()).unwrap_or(0),
            usb: usb_identity(&folder.join("device")),
            permitted: access(&path, Access::READ_OK | Access::WRITE_OK).is_ok(),
            path,
        }
    }

    /// The nodes that a name may mean, best first; the first that gives pictures is meant.
    ///
    /// # Errors
    /// [`DeviceError::Absent`]; [`DeviceError::Io`] where words fit more than one camera.
    pub fn candidates(&self, name: &CameraName) -> Result<Vec<Node>, DeviceError> {
        let absent = || DeviceError::Absent { device: name.to_string() };
        match name {
            CameraName::Number(n) => {
                let node = self.node(*n);
                if node.path.exists() { Ok(vec![node]) } else { Err(absent()) }
            }
            CameraName::Path(path) => {
                let real = path.canonicalize().map_err(|_| absent())?;
                let known = self.nodes().into_iter().find(|n| n.path.canonicalize().is_ok_and(|p| p == real));
                let permitted = access(&real, Access::READ_OK | Access::WRITE_OK).is_ok();
                let unknown =
                    || Node { path: real.clone(), name: String::new(), index: 0, usb: None, permitted };
                Ok(vec![known.unwrap_or_else(unknown)])
            }
            CameraName::Words(words) => {
                let nodes = self.nodes();
                let by_serial: Vec<Node> = nodes.iter().filter(|n| n.serial() == words).cloned().collect();
                let found = if by_serial.is_empty() {
                    nodes.into_iter().filter(|n| n.name == *words).collect()
                } else {
                    by_serial
                };
                let first = found.first().ok_or_else(absent)?;
                let place = |n: &Node| n.usb.as_ref().map(|u| u.place.clone());
                if found.iter().any(|n| place(n) != place(first)) {
                    let paths: Vec<String> = found.iter().map(|n| n.path.display().to_string()).collect();
                    let reason = format!(
                        "several cameras are called so: {}; give one by its number",
                        paths.join(", ")
                    );
                    return Err(DeviceError::Io { device: name.to_string(), reason });
                }
                Ok(found)
            }
        }
    }

    /// Nodes of a camera that was here before, wherever it is plugged in now.
    #[must_use]
    pub fn again(&self, before: &Node) -> Vec<Node> {
        if before.usb.is_none() {
            return Some(before.clone()).filter(|n| n.path.exists()).into_iter().collect();
        }
        self.nodes().into_iter().filter(|n| n.is_same_camera(before)).collect()
    }
}

fn line(path: &Path) -> Option<String> {
    let bytes = std::fs::read(path).ok()?;
    Some(String::from_utf8_lossy(&bytes).trim().to_owned())
}

/// Climbs from a node's device folder to the USB device that it is part of.
fn usb_identity(device: &Path) -> Option<UsbIdentity> {
    let folder = device.canonicalize().ok()?;
    let usb = folder.ancestors().take(6).find(|a| a.join("idVendor").exists())?;
    let id = |name| line(&usb.join(name)).and_then(|t| u16::from_str_radix(&t, 16).ok());
    Some(UsbIdentity {
        vendor: id("idVendor")?,
        product: id("idProduct")?,
        serial: line(&usb.join("serial")).unwrap_or_default(),
        place: usb.file_name()?.to_string_lossy().into_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A machine with the given cameras: (first node, place, serial, name), each with a picture and a metadata node.
    fn machine(cameras: &[(u32, &str, &str, &str)]) -> (tempfile::TempDir, Places) {
        let root = tempfile::tempdir().expect("a folder");
        let places = Places { class: root.path().join("class"), dev: root.path().join("dev") };
        fs::create_dir_all(&places.dev).expect("dev");
        for (first, place, serial, name) in cameras {
            let usb = root.path().join("devices").join(place);
            let interface = usb.join(format!("{place}:1.0"));
            fs::create_dir_all(&interface).expect("a device");
            for (file, text) in [("idVendor", "1209\n"), ("idProduct", "0002\n"), ("serial", serial)] {
                fs::write(usb.join(file), text).expect("a file");
            }
            for index in 0..2 {
                let node = places.class.join(format!("video{}", first + index));
                fs::create_dir_all(&node).expect("a node");
                fs::write(node.join("name"), format!("{name}\n")).expect("a name");
                fs::write(node.join("index"), format!("{index}\n")).expect("an index");
                std::os::unix::fs::symlink(&interface, node.join("device")).expect("a link");
                fs::write(places.dev.join(format!("video{}", first + index)), "").expect("a device file");
            }
        }
        (root, places)
    }

    fn found(places: &Places, name: &str) -> Result<Vec<String>, DeviceError> {
        let nodes = places.candidates(&name.parse()?)?;
        Ok(nodes
            .iter()
            .filter_map(|n| n.path.file_name())
            .map(|n| n.to_string_lossy().into_owned())
            .collect())
    }

    #[test]
    fn a_camera_is_found_by_number_path_serial_number_and_name() {
        let (_root, places) = machine(&[(0, "1-1", "A7\n", "grey eye"), (10, "1-2", "B8\n", "wide eye")]);
        assert_eq!(found(&places, "10"), Ok(vec!["video10".into()]));
        assert_eq!(found(&places, "B8"), Ok(vec!["video10".into(), "video11".into()]));
        assert_eq!(found(&places, "grey eye"), Ok(vec!["video0".into(), "video1".into()]));
        let path = places.dev.join("video1");
        assert_eq!(found(&places, &path.display().to_string()), Ok(vec!["video1".into()]));
        for name in ["3", "C9", "/dev/no such camera"] {
            assert!(matches!(found(&places, name), Err(DeviceError::Absent { .. })), "{name}");
        }
        assert!(found(&places, " ").is_err());
        let node = &places.nodes()[2];
        assert_eq!(
            node.usb.as_ref().map(|u| (u.vendor, u.product, u.place.as_str())),
            Some((0x1209, 2, "1-2"))
        );
        assert_eq!((node.serial(), node.name.as_str()), ("B8", "wide eye"));
    }

    #[test]
    fn words_that_fit_two_cameras_are_asked_back() {
        let (_root, places) = machine(&[(0, "1-1", "A7", "eye"), (2, "1-2", "B8", "eye")]);
        let error = found(&places, "eye").expect_err("two of them").to_string();
        assert!(error.contains("video0") && error.contains("video3"), "{error}");
    }

    #[test]
    fn a_camera_plugged_in_elsewhere_is_known_by_its_serial_number() {
        let (_first, before) = machine(&[(0, "1-1", "A7", "eye")]);
        let (_then, now) = machine(&[(0, "1-3", "other", "eye"), (4, "1-2", "A7", "eye")]);
        let again = now.again(&before.nodes()[0]);
        assert_eq!(again.len(), 1, "its metadata node is another one");
        assert!(again[0].path.ends_with("video4"));
        let (_nameless, first) = machine(&[(0, "1-1", "", "eye")]);
        let (_moved, second) = machine(&[(0, "1-2", "", "eye")]);
        assert!(
            second.again(&first.nodes()[0]).is_empty(),
            "without a serial number the place must be the same"
        );
        assert_eq!(first.again(&first.nodes()[0]).len(), 1);
    }

    #[test]
    fn a_machine_without_cameras_has_none() {
        let places = Places { class: "/nowhere".into(), dev: "/nowhere".into() };
        assert!(places.nodes().is_empty());
        assert!(matches!(found(&places, "0"), Err(DeviceError::Absent { .. })));
    }

    #[test]
    fn metadata_nodes_and_codecs_are_no_cameras() {
        assert_eq!(Role::of(0x0420_0001), Role::Pictures, "uvcvideo's first node");
        assert_eq!(Role::of(0x04a0_0000), Role::Metadata, "its second");
        assert_eq!(Role::of(0x0420_8001), Role::Other, "a codec");
        assert_eq!(Role::of(0x0420_0002), Role::Other, "an output");
        assert_eq!(Role::of(0x0020_0001), Role::Other, "pictures, but not by streaming");
    }
}
