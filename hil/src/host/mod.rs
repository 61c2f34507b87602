//! The host's side: runs the machine, holds the plugs, and says whether the run was good.

mod bench;
pub mod evaluation;
mod machine;
mod verdict;

pub use bench::{Bench, BenchError};
pub use machine::{Ended, Files, Machine, MachineError, Sockets};
pub use verdict::Verdict;
