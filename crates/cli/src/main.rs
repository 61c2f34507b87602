//! Thin entry point: everything lives in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    gonio::run(std::env::args_os())
}
