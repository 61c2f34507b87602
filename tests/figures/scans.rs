//! Scans of virtual paints at full size, in a folder that goes away; the white reference of a seed is taken once.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};

use gonio::arguments::{CoatArguments, Kind, ScanArguments, VirtualArguments};
use gonio::commands::scan::{Scanned, scan};
use gonio_brdf::formats::{self, Loaded};
use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Measured, Model, ModelFile};
use gonio_instrument::Cancel;

static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().expect("temporary folder"));
static DONE: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);

/// A scan that was made.
pub struct Made {
    pub scanned: Scanned,
    pub session: PathBuf,
    pub truth: AshikhminShirleySimplified,
    pub table: Measured,
}

/// Path of a file in the folder.
pub fn path(name: &str) -> PathBuf {
    FOLDER.path().join(name)
}

/// Of a sample on the reference instrument, as it stands in its description.
pub fn arguments(truth: &Path, output: &Path, seed: u64, reference: Vec<PathBuf>) -> ScanArguments {
    ScanArguments {
        texture: false,
        device: "sim".to_owned(),
        camera: "sim".to_owned(),
        instrument: "reference".to_owned(),
        plan: None,
        scene: None,
        max_delta_e: 1.0,
        kind: Kind::Sample,
        reference,
        certificate: None,
        accept_stale: false,
        sample: String::new(),
        name: String::new(),
        batch: String::new(),
        operator: String::new(),
        note: String::new(),
        output: output.to_owned(),
        fit: Some("ashikhmin-shirley-simplified".to_owned()),
        coat: CoatArguments::default(),
        resume: false,
        force: true,
        patience: 30.0,
        simulated: VirtualArguments {
            truth: Some(truth.to_owned()),
            misalignment: None,
            faults: None,
            seed,
            time_scale: 1000.0,
        },
    }
}

/// Records a sample on the reference instrument, and its white reference beside it; both paths.
pub fn record(name: &str, truth: &ModelFile, seed: u64) -> (PathBuf, PathBuf) {
    let truth_path = path(&format!("{name}.truth.json"));
    std::fs::write(&truth_path, truth.to_json().expect("JSON")).expect("written");
    record_file(name, &truth_path, seed)
}

/// The same for a truth in a file, a model or a table.
pub fn record_file(name: &str, truth: &Path, seed: u64) -> (PathBuf, PathBuf) {
    let session = path(&format!("{name}.mcap"));
    scan(&arguments(truth, &session, seed, Vec::new()), &Cancel::new())
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    (session, path(&format!("{name}.white.mcap")))
}

/// Scans a paint on the reference instrument and fits it, as `gonio scan --device sim --fit` does.
pub fn make(name: &str, truth: AshikhminShirleySimplified, seed: u64) -> Made {
    let file = ModelFile { model: Model::AshikhminShirleySimplified(truth), coat: None, fit: None };
    let truth_path = path(&format!("{name}.truth.json"));
    std::fs::write(&truth_path, file.to_json().expect("JSON")).expect("written");
    let white = path(&format!("white-{seed}.mcap"));
    let mut done = DONE.lock().expect("one at a time");
    let known = done.contains(&white);
    let session = path(&format!("{name}.mcap"));
    let reference = if known { vec![white.clone()] } else { Vec::new() };
    let scanned = scan(&arguments(&truth_path, &session, seed, reference), &Cancel::new())
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    if !known {
        std::fs::copy(session.with_file_name(format!("{name}.white.mcap")), &white).expect("copied");
        done.insert(white);
    }
    let table = match formats::open(&session.with_extension("nc")) {
        Ok(Loaded::Table(t)) => *t,
        other => panic!("{name}: no table: {other:?}"),
    };
    Made { scanned, session, truth, table }
}

impl Drop for Made {
    /// Sessions are large; what is read is kept in memory.
    fn drop(&mut self) {
        for ending in ["mcap", "white.mcap"] {
            let _ = std::fs::remove_file(self.session.with_extension(ending));
        }
    }
}
