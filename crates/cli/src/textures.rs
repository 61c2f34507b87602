//! Texture scans: a session of the texture camera turned into a folder of flake slices, the same way after a scan and in a replay.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gonio_acquisition::texture::{TextureReducer, TextureSlice, TextureWhiteBuilder, choose};
use gonio_acquisition::{Options, PixelMap};
use gonio_brdf::ModelFile;
use gonio_optics::Angle;
use gonio_paint::FlakeBtf;
use gonio_paint::btf_folder::{SliceFormat, write_btf_folder};
use gonio_paint::car_paint::Through;
use gonio_recording::Session;
use serde_json::{Value, json};

use crate::arguments::{ClearCoatName, CoatArguments, ReplayArguments};
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, shown};
use crate::{progress, reduction};

/// Distance of the slices' angles.
const STEP: Angle = Angle::from_degrees(2.0);
/// How far the angles of a recorded slice may be off those of its place in the grid.
const TOLERANCE: Angle = Angle::from_degrees(1.5);
/// Index of a coat that nothing is said about.
const USUAL_INDEX: f64 = 1.5;

/// What became of a texture scan.
pub struct Slices {
    folder: PathBuf,
    half_deg: [f64; 2],
    incidence_deg: [f64; 2],
    shape: [usize; 2],
    size: [usize; 2],
    texel_mm: f64,
    rms_deg: f64,
    largest_deg: f64,
    recorded: usize,
    covered: usize,
    filled: usize,
    holes: usize,
    index: Option<f64>,
    /// Poses that could not be used, with the reason.
    pub lost: Vec<String>,
}

impl Slices {
    /// For people.
    #[must_use]
    pub fn lines(&self) -> String {
        format!(
            "{} × {} slices of {} × {} texels ({} mm) in {}\n  half angles {:.0}° … {:.0}°, incidence {:.0}° … {:.0}°, of {} recorded\n  {} pairs of angles have their own slice, off by {:.2}° (r.m.s.), at most {:.2}°; {} take the nearest\n",
            self.shape[0],
            self.shape[1],
            self.size[0],
            self.size[1],
            self.texel_mm,
            self.folder.display(),
            self.half_deg[0],
            self.half_deg[1],
            self.incidence_deg[0],
            self.incidence_deg[1],
            self.recorded,
            self.covered,
            self.rms_deg,
            self.largest_deg,
            self.filled
        )
    }

    /// For programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "folder": shown(&self.folder), "half_deg": self.half_deg, "incidence_deg": self.incidence_deg,
            "slices": self.shape, "size": self.size, "texel_mm": self.texel_mm, "off_rms_deg": self.rms_deg,
            "off_max_deg": self.largest_deg, "recorded": self.recorded, "covered": self.covered, "filled": self.filled, "holes": self.holes, "coat_index": self.index,
            "lost": self.lost,
        })
    }
}

/// `S.mcap` → `S.textures`.
#[must_use]
pub fn beside(session: &Path) -> PathBuf {
    crate::output::beside(session, "textures")
}

/// Whether a session holds frames of a texture camera.
#[must_use]
pub fn is_texture_scan(session: &Path) -> bool {
    Session::open(session).is_ok_and(|s| s.instrument().is_ok_and(|i| i.textures().is_some()))
}

/// `gonio replay` of a texture scan.
///
/// # Errors
/// As [`reduce`]; [`Failure::Usage`] for `--fit`, which needs a table.
pub fn replay(a: &ReplayArguments, printer: Printer) -> Result<Outcome, Failure> {
    if a.fit.is_some() || a.instrument.is_some() {
        return Err(Failure::usage(
            "this session holds textures: --fit and --instrument belong to scans of the instrument's camera",
        ));
    }
    let slices = reduce(&a.session, &a.reference, &a.coat, &a.output, a.accept_stale, a.force)?;
    printer.result(
        &slices.lines(),
        &json!({ "session": shown(&a.session), "textures": slices.to_json(), "lost": slices.lost }),
    );
    if slices.lost.is_empty() { Ok(Outcome::Done) } else { Ok(Outcome::WithLoss(slices.lost.join("; "))) }
}

