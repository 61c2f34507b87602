//! Arguments of the commands for scenes: rendering, choice and planning.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::effect::MapArguments;

/// `gonio render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    /// A measured BRDF, a model, a flake map or a car paint (FILE#NAME for a network)
    pub input: String,
    /// The scene, TOML (keys: docs/scenes.md)
    #[arg(long)]
    pub scene: PathBuf,
    /// What to write: .png, tone-mapped; .exr, linear radiance. Several views are numbered: OUT.000.png …
    #[arg(short, long)]
    pub output: PathBuf,
    /// Render it as table, clip, map-vector, map-vector-parallel, unit-index, flake-map:K or aspecular; by default as the file has it
    #[arg(long = "as", value_name = "R")]
    pub representation: Option<String>,
    /// Mirror image of a smooth coat: auto (that of a model with a coat), none, or a refractive index; a model without a coat is put under it
    #[arg(long, default_value = "auto")]
    pub coat: String,
    /// Of a paint with flakes: millimetres of a unit of the scene, so that flakes have their size; 0 renders their mean
    #[arg(long, default_value_t = 20.0, value_name = "MM")]
    pub mm_per_unit: f64,
    /// Leave the cosine (projected solid angle) out, as published pictures of colour maps do
    #[arg(long)]
    pub no_cosine: bool,
    /// Reflections of the object in itself
    #[arg(long, default_value_t = 0)]
    pub bounces: u32,
    /// Samples per pixel, in place of the scene's
    #[arg(long)]
    pub samples: Option<u32>,
    /// Pixels along the longer side, in place of the scene's
    #[arg(long)]
    pub side: Option<u32>,
    /// Threads; by default one for each core
    #[arg(long)]
    pub threads: Option<usize>,
    /// Hatch the pixels whose light comes from geometries beyond the critical angle of the coat (--index), .png only
    #[arg(long)]
    pub mark_critical: bool,
    /// Write the scene's local geometries too: .png, a picture of their weights; .csv, theta_i_deg,theta_o_deg,phi_deg,weight
    #[arg(long, value_name = "FILE")]
    pub geometries: Option<PathBuf>,
    /// Index, size and gloss of maps
    #[command(flatten)]
    pub map: MapArguments,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// Which figure over the pixels is held against the bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum StatisticName {
    /// The mean over pixels
    #[default]
    Mean,
    /// The 95th percentile
    P95,
    /// The largest
    Max,
}

/// `gonio tailor`.
#[derive(Debug, Args)]
pub struct TailorArguments {
    /// A measured BRDF, a model or a flake map (FILE#NAME for a network)
    pub input: String,
    /// The scene, TOML (keys: docs/scenes.md)
    #[arg(long)]
    pub scene: PathBuf,
    /// Largest colour difference (CIEDE2000) of the scene's pixels against the full table
    #[arg(long, default_value_t = 1.0)]
    pub max_delta_e: f64,
    /// Of which figure
    #[arg(long, value_enum, default_value = "mean")]
    pub statistic: StatisticName,
    /// Folder for the representation, tailor.json, report.html and the pictures
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Choose among these alone, by name: table,clip,map-vector,map-vector-parallel,unit-index,aspecular,flake-map:K or a model; by default all
    #[arg(long, value_delimiter = ',')]
    pub only: Vec<String>,
    /// Pixels along the longer side of the pictures that are compared
    #[arg(long, default_value_t = 160)]
    pub side: u32,
    /// Samples per pixel of these pictures
    #[arg(long, default_value_t = 4)]
    pub samples: u32,
    /// Index, size and gloss of maps
    #[command(flatten)]
    pub map: MapArguments,
    /// Overwrite what an earlier run left in the folder
    #[arg(long)]
    pub force: bool,
}

/// `gonio plan`.
#[derive(Debug, Args)]
pub struct PlanArguments {
    /// The scene, TOML (keys: docs/scenes.md)
    #[arg(long)]
    pub scene: PathBuf,
    /// Instrument description, TOML, or `reference` / `tiny`
    #[arg(long, default_value = "reference")]
    pub instrument: String,
    /// The plan to write; `gonio scan --plan` takes it
    #[arg(short, long)]
    pub output: PathBuf,
    /// What the sample is likely to resemble: models or earlier measurements; by default three paints, metallic, coloured and matt
    #[arg(long, value_name = "M")]
    pub like: Vec<String>,
    /// Mean colour difference (CIEDE2000) of the scene's pixels that will do; by default that of the full plan, 5 % and 0.05 more
    #[arg(long)]
    pub max_delta_e: Option<f64>,
    /// Adaptive: the next pose after what this table holds (the .nc of `gonio scan --fit` or `gonio replay`); the plan has that pose alone
    #[arg(long, value_name = "M.nc")]
    pub after: Option<PathBuf>,
    /// Pixels along the longer side of the pictures that are compared
    #[arg(long, default_value_t = 96)]
    pub side: u32,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}
