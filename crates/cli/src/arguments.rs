//! The command line: names, flags and their help. What each does is in [`crate::commands`].

pub mod calibrate;
pub mod effect;
pub mod paint;
pub mod scene;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Run a camera-based gonioreflectometer, and turn what it sees into paint that can be rendered.
#[derive(Debug, Parser)]
#[command(name = "gonio", version, propagate_version = true, max_term_width = 110)]
pub struct Arguments {
    /// Print the result as one JSON object on stdout (keys: docs/json.md)
    #[arg(long, global = true)]
    pub json: bool,
    /// More log lines on stderr (-v progress, -vv details)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// What to do
    #[command(subcommand)]
    pub command: Command,
}

/// The commands of the contract.
#[derive(Debug, Subcommand)]
#[allow(clippy::large_enum_variant)] // made once a run
pub enum Command {
    /// A whole scan of a virtual paint: recorded, processed, fitted, with pictures
    #[command(after_help = "Examples:\n  gonio demo\n  gonio demo -o out/blue --seed 7 --exponent 410")]
    Demo(DemoArguments),
    /// Scan a sample or a reference and record the session
    #[command(
        after_help = "Examples:\n  gonio scan --device sim --truth paint.json -o S.mcap --fit\n  gonio scan --device serial:/dev/ttyUSB0 --camera sim:cam.sock --kind white --certificate W7.json -o white.mcap\n  gonio scan --device sim -o S.mcap --fit --scene product.toml      no more poses than the scene needs\n  gonio scan --device sim -o S.mcap --resume      go on after an interruption"
    )]
    Scan(ScanArguments),
    /// Recompute the BRDF from a recorded session
    #[command(
        after_help = "Examples:\n  gonio replay S.mcap -o S.nc\n  gonio replay S.mcap --reference S.white.mcap -o again.nc --fit"
    )]
    Replay(ReplayArguments),
    /// Find what an instrument really is, from sessions of reference samples
    #[command(
        after_help = "Examples:\n  gonio scan --device serial:/dev/ttyUSB0 --camera v4l:0 --instrument I.toml --kind black-glass -o flat.mcap\n  gonio scan … --kind black-glass-wedge -o wedge.mcap\n  gonio calibrate geometry flat.mcap wedge.mcap white.mcap -o I.2.toml"
    )]
    Calibrate(calibrate::CalibrateArguments),
    /// Check every byte of a session: 0 intact, 3 readable with loss, 1 unreadable
    #[command(after_help = "Example:\n  gonio verify S.mcap")]
    Verify {
        /// The session
        session: PathBuf,
    },
    /// Copy what is intact of a damaged session into a new one
    #[command(after_help = "Example:\n  gonio recover S.mcap -o rescued.mcap")]
    Recover {
        /// The damaged session
        session: PathBuf,
        /// The session to write
        #[arg(short, long)]
        output: PathBuf,
        /// Overwrite the output
        #[arg(long)]
        force: bool,
    },
    /// Serve the virtual instrument as devices that other programs can open
    #[command(
        after_help = "Example:\n  gonio sim --pty stage --camera-socket cam.sock --truth paint.json &\n  gonio scan --device serial:stage --camera sim:cam.sock --reference W.mcap -o S.mcap"
    )]
    Sim(SimArguments),
    /// Fit a model to a measured BRDF; no starting values
    #[command(
        after_help = "Examples:\n  gonio fit S.nc -o model.json --export paint.xml\n  gonio fit scans/ -o models --report all.html\n  gonio fit S.nc --model auto --max-delta-e 1.5\n  gonio fit cayman.brdf --weights none --max-angle-deg 60\n  gonio fit merl_nbrdf.f32#blue-metallic-paint\n  gonio fit S.nc --model flake-map:1 -o flakes.json"
    )]
    Fit(FitArguments),
    /// Evaluate a table or a model at the geometries of a CSV file
    #[command(
        after_help = "Example:\n  printf 'theta_i_deg,theta_o_deg,phi_deg\\n45,30,180\\n' > g.csv; gonio eval model.json --geometries g.csv -o out.csv"
    )]
    Eval(EvalArguments),
    /// Draw the colour map or the flake map of an effect coating, or write it for shaders
    #[command(
        after_help = "Examples:\n  gonio colormap S.nc -o map.png\n  gonio colormap cc_ibiza_sunset_rgb.bsdf --flake -o flakes.png\n  gonio colormap S.nc --method clip --nodes 128 -o map.exr\n  gonio colormap portable.csv --index 1.5 -o map.png"
    )]
    Colormap(effect::ColormapArguments),
    /// What each way to store a BRDF costs and how far its colours are off, measured on this machine
    #[command(
        after_help = "Examples:\n  gonio trade S.nc -o trade\n  gonio trade merl_nbrdf.f32#blue-metallic-paint --only table,clip,flake-map:0,flake-map:1\n  gonio trade S.nc --scene product.toml -o trade\n  gonio trade S.nc --geometries scene.csv --json"
    )]
    Trade(effect::TradeArguments),
    /// The cheapest way to store a BRDF that keeps a colour bound for a scene, written out, with the evidence
    #[command(
        after_help = "Examples:\n  gonio tailor S.nc --scene product.toml --max-delta-e 1 -o tailored\n  gonio tailor merl_nbrdf.f32#blue-metallic-paint --scene car.toml --statistic p95 --max-delta-e 3"
    )]
    Tailor(scene::TailorArguments),
    /// Render a scene with a measured BRDF, a model or a map
    #[command(
        after_help = "Examples:\n  gonio render S.nc --scene product.toml -o picture.png\n  gonio render paint.json --scene car.toml --coat 1.5 --bounces 2 -o car.exr\n  gonio render S.nc --as clip --scene sphere.toml --mark-critical --no-cosine -o clip.png\n  gonio render S.nc --scene product.toml -o p.png --geometries geometries.png"
    )]
    Render(scene::RenderArguments),
    /// Mix car paints, show what lies between them, find the mixture closest to a target
    #[command(subcommand)]
    Paint(paint::PaintCommand),
    /// The poses that a scene needs, as a plan for gonio scan
    #[command(
        after_help = "Examples:\n  gonio plan --scene product.toml -o plan.toml; gonio scan --plan plan.toml -o S.mcap --fit\n  gonio plan --scene product.toml --like earlier.nc --max-delta-e 1 -o plan.toml\n  gonio plan --scene product.toml --after S.nc -o next.toml      the next pose of an adaptive scan"
    )]
    Plan(scene::PlanArguments),
    /// Isochromatic lines: the in-plane geometries that see the same flakes
    #[command(
        after_help = "Example:\n  gonio isoline --index 1.5 --method clip --geometries g.csv -o out.csv"
    )]
    Isoline(IsolineArguments),
    /// Convert between measured formats, sample a model onto Sopp's grid, or write it as a renderer's material
    #[command(
        after_help = "Examples:\n  gonio convert S.nc S.csv\n  gonio convert carpaint_blue.mbsdf blue.nc\n  gonio convert model.json paint.mtlx\n  gonio convert model.json paint.csv --as sopp\n\nA material is said to differ from the model by its CIEDE2000; see docs/fitting.md."
    )]
    Convert {
        /// What to read (any known format; FILE#NAME for a network)
        input: String,
        /// What to write; the ending chooses: .nc or .csv, .json for a model, .paint for a car paint (from a row of a published table, FILE#NAME, or a cook-torrance model); of a model .xml (Mitsuba 3), .mtlx (MaterialX), .gltf
        output: PathBuf,
        /// A renderer's material, whatever the ending: sopp (CSV for the Ashikhmin shader), mitsuba, materialx, gltf
        #[arg(long = "as", value_name = "RENDERER")]
        renderer: Option<String>,
        /// Overwrite the output
        #[arg(long)]
        force: bool,
    },
    /// Tell what any file holds
    #[command(
        after_help = "Examples:\n  gonio info S.mcap\n  gonio info S.nc --json\n  gonio info S.nc --budget"
    )]
    Info {
        /// The file (FILE#NAME for a network)
        file: String,
        /// Where the uncertainty of a measured table comes from, part by part
        #[arg(long)]
        budget: bool,
    },
    /// Draw the pictures of a measured BRDF or a model, and a report
    #[command(after_help = "Example:\n  gonio show S.nc -o pictures")]
    Show(ShowArguments),
    /// State of the scans that run on this machine
    Status,
    /// Stop a running scan in a controlled way; --emergency stops motion and lamp at once
    Stop {
        /// Emergency stop
        #[arg(long)]
        emergency: bool,
        /// Pause instead; `gonio stop --resume` goes on
        #[arg(long, conflicts_with_all = ["emergency", "resume"])]
        pause: bool,
        /// Go on after a pause
        #[arg(long, conflicts_with = "emergency")]
        resume: bool,
    },
    /// Take one picture of a camera, to see that it looks where it should (no measurement)
    #[command(
        after_help = "Examples:\n  gonio preview --camera v4l:0 -o look.png\n  gonio preview --camera genicam:ID --instrument I.toml --exposure-ms 50 -o look.png"
    )]
    Preview(PreviewArguments),
    /// Look at ports, USB stages, cameras and permissions: what is wrong, how to mend it
    #[command(
        after_help = "Examples:\n  gonio doctor\n  sudo gonio doctor --install-udev      whoever sits at this machine may open stages and cameras"
    )]
    Doctor(DoctorArguments),
}

