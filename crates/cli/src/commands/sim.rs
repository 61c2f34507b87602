//! `gonio sim`: the virtual instrument as devices that other programs can open.

use std::time::Duration;

use gonio_driver::camera::CameraServer;
use serde_json::json;

use crate::arguments::SimArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, shown};
use crate::rig::{self, Simulated};
use crate::signals;

/// Serves a pseudo-terminal and a camera socket until a signal comes.
///
/// # Errors
/// [`Failure::Usage`] for files that cannot be used, [`Failure::Failed`] where the devices cannot be made.
pub fn run(a: &SimArguments, printer: Printer) -> Result<Outcome, Failure> {
    if a.with_parent {
        rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))
            .map_err(|e| Failure::failed("the parent cannot be watched", e))?;
    }
    let instrument = rig::instrument(&a.instrument)?;
    let simulated = Simulated::read(&a.simulated)?;
    let (pty, camera) = simulated.start(&instrument, &instrument.plan, a.kind.into(), Some(&a.pty))?;
    let server = CameraServer::serve(Box::new(camera), &a.camera_socket)?;
    let cancel = signals::cancel_on_signals()?;
    printer.result(
        &format!(
            "stage at {} and camera at {}; try:\n  gonio scan --device serial:{} --camera sim:{} -o S.mcap\nCtrl-C ends it",
            pty.path.display(),
            server.path().display(),
            pty.path.display(),
            server.path().display()
        ),
        &json!({ "stage": shown(&pty.path), "camera": shown(server.path()) }),
    );
    while !cancel.is_raised() {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(Outcome::Done)
}
