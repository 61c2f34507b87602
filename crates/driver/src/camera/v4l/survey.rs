//! What the cameras of this machine are and can do, for people who look for what is wrong.

use super::controls::{self, ControlFacts};
use super::nodes::{CameraName, Node, Places, Role};
use super::session::{offers, open_pictures, role};
use crate::camera::colour;
use crate::camera::raw::{Offer, Wanted, raw_format};
use gonio_instrument::{BayerPattern, DeviceError};
use v4l::Device;

/// A node and what it tells of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraFacts {
    /// The node.
    pub node: Node,
    /// What it is for; `None` if it could not be opened.
    pub role: Option<Role>,
    /// Formats and sizes.
    pub formats: Vec<Offer>,
    /// Controls.
    pub controls: Vec<ControlFacts>,
    /// What stood in the way of knowing more; empty if nothing.
    pub trouble: String,
}

impl CameraFacts {
    /// Whether this node is known to give no pictures: it says so, or it may not be opened and stands behind another node of its camera.
    #[must_use]
    pub fn gives_no_pictures(&self) -> bool {
        match self.role {
            Some(role) => role != Role::Pictures,
            None => self.node.index > 0,
        }
    }

    /// Number of the node if it gives colour that [`crate::camera::colour`] can decode.
    #[must_use]
    pub fn colour_number(&self) -> Option<u32> {
        const COLOUR: [&[u8; 4]; 5] = [b"YUYV", b"MJPG", b"NV12", b"RGB3", b"BGR3"];
        let colour = self.formats.iter().any(|f| COLOUR.contains(&&f.code.0));
        let number = self.node.path.to_str()?.strip_prefix("/dev/video")?.parse().ok()?;
        Some(number).filter(|_| colour)
    }

    /// The largest size of the deepest raw format.
    #[must_use]
    pub fn largest_raw(&self) -> Option<Wanted> {
        let all = self.formats.iter().filter_map(|offer| Some((raw_format(offer.code)?, &offer.sizes)));
        let (format, [width, height]) = all
            .flat_map(|(format, sizes)| sizes.iter().map(move |size| (format, size.largest())))
            .max_by_key(|(format, [width, height])| (format.bits, u64::from(*width) * u64::from(*height)))?;
        let pattern = format.pattern.unwrap_or(BayerPattern::Rggb);
        Some(Wanted { width, height, bits: format.bits, pattern })
    }
}

/// The camera that a name means, asked what it is; opened for a moment only.
///
/// # Errors
/// [`DeviceError::Absent`], [`DeviceError::Denied`]; [`DeviceError::Io`] for a node that gives no pictures.
pub fn look_at(name: &CameraName) -> Result<CameraFacts, DeviceError> {
    let (mut first, called) = (None, name.to_string());
    for node in Places::default().candidates(name)? {
        match open_pictures(&node, &called) {
            Ok(_) => return Ok(ask(node)),
            Err(error) => drop(first.get_or_insert(error)),
        }
    }
    Err(first.unwrap_or(DeviceError::Absent { device: called }))
}

/// Lists all nodes and asks those that may be opened: those that sysfs shows, and device files that `nokhwa` finds where sysfs shows none, as in containers.
/// Changes nothing; a camera in use by another program answers all the same.
#[must_use]
pub fn list_cameras() -> Vec<CameraFacts> {
    let places = Places::default();
    let mut nodes = places.nodes();
    for (number, name) in colour::discover() {
        let node = Node { name, ..places.node(number) };
        if nodes.iter().all(|n| n.path != node.path) {
            nodes.push(node);
        }
    }
    nodes.into_iter().map(ask).collect()
}

fn ask(node: Node) -> CameraFacts {
    let mut facts =
        CameraFacts { node, role: None, formats: Vec::new(), controls: Vec::new(), trouble: String::new() };
    let device = match Device::with_path(&facts.node.path) {
        Ok(device) => device,
        Err(error) => {
            facts.trouble = error.to_string();
            return facts;
        }
    };
    match role(&device) {
        Ok(role) => facts.role = Some(role),
        Err(trouble) => facts.trouble = trouble,
    }
    if facts.role == Some(Role::Pictures) {
        match offers(&device) {
            Ok(offers) => facts.formats = offers,
            Err(trouble) => facts.trouble = trouble,
        }
        match controls::list(&device) {
            Ok(controls) => facts.controls = controls,
            Err(trouble) => facts.trouble = trouble,
        }
    }
    facts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_shown_is_known_from_the_formats() {
        use crate::camera::raw::{Code, Sizes};
        let node = |path: &str| Node {
            path: path.into(),
            name: String::new(),
            index: 0,
            usb: None,
            permitted: true,
        };
        let mut camera = ask(node("/dev/video987"));
        assert_eq!((camera.colour_number(), camera.largest_raw()), (None, None));
        let offer = |code, sizes| Offer { code: Code(code), sizes };
        let steps = Sizes::Steps { width: [16, 700, 16], height: [16, 500, 16] };
        camera.formats = vec![
            offer(*b"Y10 ", vec![Sizes::One(1280, 1024)]),
            offer(*b"RG12", vec![Sizes::One(640, 480), steps]),
            offer(*b"YUYV", vec![Sizes::One(1920, 1080)]),
        ];
        let raw = camera.largest_raw().expect("raw");
        assert_eq!((raw.width, raw.height, raw.bits), (688, 496, 12), "the last step, not the bound");
        assert_eq!(camera.colour_number(), Some(987));
        camera.node = node("/dev/v4l/by-id/eye");
        assert_eq!(camera.colour_number(), None);
    }

    #[test]
    fn a_node_that_may_not_be_opened_is_judged_by_its_place() {
        let node = |index| Node {
            path: "/nowhere/video".into(),
            name: "eye".into(),
            index,
            usb: None,
            permitted: false,
        };
        let closed = ask(node(1));
        assert!(closed.gives_no_pictures() && !closed.trouble.is_empty());
        assert!(!ask(node(0)).gives_no_pictures());
        assert!(list_cameras().iter().all(|c| !c.node.path.as_os_str().is_empty()));
    }
}
