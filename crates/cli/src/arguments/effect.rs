//! Arguments of the commands for effect coatings: colour maps and the trade.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// What happens to the gloss of the coat before a map is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum GlossName {
    /// A separated base coat where the file has one; else the lamp's image subtracted where the lamp is known; else a cone of 5° filled where a peak is seen
    #[default]
    Auto,
    /// Leave it in
    Keep,
    /// Subtract Fresnel's reflectance over the image of the lamp
    Fresnel,
    /// Fill the cone about the mirror direction from its edge
    Fill,
}

/// What maps are made of, for every command that makes one.
#[derive(Clone, Debug, Args)]
pub struct MapArguments {
    /// Refractive index of the coat, 1 for none; by default what the file says, else 1.5
    #[arg(long)]
    pub index: Option<f64>,
    /// Largest polar angle of light and view that maps hold, degrees
    #[arg(long, default_value_t = 75.0)]
    pub largest_deg: f64,
    /// Nodes of a colour map along each angle
    #[arg(long, default_value_t = 64)]
    pub nodes: usize,
    /// Gloss of the coat
    #[arg(long, value_enum, default_value = "auto")]
    pub gloss: GlossName,
    /// Angular radius of the lamp, degrees, for --gloss fresnel where the file does not say it
    #[arg(long)]
    pub lamp_half_angle_deg: Option<f64>,
    /// Half angle of the cone for --gloss fill, degrees
    #[arg(long, default_value_t = 5.0)]
    pub gloss_cone_deg: f64,
}

/// `gonio colormap`.
#[derive(Debug, Args)]
pub struct ColormapArguments {
    /// A measured BRDF, a model or a flake map (FILE#NAME for a network)
    pub input: String,
    /// What to write: .png, a picture with axes and lines; .exr, linear values for shaders, the layout in its attributes
    #[arg(short, long)]
    pub output: PathBuf,
    /// Beyond the critical angle: clip | map-vector | map-vector-parallel | unit-index (written into the .exr)
    #[arg(long, default_value = "clip")]
    pub method: String,
    /// The aspecular-only map instead: colour by the angle from the mirror direction alone, lit at 45°
    #[arg(long, conflicts_with = "flake")]
    pub aspecular: bool,
    /// The flake map of K harmonics instead, over what the flake sees (0 to 3)
    #[arg(long, value_name = "K", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    pub flake: Option<usize>,
    /// Brightening of the picture; by default a round factor that suits
    #[arg(long)]
    pub factor: Option<f64>,
    /// Index, size and gloss
    #[command(flatten)]
    pub map: MapArguments,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// `gonio trade`.
#[derive(Debug, Args)]
pub struct TradeArguments {
    /// A measured BRDF, a model or a flake map (FILE#NAME for a network)
    pub input: String,
    /// Judge over these geometries: CSV with theta_i_deg,theta_o_deg,phi_deg[,weight]; by default all to --largest-deg by solid angle
    #[arg(long)]
    pub geometries: Option<PathBuf>,
    /// Judge over the local geometries of this scene, by their share in its pictures (keys: docs/scenes.md)
    #[arg(long)]
    pub scene: Option<PathBuf>,
    /// Folder for trade.json, trade.csv, report.html and the pictures
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Compare these alone, by name: table,clip,map-vector,map-vector-parallel,unit-index,aspecular,flake-map:K or a model; by default all
    #[arg(long, value_delimiter = ',')]
    pub only: Vec<String>,
    /// Index, size and gloss
    #[command(flatten)]
    pub map: MapArguments,
    /// Overwrite what an earlier run left in the folder
    #[arg(long)]
    pub force: bool,
}
