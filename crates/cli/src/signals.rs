//! Signals as a stop request: the first asks for a controlled stop, the third for an emergency stop.

use gonio_instrument::Cancel;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::outcome::Failure;

/// A stop request that Ctrl-C, SIGTERM and a closed terminal raise.
///
/// # Errors
/// [`Failure::Failed`] where the system takes no handler.
pub fn cancel_on_signals() -> Result<Cancel, Failure> {
    let cancel = Cancel::new();
    let raised = cancel.clone();
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])
        .map_err(|e| Failure::failed("signals cannot be handled", e))?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for (count, signal) in signals.forever().enumerate() {
                if count >= 2 {
                    raised.emergency_stop();
                } else {
                    raised.stop();
                }
                if signal == SIGINT {
                    crate::outcome::told(
                        "stopping in a controlled way; what was measured is kept (three times: emergency stop)",
                    );
                }
            }
        })
        .map_err(|e| Failure::failed("signals cannot be handled", e))?;
    Ok(cancel)
}
