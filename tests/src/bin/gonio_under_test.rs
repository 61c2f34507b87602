//! The command line as a process of its own, for stories that need exit codes, signals and streams.

fn main() -> std::process::ExitCode {
    gonio::run(std::env::args_os())
}
