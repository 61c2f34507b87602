//! What shall go wrong, read from TOML.
//!
//! ```toml
//! format = "gonio-faults"
//! version = 1
//!
//! [[event]]                  # at the third move, half-way
//! what = "stall-tilt"
//! at_move = 3
//!
//! [[event]]                  # from 12 s on, instrument time since the start, for 2 s
//! what = "interlock-open"
//! at_s = 12.0
//! for_s = 2.0
//!
//! [[event]]                  # the port is gone for a second, as if the plug were pulled
//! what = "hang-up"
//! at_move = 4
//! for_s = 1.0
//!
//! [link]                     # for the host's fault-injecting transport
//! loss = 0.01
//!
//! [camera]                   # for the host's fault-injecting camera
//! torn = 0.02
//!
//! [file]                     # for the session file
//! full_after = 200000
//! ```
//!
//! Besides, `protocol_version = 2` makes the controller speak a version of the protocol that nobody knows.

use serde::{Deserialize, Serialize};

/// Format name in the file.
pub const FORMAT: &str = "gonio-faults";
/// Newest version of the format.
pub const VERSION: u32 = 1;

/// Everything that shall go wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// Always [`FORMAT`] in a file.
    pub format: String,
    /// Version of the format.
    pub version: u32,
    /// Protocol version told in the hello instead of the real one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol_version: Option<u8>,
    /// Events at their time.
    #[serde(rename = "event")]
    pub events: Vec<FaultEvent>,
    /// How bad the line is; applied by the transport's fault injection, not here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkFaults>,
    /// What goes wrong with the camera; applied by the camera's fault injection, not here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<crate::CameraFaults>,
    /// What goes wrong with the session file; applied by the journal's fault injection, not here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<FileFaults>,
}

/// One event. Exactly one of `at_s` and `at_move` is given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultEvent {
    /// What happens.
    pub what: What,
    /// When, instrument seconds since the firmware was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    /// When, as the number of a move, counted from 1 over restarts: half-way through it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_move: Option<u32>,
    /// For how long, instrument seconds; for ever if absent. Stalls and restarts take no time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
}

/// What can happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// The tilt axis does not follow.
    StallTilt,
    /// The spin axis does not follow.
    StallSpin,
    /// The lid is open.
    InterlockOpen,
    /// The lamp's housing is too hot.
    OverTemperature,
    /// The controller restarts.
    Restart,
    /// The controller hears and says nothing.
    Silent,
    /// The port hangs up and is gone.
    HangUp,
}

/// How bad the line is: chances per block of bytes, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkFaults {
    /// A block is lost.
    pub loss: f64,
    /// One bit of a block is flipped.
    pub corruption: f64,
    /// A block comes twice.
    pub duplication: f64,
    /// A block overtakes the one before it.
    pub reorder: f64,
    /// The longest delay of a block, ms.
    pub delay_ms: u32,
    /// The port hangs up after this many bytes, and again after as many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hang_up_after: Option<u64>,
    /// How long it is gone each time; for ever if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hang_up_ms: Option<u32>,
    /// After this many bytes nothing passes for [`LinkFaults::stall_ms`]; then all of it comes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stall_after: Option<u64>,
    /// How long a stall lasts, ms.
    pub stall_ms: u32,
    /// After this many bytes the device hears, and what it says is lost, for [`LinkFaults::half_open_ms`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_open_after: Option<u64>,
    /// How long the line is half open, ms.
    pub half_open_ms: u32,
}

/// What goes wrong with the session file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FileFaults {
    /// The disk is full after this many bytes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_after: Option<u64>,
    /// Writing fails after this many bytes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fail_after: Option<u64>,
    /// Each write takes this much longer, ms.
    pub slow_ms: u32,
    /// Chance of each write to fail, 0 to 1.
    pub fail: f64,
}

/// Why a faults file was refused.
#[derive(Debug, thiserror::Error)]
pub enum FaultsError {
    /// Not TOML, or unknown fields; the parser's words name line and column.
    #[error("faults file cannot be read: {0}")]
    Syntax(#[from] toml::de::Error),
    /// Another kind of file.
    #[error(
        "expected a file with format = \"{FORMAT}\" and version = {VERSION}, found format = \"{format}\" and version = {version}"
    )]
    Format {
        /// Found.
        format: String,
        /// Found.
        version: u32,
    },
    /// A value that makes no sense.
    #[error("{field} = {found}, expected {expected}")]
    Value {
        /// Which.
        field: String,
        /// Found.
        found: String,
        /// Expected.
        expected: &'static str,
    },
}

