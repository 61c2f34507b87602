//! What is plugged into this machine, as text and as JSON. Changes nothing; ports and stages are not opened.

use std::path::Path;

use gonio_driver::ports::{self, PortInfo};
use gonio_driver::transport::usb::{UsbDevice, list_usb};
use serde_json::{Value, json};

use super::udev::{self, State};
use crate::outcome::Failure;
use crate::output::shown;

/// A camera node.
#[derive(Clone, Debug, Default)]
pub struct CameraSeen {
    /// Its device file.
    pub path: String,
    /// What to give to `--camera`.
    pub name: String,
    /// What it calls itself.
    pub description: String,
    /// Serial number; empty if it has none.
    pub serial: String,
    /// Vendor and product id.
    pub usb_id: Option<(u16, u16)>,
    /// This user may open it.
    pub permitted: bool,
    /// It gives only metadata or is no camera at all.
    pub no_pictures: bool,
    /// Format, sizes, and bits if it carries raw counts.
    pub formats: Vec<(String, Vec<String>, Option<u32>)>,
    /// Name, smallest, largest, value now.
    pub controls: Vec<(String, i64, i64, Option<i64>)>,
    /// Shortest and longest exposure, s.
    pub exposure_s: Option<[f64; 2]>,
    /// What stood in the way of knowing more.
    pub trouble: String,
}

/// All that was seen.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Serial ports.
    pub ports: Vec<PortInfo>,
    /// USB devices that are stages.
    pub stages: Vec<UsbDevice>,
    /// Why USB devices cannot be listed; empty if they can.
    pub usb_trouble: String,
    /// Cameras.
    pub cameras: Vec<CameraSeen>,
    /// GenICam cameras: id, what they call themselves, protocol, address. Empty where this program is built without.
    pub genicam: Vec<[String; 4]>,
    /// The rules.
    pub udev: State,
    /// What an administrator runs to install them.
    pub sudo_line: String,
}

/// Looks.
///
/// # Errors
/// [`Failure::Failed`] where the system does not tell its ports.
pub fn look(rules_folder: &Path) -> Result<Seen, Failure> {
    let ports = ports::list_ports().map_err(|e| Failure::failed("serial ports cannot be listed", e))?;
    let (stages, usb_trouble) = match list_usb() {
        Ok(all) => (all.into_iter().filter(|d| d.stage).collect(), String::new()),
        Err(e) => (Vec::new(), e.to_string()),
    };
    let udev = udev::state(rules_folder);
    let other = matches!(udev, State::Other(_));
    Ok(Seen {
        ports,
        stages,
        usb_trouble,
        cameras: cameras(),
        genicam: genicam(),
        sudo_line: udev::sudo_line(rules_folder, other),
        udev,
    })
}

#[cfg(feature = "cameras")]
fn cameras() -> Vec<CameraSeen> {
    use gonio_driver::camera::raw;
    use gonio_driver::camera::v4l::{controls, list_cameras};
    let seen = |c: gonio_driver::camera::v4l::CameraFacts| CameraSeen {
        path: c.node.path.display().to_string(),
        name: c
            .node
            .path
            .to_string_lossy()
            .strip_prefix("/dev/video")
            .map_or_else(String::new, |n| format!("v4l:{n}")),
        description: c.node.name.clone(),
        serial: c.node.serial().to_owned(),
        usb_id: c.node.usb.as_ref().map(|u| (u.vendor, u.product)),
        permitted: c.node.permitted,
        no_pictures: c.gives_no_pictures(),
        formats: c
            .formats
            .iter()
            .map(|f| {
                let sizes = f.sizes.iter().map(ToString::to_string).collect();
                (f.code.to_string(), sizes, raw::raw_format(f.code).map(|f| f.bits))
            })
            .collect(),
        exposure_s: controls::exposure_limits(&c.controls).map(|l| l.map(|t| t.as_secs_f64())),
        controls: c.controls.into_iter().map(|k| (k.name, k.minimum, k.maximum, k.value)).collect(),
        trouble: c.trouble,
    };
    list_cameras().into_iter().map(seen).collect()
}

#[cfg(not(feature = "cameras"))]
fn cameras() -> Vec<CameraSeen> {
    Vec::new()
}