/// The index of the coat: what is asked for, else what the scan was told, else 1.5; none where no coat is to be seen.
fn index(asked: &CoatArguments, session: &Session) -> Option<f64> {
    let told = session.provenance().unwrap_or_default();
    let none = match asked.clear_coat {
        Some(name) => name == ClearCoatName::None,
        None => told.get("clear_coat").is_some_and(|c| c == "none"),
    };
    let recorded = || told.get("coat_index").and_then(|n| n.parse().ok());
    if none { None } else { asked.coat_index.or_else(recorded).or(Some(USUAL_INDEX)) }
}

/// Turns a texture scan into a folder of slices.
///
/// # Errors
/// [`Failure::Usage`] for sessions, references or angles that cannot be used, [`Failure::Failed`] where no pose can.
pub fn reduce(
    path: &Path,
    references: &[PathBuf],
    coat: &CoatArguments,
    folder: &Path,
    accept_stale: bool,
    force: bool,
) -> Result<Slices, Failure> {
    let session = Session::open(path).map_err(Failure::usage)?;
    let instrument = session.instrument().map_err(Failure::usage)?;
    let index = index(coat, &session);
    if let Some(n) = index
        && !(n > 1.0 && n <= 4.0)
    {
        return Err(Failure::usage(format!(
            "--coat-index {n}: expected a refractive index above 1, at most 4"
        )));
    }
    let references = reduction::references_of(path, &session, references);
    let day = reduction::day_of(&session);
    let white = reduction::find_white(&references, &instrument, &day, accept_stale)?;
    let map = Arc::new(PixelMap::new(&instrument));
    let options = Options::default();
    let brdf = ModelFile::from_json(&white.certificate.brdf).map_err(Failure::usage)?;
    let mut builder = TextureWhiteBuilder::new(&map, &options, brdf);
    let mut lost = Vec::new();
    for pose in white.session.poses() {
        match pose {
            Ok(record) => builder.add(&record).map_err(Failure::usage)?,
            Err(e) => lost.push(format!("white reference: {e}")),
        }
    }
    let white = builder.finish().map_err(Failure::usage)?;
    let mut reducer = TextureReducer::new(&map, &options, white, index).map_err(Failure::usage)?;
    let bar = progress::bar("textures", session.pose_indices().count() as u64);
    let mut slices: Vec<TextureSlice> = Vec::new();
    for pose in session.poses() {
        match pose.map_err(|e| e.to_string()).and_then(|r| reducer.add(&r).map_err(|e| e.to_string())) {
            Ok(more) => slices.extend(more),
            Err(e) => lost.push(e),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    write(&instrument, &slices, index, lost, folder, force)
}

fn write(
    instrument: &gonio_instrument::Description,
    slices: &[TextureSlice],
    index: Option<f64>,
    lost: Vec<String>,
    folder: &Path,
    force: bool,
) -> Result<Slices, Failure> {
    let camera = instrument.textures().ok_or_else(|| Failure::usage("the session holds no textures"))?;
    let angles: Vec<(Angle, Angle)> = slices.iter().map(|s| (s.half, s.incidence)).collect();
    let steepest = Angle::from_radians(gonio_optics::edge::safe_asin(1.0 / index.unwrap_or(1.0)));
    let grid = choose(&angles, STEP, TOLERANCE, steepest).map_err(Failure::usage)?;
    let size = camera.texels();
    let mut texels = Vec::with_capacity(grid.picks.len() * size[0] * size[1]);
    let mut holes = 0;
    for &pick in &grid.picks {
        texels.extend_from_slice(&slices[pick].texels);
        holes += slices[pick].holes;
    }
    let ends = |a: &[Angle]| [a.first(), a.last()].map(|a| a.map_or(0.0, |a| a.degrees()));
    let (half_deg, incidence_deg) = (ends(&grid.half), ends(&grid.incidence));
    let shape = [grid.half.len(), grid.incidence.len()];
    let btf = FlakeBtf::new(grid.half, grid.incidence, size, texels).map_err(Failure::usage)?;
    write_btf_folder(folder, &btf, camera.texel_mm(), index, Through::TwoWay, SliceFormat::Exr, force)
        .map_err(Failure::usage)?;
    Ok(Slices {
        folder: folder.to_owned(),
        half_deg,
        incidence_deg,
        shape,
        size,
        texel_mm: camera.texel_mm(),
        rms_deg: grid.rms.degrees(),
        largest_deg: grid.largest.degrees(),
        recorded: slices.len(),
        covered: grid.covered,
        filled: grid.filled,
        holes,
        index,
        lost,
    })
}
