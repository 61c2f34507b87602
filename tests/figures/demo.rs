//! The demo as a user runs it.

use std::time::Instant;

use crate::{Figure, scans};

/// Wall time of `gonio demo` on this machine; the bound holds for two cores that nobody else uses.
pub fn figures() -> Vec<Figure> {
    let folder = scans::path("demo");
    let words =
        ["gonio".into(), "demo".into(), "-o".into(), folder.clone().into_os_string(), "--force".into()];
    let start = Instant::now();
    let code = gonio::run(words);
    let seconds = start.elapsed().as_secs_f64();
    let _ = std::fs::remove_dir_all(folder);
    vec![
        Figure::said(
            "gonio demo",
            if code == std::process::ExitCode::SUCCESS { "done" } else { "failed" },
            "done",
            Some(1),
            code == std::process::ExitCode::SUCCESS,
        ),
        Figure::at_most("gonio demo, seconds on this machine", seconds, 60.0, Some(1)),
    ]
}
