//! Is everything there, and does the driver see it as what it is?

use gonio_driver::camera::v4l::{self, Role};
use gonio_driver::ports::list_ports;
use gonio_driver::transport::usb::list_usb;
use std::time::{Duration, Instant};

use super::Guest;
use crate::{camera, stage, usb};

/// The adapter that QEMU imitates.
const FTDI: (u16, u16) = (0x0403, 0x6001);
/// How long the kernel may take to find what is plugged in.
const PATIENCE: Duration = Duration::from_secs(10);

/// All three devices are listed, each as what it is, and the node of the camera's metadata is not taken for a camera.
pub fn all_devices_are_found(_guest: &mut Guest) -> Result<(), String> {
    until(|| {
        let ports = list_ports().map_err(|e| e.to_string())?;
        ports
            .iter()
            .any(|p| p.usb_id == Some(FTDI) && p.permitted)
            .then_some(())
            .ok_or_else(|| format!("no serial adapter 0403:6001 among {ports:?}"))
    })?;
    until(|| {
        let stages = list_usb().map_err(|e| e.to_string())?;
        stages
            .iter()
            .any(|d| {
                (d.vendor, d.product) == (usb::descriptor::VENDOR, stage::PRODUCT)
                    && d.serial == stage::SERIAL
            })
            .then_some(())
            .ok_or_else(|| format!("no USB stage {} among {stages:?}", stage::SERIAL))
    })?;
    until(|| {
        let nodes = v4l::list_cameras();
        let ours = nodes.iter().filter(|n| n.node.serial() == camera::SERIAL);
        let roles: Vec<_> = ours.filter_map(|n| n.role).collect();
        let pictures = roles.iter().filter(|r| **r == Role::Pictures).count();
        let metadata = roles.iter().filter(|r| **r == Role::Metadata).count();
        (pictures == 1 && metadata == 1).then_some(()).ok_or_else(|| {
            format!(
                "expected one node of pictures and one of metadata of camera {}, found {nodes:?}",
                camera::SERIAL
            )
        })
    })
}

/// Tries until it is so, or says why not.
fn until(mut what: impl FnMut() -> Result<(), String>) -> Result<(), String> {
    let start = Instant::now();
    loop {
        match what() {
            Err(why) if start.elapsed() > PATIENCE => return Err(why),
            Err(_) => std::thread::sleep(Duration::from_millis(50)),
            Ok(()) => return Ok(()),
        }
    }
}