impl ScanArguments {
    /// How long to look for a stage whose port hung up; nonsense counts as not at all.
    #[must_use]
    pub fn patience(&self) -> std::time::Duration {
        std::time::Duration::try_from_secs_f64(self.patience).unwrap_or_default()
    }
}

/// `gonio preview`.
#[derive(Debug, Args)]
pub struct PreviewArguments {
    /// v4l:N (N of /dev/videoN, a path, a serial number or a name), genicam:ID, or sim:SOCKET
    #[arg(long, default_value = "v4l:0")]
    pub camera: String,
    /// PNG to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// Take a raw frame of a camera that gives colour too
    #[arg(long)]
    pub raw: bool,
    /// Exposure of a raw frame
    #[arg(long, default_value_t = 20.0, value_name = "MS")]
    pub exposure_ms: f64,
    /// Instrument whose size and depth a GenICam or virtual camera gives: TOML, `reference` or `tiny`
    #[arg(long, default_value = "reference")]
    pub instrument: String,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// `gonio doctor`.
#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// Write the udev rules that let you open stages and cameras; takes an administrator, and says the line if you are none
    #[arg(long)]
    pub install_udev: bool,
    /// Folder of the udev rules
    #[arg(long, value_name = "FOLDER", default_value = "/etc/udev/rules.d")]
    pub rules_folder: PathBuf,
    /// With --install-udev: replace rules of the same name
    #[arg(long, requires = "install_udev")]
    pub force: bool,
}