impl Faults {
    /// Reads and checks a faults file.
    ///
    /// # Errors
    /// [`FaultsError`] with place and excerpt, or the field and what it should be.
    pub fn from_toml(text: &str) -> Result<Faults, FaultsError> {
        let faults: Faults = toml::from_str(text)?;
        if faults.format != FORMAT || faults.version != VERSION {
            return Err(FaultsError::Format { format: faults.format, version: faults.version });
        }
        for (i, event) in faults.events.iter().enumerate() {
            let value = |name: &str, found: String, expected| FaultsError::Value {
                field: format!("event[{i}].{name}"),
                found,
                expected,
            };
            let times = [event.at_s, event.for_s];
            if event.at_s.is_some() == event.at_move.is_some() {
                let found = format!("{:?} and at_move = {:?}", event.at_s, event.at_move);
                return Err(value("at_s", found, "exactly one of at_s and at_move"));
            }
            if let Some(t) = times.into_iter().flatten().find(|t| !(t.is_finite() && *t >= 0.0)) {
                return Err(value("at_s or for_s", t.to_string(), "seconds, not negative"));
            }
        }
        if let Some(link) = faults.link {
            let chances = [
                ("loss", link.loss),
                ("corruption", link.corruption),
                ("duplication", link.duplication),
                ("reorder", link.reorder),
            ];
            if let Some((name, found)) = chances.into_iter().find(|(_, c)| !(0.0..=1.0).contains(c)) {
                return Err(FaultsError::Value {
                    field: format!("link.{name}"),
                    found: found.to_string(),
                    expected: "a chance, 0 to 1",
                });
            }
        }
        if let Some(found) = faults.file.map(|f| f.fail).filter(|c| !(0.0..=1.0).contains(c)) {
            return Err(FaultsError::Value {
                field: "file.fail".to_owned(),
                found: found.to_string(),
                expected: "a chance, 0 to 1",
            });
        }
        if let Some((name, found)) = faults.camera.as_ref().and_then(crate::CameraFaults::out_of_range) {
            return Err(FaultsError::Value {
                field: format!("camera.{name}"),
                found: found.to_string(),
                expected: "a chance, 0 to 1",
            });
        }
        Ok(faults)
    }

    /// One event at a move.
    #[must_use]
    pub fn at_move(mut self, what: What, at_move: u32) -> Faults {
        self.events.push(FaultEvent { what, at_s: None, at_move: Some(at_move), for_s: None });
        self
    }

    /// One event at an instrument time.
    #[must_use]
    pub fn at_s(mut self, what: What, at_s: f64, for_s: Option<f64>) -> Faults {
        self.events.push(FaultEvent { what, at_s: Some(at_s), at_move: None, for_s });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_as_it_is_written_in_the_head_of_this_module() {
        let text = "format = \"gonio-faults\"\nversion = 1\n[[event]]\nwhat = \"stall-tilt\"\nat_move = 3\n[[event]]\n\
                    what = \"interlock-open\"\nat_s = 12.0\nfor_s = 2.0\n[link]\nloss = 0.01\n";
        let faults = Faults::from_toml(text).expect("valid");
        let want = Faults::default().at_move(What::StallTilt, 3).at_s(What::InterlockOpen, 12.0, Some(2.0));
        assert_eq!(faults.events, want.events);
        assert_eq!(faults.link, Some(LinkFaults { loss: 0.01, ..LinkFaults::default() }));
    }

    #[test]
    fn nonsense_is_refused_with_its_place() {
        let head = "format = \"gonio-faults\"\nversion = 1\n";
        let refused = |rest: &str| Faults::from_toml(&format!("{head}{rest}")).expect_err(rest).to_string();
        assert!(refused("[[event]]\nwhat = \"silent\"\n").contains("event[0].at_s"));
        assert!(refused("[[event]]\nwhat = \"silent\"\nat_s = -1.0\n").contains("not negative"));
        assert!(refused("[link]\nloss = 1.5\n").contains("link.loss = 1.5"));
        assert!(refused("[[event]]\nwhat = \"flood\"\nat_s = 1.0\n").contains("flood"));
        assert!(Faults::from_toml("format = \"gonio-plan\"").is_err());
    }
}
