//! The guest's side: tests that run in the machine, against its kernel's drivers, through the driver that users run.
//!
//! Nothing is skipped: a device that is not there fails the tests that need it.

mod camera;
mod control;
mod events;
mod presence;
mod scan;
mod stage;

pub use control::Control;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::line::{Figure, FromGuest};
use gonio_instrument::ScanKind;
use stage::Link;

/// What the tests have at hand.
#[derive(Debug)]
pub struct Guest {
    /// The channel to the host.
    pub control: Control,
    /// How long frames are watched for losses.
    pub watch: Duration,
    /// The program under test.
    pub gonio: PathBuf,
    /// Where sessions go; the host sees them too.
    pub folder: PathBuf,
}

/// A test: what is wrong, in words, if it fails.
pub type Test = fn(&mut Guest) -> Result<(), String>;

/// All tests by name, in the order they run.
pub const TESTS: &[(&str, Test)] = &[
    ("devices-are-found", presence::all_devices_are_found),
    ("serial-obeys", |g| stage::obeys(g, Link::Serial)),
    ("serial-stops", |g| stage::stops(g, Link::Serial)),
    ("serial-unplugged", |g| stage::unplugged(g, Link::Serial)),
    ("usb-obeys", |g| stage::obeys(g, Link::Usb)),
    ("usb-stops", |g| stage::stops(g, Link::Usb)),
    ("usb-unplugged", |g| stage::unplugged(g, Link::Usb)),
    ("usb-halted", stage::halted),
    ("usb-silent", stage::silent),
    ("camera-exposes", camera::exposes),
    ("camera-watched", camera::watched),
    ("camera-torn", camera::torn),
    ("camera-unplugged", camera::unplugged),
    ("camera-halted", camera::halted),
    ("camera-silent", camera::silent),
    ("scan-usb-white", |g| scan::whole(g, Link::Usb, ScanKind::White)),
    ("scan-usb-sample", |g| scan::whole(g, Link::Usb, ScanKind::Sample)),
    ("scan-serial-disturbed", |g| scan::disturbed(g, Link::Serial)),
];

impl Guest {
    /// Tells the host of a measured value.
    ///
    /// # Errors
    /// The channel is broken.
    pub fn figure(
        &mut self,
        name: &str,
        value: f64,
        unit: &str,
        bound: Option<f64>,
        from: &str,
    ) -> Result<(), String> {
        let figure =
            Figure { name: name.to_owned(), value, unit: unit.to_owned(), bound, from: from.to_owned() };
        self.control.tell(&FromGuest::Figure(figure))
    }
}

/// Runs the tests of these names; true if all passed.
///
/// # Errors
/// A name that is none, or a broken channel.
pub fn run(guest: &mut Guest, names: &[String]) -> Result<bool, String> {
    let mut good = true;
    for name in names {
        let (_, test) = TESTS.iter().find(|(n, _)| n == name).ok_or_else(|| format!("no test {name}"))?;
        let start = Instant::now();
        let failure = test(guest).err();
        good &= failure.is_none();
        let seconds = start.elapsed().as_secs_f64();
        guest.control.tell(&FromGuest::Result { name: name.clone(), seconds, failure })?;
    }
    Ok(good)
}

/// Value at a share of the sorted list.
fn at(sorted: &[f64], share: f64) -> f64 {
    let place = ((sorted.len() as f64 * share) as usize).min(sorted.len().saturating_sub(1));
    sorted.get(place).copied().unwrap_or(f64::NAN)
}

/// Milliseconds.
fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
