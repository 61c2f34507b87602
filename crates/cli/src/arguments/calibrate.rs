//! Flags of `gonio calibrate`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// `gonio calibrate`.
#[derive(Debug, Args)]
pub struct CalibrateArguments {
    /// What to calibrate
    #[command(subcommand)]
    pub what: Calibration,
}

/// Kinds of calibration.
#[derive(Debug, Subcommand)]
pub enum Calibration {
    /// Mirror, camera, lens, lamp and axes, from black glass flat and on a wedge; edges seen on a white sample help
    Geometry(GeometryArguments),
    /// Gain, noise, linearity, dark current, bad pixels, flat field, gloss scale and stray light, from sessions of reference samples
    Radiometry(RadiometryArguments),
}

/// What the calibrations ask alike.
#[derive(Debug, Args)]
pub struct CommonArguments {
    /// The description to write, with the calibration in it; a file that exists is never overwritten
    #[arg(short, long)]
    pub output: PathBuf,
    /// The description to calibrate in place of that of the sessions: TOML, or `reference` / `tiny`
    #[arg(long)]
    pub instrument: Option<String>,
    /// Refractive index of the black glass
    #[arg(long, default_value_t = 1.567)]
    pub index: f64,
}

/// `gonio calibrate radiometry`.
#[derive(Debug, Args)]
pub struct RadiometryArguments {
    /// Sessions: --kind flat (needed), dark, white, black-glass, black, trap; dark ones at several temperatures tell how the dark current doubles
    #[arg(required = true)]
    pub sessions: Vec<PathBuf>,
    /// What every calibration asks
    #[command(flatten)]
    pub common: CommonArguments,
    /// Colour chart, TOML (docs/calibration.md): patches with their Lab and the tables measured of them
    #[arg(long)]
    pub chart: Option<PathBuf>,
    /// Use references whose certificate has expired; recorded in the result
    #[arg(long)]
    pub accept_stale: bool,
}

/// `gonio calibrate geometry`.
#[derive(Debug, Args)]
pub struct GeometryArguments {
    /// Sessions: --kind black-glass and black-glass-wedge, and white ones for the mirror's rim and openings
    #[arg(required = true)]
    pub sessions: Vec<PathBuf>,
    /// What every calibration asks
    #[command(flatten)]
    pub common: CommonArguments,
    /// Standard deviation of a tilt or spin about what the encoders say, degrees
    #[arg(long, default_value_t = 0.01)]
    pub repeatability_deg: f64,
    /// Picture of the spots with their residuals; by default beside the output, ending in .spots.png
    #[arg(long)]
    pub picture: Option<PathBuf>,
}