/// `gonio demo`.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// Folder for session, table, model, report and pictures
    #[arg(short, long, default_value = "gonio-demo")]
    pub output: PathBuf,
    /// Seed of the instrument's noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Exponent of the demo paint
    #[arg(long)]
    pub exponent: Option<f64>,
    /// Diffuse colour of the demo paint, r,g,b
    #[arg(long, value_delimiter = ',', num_args = 3)]
    pub diffuse: Option<Vec<f64>>,
    /// Specular colour of the demo paint, r,g,b
    #[arg(long, value_delimiter = ',', num_args = 3)]
    pub specular: Option<Vec<f64>>,
    /// Use the small instrument: seconds instead of a minute, coarser numbers
    #[arg(long)]
    pub tiny: bool,
    /// Overwrite an earlier demo
    #[arg(long)]
    pub force: bool,
}

/// What a session measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// A sample
    Sample,
    /// The white reference
    White,
    /// Black glass, flat
    BlackGlass,
    /// Black glass on a wedge
    BlackGlassWedge,
    /// Shutter closed
    Dark,
}

impl From<Kind> for gonio_instrument::ScanKind {
    fn from(k: Kind) -> Self {
        match k {
            Kind::Sample => Self::Sample,
            Kind::White => Self::White,
            Kind::BlackGlass => Self::BlackGlass,
            Kind::BlackGlassWedge => Self::BlackGlassWedge,
            Kind::Dark => Self::Dark,
        }
    }
}

