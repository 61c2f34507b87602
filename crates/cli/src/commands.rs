//! What each command does, one file each (those that watch running scans share one).

pub mod calibrate;
mod calibrate_radiometry;
mod car_paint;
pub mod colormap;
pub mod convert;
pub mod demo;
pub mod doctor;
pub mod eval;
pub mod fit;
mod fit_batch;
pub mod flake;
pub mod info;
pub mod isoline;
pub mod paint;
mod paint_design;
mod paint_sweep;
pub mod plan;
pub mod preview;
mod radiometry_report;
pub mod render;
pub mod replay;
pub mod running;
pub mod scan;
pub mod session;
pub mod show;
pub mod sim;
pub mod tailor;
pub mod trade;

use crate::arguments::{Arguments, Command};
use crate::control::Ask;
use crate::outcome::{Failure, Outcome};
use crate::output::Printer;

/// Runs the command that the arguments name.
///
/// # Errors
/// [`Failure`], which carries the exit code.
pub fn dispatch(arguments: Arguments) -> Result<Outcome, Failure> {
    let printer = Printer { json: arguments.json };
    match arguments.command {
        Command::Demo(a) => demo::run(&a, printer),
        Command::Scan(a) => scan::run(&a, printer),
        Command::Replay(a) => replay::run(&a, printer),
        Command::Calibrate(a) => calibrate::run(&a, printer),
        Command::Verify { session } => session::verify(&session, printer),
        Command::Recover { session, output, force } => session::recover(&session, &output, force, printer),
        Command::Sim(a) => sim::run(&a, printer),
        Command::Fit(a) => fit::run(&a, printer),
        Command::Eval(a) => eval::run(&a, printer),
        Command::Colormap(a) => colormap::run(&a, printer),
        Command::Trade(a) => trade::run(&a, printer),
        Command::Tailor(a) => tailor::run(&a, printer),
        Command::Render(a) => render::run(&a, printer),
        Command::Paint(c) => paint::run(&c, printer),
        Command::Plan(a) => plan::run(&a, printer),
        Command::Isoline(a) => isoline::run(&a, printer),
        Command::Convert { input, output, renderer, force } => {
            convert::run(&input, &output, renderer.as_deref(), force, printer)
        }
        Command::Info { file, budget: true } => info::budget(&file, printer),
        Command::Info { file, budget: false } => info::run(&file, printer),
        Command::Show(a) => show::run(&a, printer),
        Command::Status => running::status(printer),
        Command::Stop { emergency, pause, resume } => {
            let ask = match (emergency, pause, resume) {
                (true, _, _) => Ask::EmergencyStop,
                (_, true, _) => Ask::Pause,
                (_, _, true) => Ask::Resume,
                _ => Ask::Stop,
            };
            running::tell(printer, ask)
        }
        Command::Preview(a) => preview::run(&a, printer),
        Command::Doctor(a) => doctor::run(&a, printer),
    }
}
