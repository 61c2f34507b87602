//! Progress bars on stderr; silent where stderr is no terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar that counts `total` steps of `what`.
#[must_use]
pub fn bar(what: &str, total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total);
    let style = ProgressStyle::with_template("{prefix:>10} [{bar:30}] {pos}/{len} {msg}  {elapsed}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.progress_chars("=> "));
    bar.set_prefix(what.to_owned());
    bar
}