/// What only the virtual instrument takes.
#[derive(Clone, Debug, Args)]
pub struct VirtualArguments {
    /// What the virtual sample is: a model.json, a measured table, or a paint of single flakes (TOML, docs/flakes.md)
    #[arg(long)]
    pub truth: Option<PathBuf>,
    /// Errors of the virtual instrument, TOML, or `builtin`
    #[arg(long)]
    pub misalignment: Option<PathBuf>,
    /// Faults of the virtual instrument, its line, its camera and the session file, TOML (docs/reliability.md)
    #[arg(long)]
    pub faults: Option<PathBuf>,
    /// Seed of its noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// How many times faster than life it moves, exposes and warms up
    #[arg(long, default_value_t = 1000.0)]
    pub time_scale: f64,
}

/// What is done about a clear coat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClearCoatName {
    /// Left in: the table holds the surface as it is
    None,
    /// Separated where its gloss is found
    Auto,
    /// Separated; the base divided by 1 − F(θi) is the one wanted
    SinglePass,
    /// Separated; the base divided by T(θi) T(θo)/n² is the one wanted
    TwoWay,
}

/// Settings about a clear coat, for scans and replays.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct CoatArguments {
    /// Clear coat; `auto` separates it where its gloss is found. A replay takes what the scan was told
    #[arg(long, value_enum)]
    pub clear_coat: Option<ClearCoatName>,
    /// Refractive index of the coat where it is known; else it is found from the gloss
    #[arg(long, value_name = "N")]
    pub coat_index: Option<f64>,
}

/// `gonio scan`.
#[derive(Debug, Args)]
pub struct ScanArguments {
    /// sim, serial:PATH, or usb:VID:PID[:SERIAL] (hexadecimal)
    #[arg(long, default_value = "sim")]
    pub device: String,
    /// sim, sim:SOCKET, v4l:N (N of /dev/videoN, a path, a serial number or a name; uvc:N is the same), or genicam:ID
    #[arg(long, default_value = "sim")]
    pub camera: String,
    /// Instrument description, TOML, or `reference` / `tiny`
    #[arg(long, default_value = "reference")]
    pub instrument: String,
    /// Plan, TOML; by default the one of the instrument
    #[arg(long)]
    pub plan: Option<PathBuf>,
    /// Adaptive, with --fit: after each pose the next is the one that this scene's pictures ask for most, until --max-delta-e is expected
    #[arg(long, requires = "fit")]
    pub scene: Option<PathBuf>,
    /// With --scene: mean colour difference (CIEDE2000) of its pixels that will do
    #[arg(long, default_value_t = 1.0)]
    pub max_delta_e: f64,
    /// What is measured
    #[arg(long, value_enum, default_value = "sample")]
    pub kind: Kind,
    /// Sessions of the white reference (and others); on sim, --fit takes one first where none is given
    #[arg(long)]
    pub reference: Vec<PathBuf>,
    /// Certificate of the white reference, for --kind white: JSON with serial, issued, expires (YYYY-MM-DD), brdf (a model.json as text), relative_uncertainty
    #[arg(long)]
    pub certificate: Option<PathBuf>,
    /// Use references that are expired or of another instrument; recorded in the result
    #[arg(long)]
    pub accept_stale: bool,
    /// Identifier of the sample
    #[arg(long, default_value = "")]
    pub sample: String,
    /// Name of the sample
    #[arg(long, default_value = "")]
    pub name: String,
    /// Production batch
    #[arg(long, default_value = "")]
    pub batch: String,
    /// Who runs the scan
    #[arg(long, default_value = "")]
    pub operator: String,
    /// Anything else worth keeping
    #[arg(long, default_value = "")]
    pub note: String,
    /// The session to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// Write S.nc, S.model.json and S.report.html after each capture and at the end
    #[arg(long, num_args = 0..=1, default_missing_value = "auto", require_equals = true, value_name = "MODEL")]
    pub fit: Option<String>,
    /// Clear coat
    #[command(flatten)]
    pub coat: CoatArguments,
    /// Record the texture camera, which sees single flakes, instead of the instrument's camera; of a sample the slices are written to S.textures/
    #[arg(long, conflicts_with_all = ["fit", "scene"])]
    pub texture: bool,
    /// Go on with an interrupted session
    #[arg(long)]
    pub resume: bool,
    /// How long to look for a stage whose port hung up, seconds
    #[arg(long, default_value_t = 30.0, value_name = "SECONDS")]
    pub patience: f64,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
    /// Settings of the virtual instrument
    #[command(flatten)]
    pub simulated: VirtualArguments,
}

