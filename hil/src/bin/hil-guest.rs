//! Runs the tests in the machine; started there by the job that `hil` leaves for it.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use gonio_hil::guest::{self, Control, Guest};

/// Tests of the driver against the drivers of the kernel this runs on.
#[derive(Parser)]
struct Arguments {
    /// The program under test.
    #[arg(long)]
    gonio: PathBuf,
    /// Where sessions go.
    #[arg(long)]
    folder: PathBuf,
    /// How long frames are watched for losses, s.
    #[arg(long, default_value_t = 10)]
    watch_s: u64,
    /// Names of the tests.
    tests: Vec<String>,
}

fn main() -> ExitCode {
    let a = Arguments::parse();
    let run = || {
        let control = Control::open()?;
        let watch = Duration::from_secs(a.watch_s);
        let mut guest = Guest { control, watch, gonio: a.gonio.clone(), folder: a.folder.clone() };
        guest::run(&mut guest, &a.tests)
    };
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(why) => {
            gonio_hil::log(&why);
            ExitCode::FAILURE
        }
    }
}
