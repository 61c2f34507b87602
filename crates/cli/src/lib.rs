//! The command line of gonio: a library with a thin main.
//!
//! Commands put the rooms together and speak to people; what they compute is computed elsewhere. This is the only crate (with the
//! tests) that knows both the simulator and the driver.

pub mod adaptive;
pub mod arguments;
pub mod batch_inputs;
pub mod candidates;
pub mod closure;
pub mod coat;
pub mod colours;
pub mod commands;
pub mod continuing;
pub mod control;
pub mod devices;
pub mod effect;
pub mod exporting;
pub mod fitting;
pub mod isotropy;
pub mod opening;
pub mod outcome;
pub mod output;
pub mod progress;
pub mod reduction;
pub mod report;
pub mod results;
pub mod rig;
pub mod scanning;
pub mod scenes;
pub mod signals;
pub mod textures;

use std::ffi::OsString;
use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;

pub use outcome::{Failure, Outcome};

/// Runs a command line, program name first, and gives the exit code of the contract.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments = match arguments::Arguments::try_parse_from(arguments) {
        Ok(a) => a,
        Err(e) => {
            let _ = e.print();
            return ExitCode::from(if e.use_stderr() { 2 } else { 0 });
        }
    };
    // what happens to the stage comes back as the one error of the command; -v tells it as it happens too
    let level = match arguments.verbose {
        0 => "warn,gonio_driver=error",
        1 => "info",
        _ => "debug",
    };
    let filter = tracing_subscriber::EnvFilter::try_from_env("GONIO_LOG").unwrap_or_else(|_| level.into());
    // a second call in one process (tests) keeps the first subscriber
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .try_init();
    give_way();
    outcome::exit_code(&commands::dispatch(arguments))
}

/// Computing gives way to the threads that keep the device's leases alive.
fn give_way() {
    // a second call in one process (tests) keeps the first pool
    let _ = rayon::ThreadPoolBuilder::new()
        .start_handler(|_| {
            let _ = rustix::process::nice(10);
        })
        .build_global();
}