/// `gonio replay`.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The recorded session
    pub session: PathBuf,
    /// Sessions of the white reference; by default those found beside the session
    #[arg(long)]
    pub reference: Vec<PathBuf>,
    /// Instrument description in place of the recorded one: TOML, or `reference` / `tiny`
    #[arg(long)]
    pub instrument: Option<String>,
    /// The table to write; of a texture scan the folder of slices
    #[arg(short, long)]
    pub output: PathBuf,
    /// Fit a model too
    #[arg(long, num_args = 0..=1, default_missing_value = "auto", require_equals = true, value_name = "MODEL")]
    pub fit: Option<String>,
    /// Clear coat
    #[command(flatten)]
    pub coat: CoatArguments,
    /// Use references that are expired or of another instrument; recorded in the result
    #[arg(long)]
    pub accept_stale: bool,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// `gonio sim`.
#[derive(Debug, Args)]
pub struct SimArguments {
    /// Path at which the stage's serial port appears
    #[arg(long)]
    pub pty: PathBuf,
    /// Path at which the camera listens
    #[arg(long)]
    pub camera_socket: PathBuf,
    /// Instrument description, TOML, or `reference` / `tiny`
    #[arg(long, default_value = "reference")]
    pub instrument: String,
    /// What lies on the holder
    #[arg(long, value_enum, default_value = "sample")]
    pub kind: Kind,
    /// End when the program that started this one ends, however it ends
    #[arg(long)]
    pub with_parent: bool,
    /// Settings of the virtual instrument
    #[command(flatten)]
    pub simulated: VirtualArguments,
}

/// Weights of a fit.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum WeightsName {
    /// Sopp (4.25): the residual times solid angle and cos θi
    Sopp,
    /// Ngan (3.5): the square times solid angle and cos² θi
    Ngan,
    /// Inverse variance
    Sigma,
    /// The logarithm: relative errors count alike
    LogRelative,
    /// All alike
    None,
}

/// How a fit is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// Ours: no start values, the global minimum
    #[default]
    Projection,
    /// Sopp's two-stage iteration with his rule for lambda, from --start; for comparison
    Sopp,
    /// Simulated annealing; for comparison
    Anneal,
}

