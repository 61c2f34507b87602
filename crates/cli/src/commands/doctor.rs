//! `gonio doctor`: ports, permissions, cameras; what is wrong and how to mend it.

use gonio_driver::ports;
use serde_json::json;

use crate::outcome::{Failure, Outcome};
use crate::output::Printer;

/// Looks without opening anything.
///
/// # Errors
/// [`Failure::Failed`] where the system does not tell its ports.
pub fn run(printer: Printer) -> Result<Outcome, Failure> {
    let found = ports::list_ports().map_err(|e| Failure::failed("serial ports cannot be listed", e))?;
    let mut text = String::new();
    let mut findings = Vec::new();
    for p in &found {
        let id = p.usb_id.map_or_else(String::new, |(v, d)| format!(" usb {v:04x}:{d:04x}"));
        text += &format!(
            "serial:{}{id} {}{}\n",
            p.path,
            p.description,
            if p.permitted { "" } else { "  NO PERMISSION" }
        );
        if !p.permitted {
            findings.push(format!(
                "you may not open {}: add yourself to the group that owns it (`ls -l {}` shows it, usually dialout): \
                 `sudo usermod -aG dialout $USER`, then log in again",
                p.path, p.path
            ));
        }
    }
    if found.is_empty() {
        findings.push(
            "no serial port is there: plug the controller in, then look at `dmesg`; without an instrument use --device sim"
                .to_owned(),
        );
    }
    for f in &findings {
        text += &format!("* {f}\n");
    }
    if findings.is_empty() {
        text += "nothing is wrong\n";
    }
    let listed: Vec<_> = found
        .iter()
        .map(|p| {
            json!({
                "path": p.path, "usb_id": p.usb_id.map(|(v, d)| format!("{v:04x}:{d:04x}")),
                "description": p.description, "permitted": p.permitted,
            })
        })
        .collect();
    printer.result(&text, &json!({ "ports": listed, "findings": findings }));
    Ok(Outcome::Done)
}
