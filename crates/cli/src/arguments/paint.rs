//! Arguments of `gonio paint`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use gonio_paint::mixing::Part;

/// What is done with car paints.
#[derive(Debug, Subcommand)]
pub enum PaintCommand {
    /// Mix two or more paints, flakes by optimal transport; weights outside of 0 … 1 extrapolate
    #[command(
        after_help = "Examples:\n  gonio paint mix brown.paint blue.paint --weights 0.5,0.5 -o half.paint\n  gonio paint mix blue.paint brown.paint --weights 0,1 --part lightness -o sparkling.paint\n  gonio paint mix a.paint b.paint c.paint --weights 0.2,0.5,0.3 -o mix.paint\n  gonio paint mix blue.paint brown.paint --weights=1.25,-0.25 -o bluer.paint"
    )]
    Mix(MixArguments),
    /// A strip of pictures from one paint to another
    #[command(
        after_help = "Examples:\n  gonio paint sweep brown.paint blue.paint -o strip.png\n  gonio paint sweep brown.paint blue.paint --from=-0.5 --to 1.5 -o beyond.png\n  gonio paint sweep blue.paint brown.paint --part lightness --step 0.5 --scene car.toml -o sparkle.png"
    )]
    Sweep(SweepArguments),
    /// The mixture of paints that comes closest to a measured BRDF or to multi-angle Lab values
    #[command(
        after_help = "Examples:\n  gonio paint design a.paint b.paint c.paint --target wanted.nc -o found.paint\n  gonio paint design a.paint b.paint --lab angles.csv --sparkle held\n\nThe CSV has the header theta_i_deg,theta_o_deg,phi_deg,l,a,b."
    )]
    Design(DesignArguments),
    /// What a paint holds, its flakes' statistics and what they cost
    #[command(after_help = "Example:\n  gonio paint info blue.paint --json")]
    Info {
        /// A car paint, a row of published ones (FILE#NAME), or a folder of flake slices
        input: String,
    },
}

/// Paints and how their flakes are told.
#[derive(Debug, Args)]
pub struct Paints {
    /// Car paints (.paint), rows of published ones (FILE#NAME), or folders of flake slices; two at least
    #[arg(required = true, num_args = 2..)]
    pub inputs: Vec<String>,
    /// Boxes that the flakes of a slice are told by
    #[arg(long, default_value_t = 50)]
    pub clusters: usize,
}

/// What the weights work on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PartName {
    /// All of the paint
    #[default]
    Everything,
    /// The lightness of the flakes alone; the rest stays that of the first paint
    Lightness,
    /// All but the lightness of the flakes
    Hue,
    /// All, the flakes without hue
    GreySparkle,
    /// The base alone; the flakes stay those of the first paint
    Base,
}

impl From<PartName> for Part {
    fn from(name: PartName) -> Self {
        match name {
            PartName::Everything => Self::Everything,
            PartName::Lightness => Self::Lightness,
            PartName::Hue => Self::Hue,
            PartName::GreySparkle => Self::GreySparkle,
            PartName::Base => Self::Base,
        }
    }
}

/// `gonio paint mix`.
#[derive(Debug, Args)]
pub struct MixArguments {
    /// What is mixed
    #[command(flatten)]
    pub paints: Paints,
    /// A weight for each paint
    #[arg(long, value_delimiter = ',', required = true, allow_negative_numbers = true)]
    pub weights: Vec<f64>,
    /// What the weights work on
    #[arg(long, value_enum, default_value_t)]
    pub part: PartName,
    /// The paint to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// `gonio paint sweep`.
#[derive(Debug, Args)]
pub struct SweepArguments {
    /// From the first to the second; further paints are left out
    #[command(flatten)]
    pub paints: Paints,
    /// Weight of the second paint in the first picture
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub from: f64,
    /// Weight of the second paint in the last picture
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub to: f64,
    /// Step of the weight
    #[arg(long, default_value_t = 0.25)]
    pub step: f64,
    /// What the weights work on
    #[arg(long, value_enum, default_value_t)]
    pub part: PartName,
    /// The scene, TOML (docs/scenes.md); a capsule in a product shot by default. Its first view is shown
    #[arg(long)]
    pub scene: Option<PathBuf>,
    /// Pixels along the longer side of each picture
    #[arg(long, default_value_t = 240)]
    pub side: u32,
    /// Samples per pixel, in place of the scene's
    #[arg(long)]
    pub samples: Option<u32>,
    /// Millimetres of the surface in a unit of the scene: how large flakes are in the picture
    #[arg(long, default_value_t = 10.0)]
    pub mm_per_unit: f64,
    /// Show the two paints themselves with the textures they have; by default their flakes are drawn from statistics as those of the mixtures are
    #[arg(long)]
    pub textures: bool,
    /// The strip to write, .png
    #[arg(short, long)]
    pub output: PathBuf,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// Whether the sparkle may change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SparkleName {
    /// As the mixture has it
    #[default]
    Free,
    /// The lightness of the flakes stays that of the first paint
    Held,
}

/// `gonio paint design`.
#[derive(Debug, Args)]
pub struct DesignArguments {
    /// What may be mixed
    #[command(flatten)]
    pub paints: Paints,
    /// A measured BRDF or a model to come close to, at 45° incidence and aspecular angles −15°, 15°, 25°, 45°, 75°, 110°
    #[arg(long, required_unless_present = "lab", conflicts_with = "lab")]
    pub target: Option<String>,
    /// Lab values at angles of your own, CSV
    #[arg(long)]
    pub lab: Option<PathBuf>,
    /// Whether the sparkle may change
    #[arg(long, value_enum, default_value_t)]
    pub sparkle: SparkleName,
    /// How far weights may leave 0 … 1
    #[arg(long, default_value_t = 0.0)]
    pub beyond: f64,
    /// The paint to write
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}