/// `gonio fit`.
#[derive(Debug, Args)]
pub struct FitArguments {
    /// What to fit: measured BRDFs in any known format (FILE#NAME for a network, FILE#* for all of it), or folders of them
    #[arg(required = true)]
    pub inputs: Vec<String>,
    /// Model, or auto, or flake-map:K (a map for effect coatings, its own file), or car-paint (lobes, colour table and flakes, its own file)
    #[arg(long, default_value = "auto")]
    pub model: String,
    /// With --model auto: the largest mean CIEDE2000 on held-out angles that will do
    #[arg(long, default_value_t = 2.0)]
    pub max_delta_e: f64,
    /// How the fit is made
    #[arg(long, value_enum, default_value = "projection")]
    pub method: MethodName,
    /// Start values of --method sopp: exponent, cd, cs
    #[arg(long, value_name = "N,CD,CS", default_value = "25,0.2,0.2")]
    pub start: String,
    /// Iterations of each stage of --method sopp; evaluations of --method anneal
    #[arg(long)]
    pub iterations: Option<usize>,
    /// Seed of --method anneal
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Refractive index of the coat, for flake-map:K; by default what the file says, else 1.5
    #[arg(long)]
    pub index: Option<f64>,
    /// Largest polar angle used, of light and view, degrees
    #[arg(long, default_value_t = 75.0)]
    pub max_angle_deg: f64,
    /// Weights; by default sigma where the data carry uncertainties, else ngan
    #[arg(long, value_enum)]
    pub weights: Option<WeightsName>,
    /// How outliers count: squares, huber, cauchy, tukey
    #[arg(long, default_value = "squares")]
    pub loss: String,
    /// A clear coat over the model: auto (the one separated from the data, if any), none, fit (its index is fitted), or a refractive index such as 1.5
    #[arg(long, default_value = "auto", value_name = "COAT")]
    pub coat: String,
    /// The model.json to write; of several inputs the folder that takes NAME.model.json for each
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// A report.html to write; of several inputs one for all
    #[arg(long)]
    pub report: Option<PathBuf>,
    /// A renderer's material to write as well (one input): .xml, .mtlx, .gltf, or .csv for Sopp's shader; may be repeated
    #[arg(long, value_name = "FILE")]
    pub export: Vec<PathBuf>,
    /// With --model car-paint: a folder of flake textures (slices.toml) whose mean the measurement contains
    #[arg(long, value_name = "FOLDER")]
    pub flakes: Option<PathBuf>,
    /// Overwrite the outputs
    #[arg(long)]
    pub force: bool,
}

/// `gonio eval`.
#[derive(Debug, Args)]
pub struct EvalArguments {
    /// A measured BRDF or a model.json
    pub input: String,
    /// Representation: table (the file as it is) | clip | map-vector | map-vector-parallel | unit-index | flake-map:K | aspecular
    #[arg(long = "as", default_value = "table")]
    pub representation: String,
    /// Index, size and gloss of maps
    #[command(flatten)]
    pub map: effect::MapArguments,
    /// CSV with theta_i_deg,theta_o_deg,phi_deg
    #[arg(long)]
    pub geometries: PathBuf,
    /// CSV to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// `gonio isoline`.
#[derive(Debug, Args)]
pub struct IsolineArguments {
    /// Refractive index of the coat
    #[arg(long, default_value_t = 1.5)]
    pub index: f64,
    /// clip | map-vector | map-vector-parallel | unit-index
    #[arg(long, default_value = "clip")]
    pub method: String,
    /// Give the other of the two in-plane geometries, with light and view exchanged
    #[arg(long)]
    pub exchanged: bool,
    /// CSV with theta_i_deg,theta_o_deg,phi_deg
    #[arg(long)]
    pub geometries: PathBuf,
    /// CSV to write
    #[arg(short, long)]
    pub output: PathBuf,
    /// Overwrite the output
    #[arg(long)]
    pub force: bool,
}

/// `gonio show`.
#[derive(Debug, Args)]
pub struct ShowArguments {
    /// A measured BRDF or a model
    pub input: String,
    /// Folder for the pictures and report.html
    #[arg(short, long)]
    pub output: PathBuf,
    /// Overwrite earlier pictures
    #[arg(long)]
    pub force: bool,
}
