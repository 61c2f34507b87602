//! Why a radiometric calibration cannot be made.

use crate::error::AcquisitionError;

/// A calibration that cannot begin or go on; the text says what to do next.
#[derive(Debug, thiserror::Error)]
pub enum RadiometryError {
    /// No flat series among the sessions.
    #[error(
        "none of the sessions is a flat series, without which neither gain nor linearity is known; record one with `gonio scan --kind flat`"
    )]
    NoFlat,
    /// A flat series without repeated exposures.
    #[error(
        "the flat series holds no exposure that was taken twice ({exposures} lit exposures): noise shows in pairs of frames alone; record it with repeats = 2 in the plan"
    )]
    NoPairs {
        /// Exposures found.
        exposures: usize,
    },
    /// No dark frames.
    #[error(
        "no lit exposure of the flat series has dark frames of the same exposure; record it again with `gonio scan --kind flat`, which takes them"
    )]
    NoDark,
    /// Too little that is not saturated.
    #[error(
        "{usable} of {exposures} exposures of the flat series show unsaturated pixels well above black, at least 4 are needed; give shorter exposures (exposure_s in the plan) or dim the lamp"
    )]
    Saturated {
        /// Exposures looked at.
        exposures: usize,
        /// Exposures of use.
        usable: usize,
    },
    /// No light in the flat series.
    #[error(
        "{found} pixels of the flat series see the sample in its light, at least {needed} are needed; was a white sample on the holder, and the right instrument named?"
    )]
    NoLight {
        /// Pixels found.
        found: usize,
        /// Pixels needed.
        needed: usize,
    },
    /// The noise of pairs does not grow with the signal as light's does.
    #[error(
        "the noise of the flat series' pairs does not tell the gain: {reason}; keep the lamp steady and the exposures between a hundredth and nine tenths of the range"
    )]
    NoGain {
        /// What was found.
        reason: String,
    },
    /// A session that cannot be read as frames of this instrument.
    #[error("{session}: {source}")]
    Session {
        /// The session.
        session: String,
        /// What is wrong.
        source: AcquisitionError,
    },
}
