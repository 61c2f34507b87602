//! What the cameras of this machine are and can do, for people who look for what is wrong.

use super::controls::{self, ControlFacts};
use super::nodes::{Node, Places, Role};
use super::session::{offers, role};
use crate::camera::raw::Offer;
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
}

/// Lists all nodes and asks those that may be opened. Changes nothing; a camera in use by another program answers all the same.
#[must_use]
pub fn list_cameras() -> Vec<CameraFacts> {
    Places::default().nodes().into_iter().map(ask).collect()
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
