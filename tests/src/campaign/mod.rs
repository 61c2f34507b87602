//! The reliability campaigns: the instrument is mistreated by the thousand, and what came through is counted.
//!
//! Each campaign gives figures with value, bound, seed and size. `make campaign` runs them at full size and writes
//! `docs/reliability.md`; the stories run each of them small. The same code does both: only [`Settings::share`] differs.

pub mod damage;
pub mod decoder;
pub mod dice;
pub mod fuzz;
pub mod instrument;
pub mod kill;
pub mod link;
pub mod page;
pub mod remaining;
pub mod returning;
pub mod safety;
pub mod soak;

use std::ffi::{OsStr, OsString};
use std::process::Command;

/// How large, and from which seed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Seed of everything drawn.
    pub seed: u64,
    /// Share of the full size, above 0; 1 is what the project promises.
    pub share: f64,
    /// Whether times on this machine are held against their bounds; a test run beside others only tells them.
    pub timed: bool,
    /// Threads that may compute.
    pub threads: usize,
    /// The `gonio` program and words before its arguments, for campaigns that kill it.
    pub program: Vec<OsString>,
}

impl Settings {
    /// `full` times the share, at least `least`.
    #[must_use]
    pub fn count(&self, full: u64, least: u64) -> u64 {
        ((full as f64 * self.share).round() as u64).max(least)
    }
}

/// One measured figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What was measured.
    pub name: String,
    /// What was found, with its unit.
    pub value: String,
    /// What was promised; empty for what is told beside the promise.
    pub bound: String,
    /// How many of what.
    pub size: String,
    /// Whether the promise was kept.
    pub met: bool,
}

impl Figure {
    /// A number that must not exceed its bound.
    #[must_use]
    pub fn at_most(name: &str, value: f64, unit: &str, bound: f64, size: &str) -> Self {
        Self {
            name: name.to_owned(),
            value: format!("{value:.4} {unit}").trim_end().to_owned(),
            bound: format!("≤ {bound} {unit}").trim_end().to_owned(),
            size: size.to_owned(),
            met: value <= bound,
        }
    }

    /// A time on this machine that must not exceed its bound, where times are held against bounds.
    #[must_use]
    pub fn time(settings: &Settings, name: &str, value: f64, unit: &str, bound: f64, size: &str) -> Self {
        let figure = Self::at_most(name, value, unit, bound, size);
        Self { met: figure.met || !settings.timed, ..figure }
    }

    /// A count that must be exactly so.
    #[must_use]
    pub fn exactly(name: &str, value: u64, bound: u64, size: &str) -> Self {
        Self {
            name: name.to_owned(),
            value: value.to_string(),
            bound: bound.to_string(),
            size: size.to_owned(),
            met: value == bound,
        }
    }

    /// Something worth knowing that nothing was promised about.
    #[must_use]
    pub fn told(name: &str, value: impl Into<String>, size: &str) -> Self {
        Self {
            name: name.to_owned(),
            value: value.into(),
            bound: String::new(),
            size: size.to_owned(),
            met: true,
        }
    }

    /// Something promised in words.
    #[must_use]
    pub fn said(name: &str, value: impl Into<String>, bound: &str, size: &str, met: bool) -> Self {
        Self {
            name: name.to_owned(),
            value: value.into(),
            bound: bound.to_owned(),
            size: size.to_owned(),
            met,
        }
    }
}

/// A campaign.
pub struct Campaign {
    /// What it is called on the command line.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub about: &'static str,
    /// Runs it.
    pub run: fn(&Settings) -> Vec<Figure>,
}

/// Counts with thousands apart, as people read them.
#[must_use]
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

impl Settings {
    /// A command that runs `gonio`; its arguments follow.
    #[must_use]
    pub fn command(&self) -> Command {
        let mut words = self.program.iter();
        let mut command = Command::new(words.next().map_or(OsStr::new("gonio"), |w| w.as_os_str()));
        command.args(words);
        command
    }
}

/// All campaigns, in the order of the promises.
pub const CAMPAIGNS: &[Campaign] = &[
    Campaign { name: "decoder", about: "damaged frames into the decoder", run: decoder::figures },
    Campaign { name: "link", about: "commands over a bad line, in virtual time", run: link::figures },
    Campaign { name: "safety", about: "a host that falls silent; emergency stops", run: safety::figures },
    Campaign { name: "returning", about: "a plug pulled in mid-scan and put back", run: returning::figures },
    Campaign {
        name: "kill",
        about: "the host killed in mid-scan, and the scan continued",
        run: kill::figures,
    },
    Campaign { name: "damage", about: "cut and flipped session files", run: damage::figures },
    Campaign { name: "soak", about: "scan after scan under faults", run: soak::figures },
    Campaign { name: "fuzz", about: "mutated input into everything that reads bytes", run: fuzz::figures },
    Campaign {
        name: "remaining",
        about: "the time left, told after a tenth of a scan",
        run: remaining::figures,
    },
];
