//! `gonio demo`: the main job on the virtual instrument, from nothing to pictures.

use std::time::Instant;

use gonio_brdf::models::AshikhminShirleySimplified;
use gonio_brdf::{Model, ModelFile};
use serde_json::json;

use crate::arguments::{CoatArguments, DemoArguments, Kind, ScanArguments, VirtualArguments};
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, check_free, shown, write_whole};
use crate::{fitting, rig, signals};

use super::scan;

/// Writes the paint, scans it, and says how close the fit came to what it is.
///
/// # Errors
/// As `gonio scan`.
pub fn run(a: &DemoArguments, printer: Printer) -> Result<Outcome, Failure> {
    let started = Instant::now();
    let truth_path = a.output.join("demo.truth.json");
    let session = a.output.join("demo.mcap");
    let paint = paint(a)?;
    let file = ModelFile { model: Model::AshikhminShirleySimplified(paint), coat: None, fit: None };
    file.check().map_err(Failure::usage)?;
    let text = file.to_json().map_err(|e| Failure::failed("the paint cannot be written", e))?;
    std::fs::create_dir_all(&a.output)
        .map_err(|e| Failure::usage(format!("folder {} cannot be made: {e}", a.output.display())))?;
    check_free(&session, a.force)?;
    write_whole(&truth_path, text.as_bytes())?;
    let arguments = ScanArguments {
        texture: false,
        device: "sim".to_owned(),
        camera: "sim".to_owned(),
        instrument: if a.tiny { "tiny" } else { "reference" }.to_owned(),
        plan: None,
        scene: None,
        max_delta_e: 1.0,
        kind: Kind::Sample,
        reference: Vec::new(),
        certificate: None,
        accept_stale: false,
        sample: "demo".to_owned(),
        name: "Demo paint".to_owned(),
        batch: String::new(),
        operator: String::new(),
        note: "virtual".to_owned(),
        output: session.clone(),
        fit: Some("ashikhmin-shirley-simplified".to_owned()),
        coat: CoatArguments::default(),
        resume: false,
        patience: 30.0,
        force: a.force,
        simulated: VirtualArguments {
            truth: Some(truth_path),
            misalignment: None,
            faults: None,
            seed: a.seed,
            time_scale: 1000.0,
        },
    };
    let cancel = signals::cancel_on_signals()?;
    let scanned = scan::scan(&arguments, &cancel)?;
    let verdict = scanned.verdict(&session);
    let (Some(fit), Some(files)) = (&scanned.fit, &scanned.files) else {
        return verdict;
    };
    let truth = [
        ("exponent", vec![paint.exponent]),
        ("diffuse", paint.diffuse.to_vec()),
        ("specular", paint.specular.to_vec()),
    ];
    let mut lines = format!(
        "{} poses, {} frames through the serial driver\n\n{:<10} {:>28}   {}\n",
        scanned.recorded.poses_done, scanned.recorded.frames, "", "truth", "fitted (k = 1)"
    );
    for (name, values) in fitting::grouped(fit) {
        let is = truth.iter().find(|t| t.0 == name).map_or(&[][..], |t| &t.1);
        let is: Vec<String> = is.iter().map(ToString::to_string).collect();
        let got: Vec<String> =
            values.iter().map(|p| gonio_render::report::plus_minus(p.value, p.sigma)).collect();
        lines += &format!("{name:<10} {:>28}   {}\n", is.join(" "), got.join("   "));
    }
    let seconds = started.elapsed().as_secs_f64();
    lines += &format!(
        "\nsession   {}\ntable     {}\nmodel     {}\nreport    {}\npictures  {}\n\ntook {seconds:.1} s; try: gonio replay {} -o again.nc\n",
        session.display(),
        files.table.display(),
        files.model.display(),
        files.report.display(),
        files.pictures.display(),
        session.display()
    );
    printer.result(
        &lines,
        &json!({
            "session": shown(&session), "truth": file, "fit": fit.to_json(), "files": files.to_json(), "seconds": seconds,
            "poses": scanned.recorded.poses_done, "frames": scanned.recorded.frames,
        }),
    );
    verdict
}

fn paint(a: &DemoArguments) -> Result<AshikhminShirleySimplified, Failure> {
    let standard = ModelFile::from_json(rig::DEMO_PAINT).map_err(|e| Failure::failed("the demo paint", e))?;
    let Model::AshikhminShirleySimplified(mut paint) = standard.model else {
        return Err(Failure::Failed("the demo paint is of another model".to_owned()));
    };
    let three = |v: &Option<Vec<f64>>| match v.as_deref() {
        Some([r, g, b]) => Some([*r, *g, *b]),
        _ => None,
    };
    paint.diffuse = three(&a.diffuse).unwrap_or(paint.diffuse);
    paint.specular = three(&a.specular).unwrap_or(paint.specular);
    paint.exponent = a.exponent.unwrap_or(paint.exponent);
    Ok(paint)
}
