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
}

/// `gonio calibrate geometry`.
#[derive(Debug, Args)]
pub struct GeometryArguments {
    /// Sessions: --kind black-glass and black-glass-wedge, and white ones for the mirror's rim and openings
    #[arg(required = true)]
    pub sessions: Vec<PathBuf>,
    /// The description to write, with the calibration in it; a file that exists is never overwritten
    #[arg(short, long)]
    pub output: PathBuf,
    /// The description to calibrate in place of that of the sessions: TOML, or `reference` / `tiny`
    #[arg(long)]
    pub instrument: Option<String>,
    /// Standard deviation of a tilt or spin about what the encoders say, degrees
    #[arg(long, default_value_t = 0.01)]
    pub repeatability_deg: f64,
    /// Refractive index of the black glass
    #[arg(long, default_value_t = 1.567)]
    pub index: f64,
    /// Picture of the spots with their residuals; by default beside the output, ending in .spots.png
    #[arg(long)]
    pub picture: Option<PathBuf>,
}