#[cfg(feature = "genicam")]
fn genicam() -> Vec<[String; 4]> {
    let found = gonio_driver::camera::genicam::list();
    found.into_iter().map(|d| [d.id, d.description, d.protocol, d.address]).collect()
}

#[cfg(not(feature = "genicam"))]
fn genicam() -> Vec<[String; 4]> {
    Vec::new()
}

impl Seen {
    /// One line for each thing.
    pub fn lines(&self) -> String {
        let closed = |permitted: bool| if permitted { "" } else { "  NO PERMISSION" };
        let mut text = String::new();
        for p in &self.ports {
            let id = p.usb_id.map_or_else(String::new, |(v, d)| format!(" usb {v:04x}:{d:04x}"));
            text += &format!("serial:{}{id} {}{}\n", p.path, p.description, closed(p.permitted));
        }
        for s in &self.stages {
            let serial = if s.serial.is_empty() { String::new() } else { format!(":{}", s.serial) };
            text += &format!(
                "usb:{:04x}:{:04x}{serial} {}{}\n",
                s.vendor,
                s.product,
                s.description,
                closed(s.permitted)
            );
        }
        for c in self.cameras.iter().filter(|c| !c.no_pictures) {
            let formats: Vec<String> = c
                .formats
                .iter()
                .map(|(code, sizes, bits)| {
                    let raw = bits.map_or_else(String::new, |b| format!(" raw {b} bit"));
                    format!("{code}{raw} {}", sizes.join("/"))
                })
                .collect();
            let exposure =
                c.exposure_s.map_or_else(String::new, |[a, b]| format!("; exposure {a} s to {b} s"));
            let serial = if c.serial.is_empty() { String::new() } else { format!(" serial {}", c.serial) };
            text += &format!("{} {}{serial}{}\n", c.name, c.description, closed(c.permitted));
            if !formats.is_empty() {
                text += &format!("  {}{exposure}\n", formats.join(", "));
            }
        }
        for [id, description, protocol, address] in &self.genicam {
            text += &format!("genicam:{id} {description} ({protocol}, {address})\n");
        }
        text += &match self.udev.path() {
            Some(path) => format!("udev rules: {} ({})\n", self.udev.word(), path.display()),
            None => format!("udev rules: {}\n", self.udev.word()),
        };
        text
    }

    /// The same for machines (docs/json.md).
    pub fn json(&self) -> Value {
        let id = |id: Option<(u16, u16)>| id.map(|(v, d)| format!("{v:04x}:{d:04x}"));
        let ports: Vec<Value> = self
            .ports
            .iter()
            .map(|p| {
                json!({ "path": p.path, "usb_id": id(p.usb_id), "description": p.description, "serial": p.serial, "permitted": p.permitted })
            })
            .collect();
        let stages: Vec<Value> = self
            .stages
            .iter()
            .map(|s| {
                json!({
                    "usb_id": id(Some((s.vendor, s.product))), "serial": s.serial, "description": s.description,
                    "path": shown(&s.node), "permitted": s.permitted,
                })
            })
            .collect();
        let cameras: Vec<Value> = self
            .cameras
            .iter()
            .map(|c| {
                let formats: Vec<Value> = c
                    .formats
                    .iter()
                    .map(|(code, sizes, bits)| json!({ "code": code, "sizes": sizes, "raw_bits": bits }))
                    .collect();
                let controls: Vec<Value> = c
                    .controls
                    .iter()
                    .map(|(name, low, high, now)| json!({ "name": name, "minimum": low, "maximum": high, "value": now }))
                    .collect();
                json!({
                    "camera": c.name, "path": c.path, "description": c.description, "serial": c.serial, "usb_id": id(c.usb_id),
                    "permitted": c.permitted, "pictures": !c.no_pictures, "formats": formats, "controls": controls,
                    "exposure_s": c.exposure_s, "trouble": c.trouble,
                })
            })
            .collect();
        let genicam: Vec<Value> = self
            .genicam
            .iter()
            .map(|[id, description, protocol, address]| {
                json!({ "camera": format!("genicam:{id}"), "description": description, "protocol": protocol, "address": address })
            })
            .collect();
        json!({
            "genicam": genicam,
            "ports": ports, "stages": stages, "usb_trouble": self.usb_trouble, "cameras": cameras,
            "udev": { "state": self.udev.word(), "path": self.udev.path().map(shown) },
        })
    }
}
