//! `gonio doctor`: ports, USB stages, cameras, permissions; what is wrong and the command that mends it.

mod findings;
mod survey;
mod udev;

use serde_json::json;

use crate::arguments::DoctorArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, shown};

/// Looks at what is plugged in, or installs the udev rules.
///
/// # Errors
/// [`Failure::Failed`] where the system does not tell its ports or the rules cannot be installed.
pub fn run(a: &DoctorArguments, printer: Printer) -> Result<Outcome, Failure> {
    if a.install_udev {
        return install(a, printer);
    }
    let seen = survey::look(&a.rules_folder)?;
    let findings = findings::findings(&seen);
    let mut text = seen.lines();
    for f in &findings {
        text += &format!("* {f}\n");
    }
    if findings.is_empty() {
        text += "nothing is wrong\n";
    }
    let mut found = seen.json();
    if let Some(object) = found.as_object_mut() {
        object.insert("findings".to_owned(), json!(findings));
    }
    printer.result(&text, &found);
    Ok(Outcome::Done)
}

fn install(a: &DoctorArguments, printer: Printer) -> Result<Outcome, Failure> {
    let installed = udev::install(&a.rules_folder, a.force)?;
    let text = format!("{}: {}\n{}\n", installed.path.display(), installed.what, installed.next);
    let result = json!({ "udev": { "path": shown(&installed.path), "what": installed.what, "reloaded": installed.reloaded } });
    printer.result(&text, &result);
    Ok(Outcome::Done)
}
