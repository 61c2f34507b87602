//! `gonio scan`: record a session, and after each capture the table and fit of what is there so far.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;

use gonio_acquisition::closure::Check;
use gonio_acquisition::runner::FrameCounts;
use gonio_acquisition::{Options, PixelMap, Reducer, geometry, radiometry, reference_plan};
use gonio_brdf::Measured;
use gonio_fitter::Fit;
use gonio_instrument::{Cancel, Certificate, Description, Plan, PoseRecord, SampleRecord, ScanKind};
use gonio_recording::{Attachment, Session};
use gonio_render::report::Fact;
use gonio_sim::firmware::Faults;
use serde_json::json;

use crate::arguments::ScanArguments;
use crate::coat::{self, Told};
use crate::control::{Control, ScanState};
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, beside, check_free, read_text, shown};
use crate::reduction::{self, Calibrated};
use crate::results::{self, Files, Story};
use crate::rig::{self, Rig, Simulated};
use crate::scanning::{self, Job, Recorded};
use crate::{adaptive, closure, continuing, fitting, isotropy, signals, textures};

/// Poses that may wait for the reduction; at eight frames of 2.6 MB some 60 MB.
const WAITING_POSES: usize = 3;

/// A scan and what came of it.
pub struct Scanned {
    /// How it went.
    pub recorded: Recorded,
    /// The final fit, with `--fit`.
    pub fit: Option<Fit>,
    /// Files beside the session, with `--fit`.
    pub files: Option<Files>,
    /// What was found of a clear coat, with `--fit`.
    pub coat: Option<Told>,
    /// Closure checks, with `--fit`.
    pub closure: Vec<Check>,
    /// What the table is without, in words: poses of sample or reference that could not be used.
    pub lost: Vec<String>,
}

impl Scanned {
    /// A scan of which nothing was reduced.
    const fn without_table(recorded: Recorded) -> Self {
        Self { recorded, fit: None, files: None, coat: None, closure: Vec::new(), lost: Vec::new() }
    }

    /// The outcome of the command.
    ///
    /// # Errors
    /// As [`scanning::verdict`].
    pub fn verdict(&self, session: &Path) -> Result<Outcome, Failure> {
        match scanning::verdict(&self.recorded, session)? {
            Outcome::Done if !self.lost.is_empty() => Ok(Outcome::WithLoss(self.lost.join("; "))),
            other => Ok(other),
        }
    }
}

/// `gonio scan`.
///
/// # Errors
/// [`Failure`] with the exit code of what went wrong; the device is left safe and what was measured kept.
pub fn run(a: &ScanArguments, printer: Printer) -> Result<Outcome, Failure> {
    let cancel = signals::cancel_on_signals()?;
    let scanned = scan(a, &cancel)?;
    let r = &scanned.recorded;
    let mut text = format!("{} of {} poses in {}\n", r.poses_done, r.poses_total, a.output.display());
    if let (Some(fit), Some(files)) = (&scanned.fit, &scanned.files) {
        text += &format!(
            "{} ({})\n{}",
            fitting::model_name(fit),
            fit.status.name(),
            fitting::parameter_lines(fit)
        );
        text += &closure::lines(&scanned.closure);
        text += &scanned.coat.iter().map(|c| format!("{}\n", c.line)).collect::<String>();
        text += &format!("report: {}\n", files.report.display());
    }
    let verdict = scanned.verdict(&a.output);
    let slices = match (a.texture && a.kind == crate::arguments::Kind::Sample, &verdict) {
        (true, Ok(_)) => {
            let folder = textures::beside(&a.output);
            Some(textures::reduce(
                &a.output,
                &a.reference,
                &a.coat,
                &folder,
                a.accept_stale,
                a.force || a.resume,
            )?)
        }
        _ => None,
    };
    text += &slices.iter().map(textures::Slices::lines).collect::<String>();
    printer.result(
        &text,
        &json!({
            "session": shown(&a.output), "kind": ScanKind::from(a.kind).name(), "poses_done": r.poses_done,
            "poses_total": r.poses_total, "frames": r.frames, "link": r.link, "camera": camera_json(&r.camera_frames),
            "complete": matches!(verdict, Ok(Outcome::Done)),
            "coat": scanned.coat.as_ref().map(|c| &c.json),
            "isotropy": scanned.coat.as_ref().map(|c| &c.isotropy),
            "colours": scanned.coat.as_ref().map(|c| &c.colours),
            "fit": scanned.fit.as_ref().map(Fit::to_json),
            "closure": closure::to_json(&scanned.closure),
            "files": scanned.files.as_ref().map(Files::to_json),
            "textures": slices.as_ref().map(textures::Slices::to_json),
        }),
    );
    verdict
}

/// Everything of a scan but the printing; `demo` calls it too.
///
/// # Errors
/// As [`run`].
pub fn scan(a: &ScanArguments, cancel: &Cancel) -> Result<Scanned, Failure> {
    let kind = ScanKind::from(a.kind);
    let instrument = rig::instrument(&a.instrument)?;
    let instrument = if a.texture { instrument.for_textures().map_err(Failure::usage)? } else { instrument };
    let plan = rig::plan(a.plan.as_deref(), &instrument)?;
    let mut simulated = if a.device == "sim" { Some(Simulated::read(&a.simulated)?) } else { None };
    let mut sample = SampleRecord {
        kind,
        id: a.sample.clone(),
        name: a.name.clone(),
        batch: a.batch.clone(),
        operator: a.operator.clone(),
        note: a.note.clone(),
    };
    let files = Files::beside(&a.output);
    if a.resume {
        if !a.output.exists() {
            return Err(Failure::usage(format!(
                "{} is not there, nothing to go on with; leave --resume out to begin",
                a.output.display()
            )));
        }
        let begun = Session::open(&a.output).map_err(Failure::usage)?;
        continuing::check(&begun, a, simulated.as_mut(), &mut sample)?;
    } else {
        continuing::check_name(&a.output)?;
        check_free(&a.output, a.force)?;
        if a.fit.is_some() {
            files.check_free(a.force)?;
        }
    }
    if let Some(model) = &a.fit {
        fitting::options(model, None, 75.0, true)?;
        if kind != ScanKind::Sample {
            return Err(Failure::usage(format!("--fit goes with --kind sample, not with {}", kind.name())));
        }
    }
    let asking = a.scene.as_deref().map(|s| adaptive::Asking::open(s, a.max_delta_e)).transpose()?;
    let recorded =
        if a.resume { Session::open(&a.output).ok().and_then(|s| s.provenance().ok()) } else { None };
    let options = coat::options(&a.coat, recorded.as_ref())?;
    let map = PixelMap::new(&instrument);
    let plan = match (kind, &a.plan) {
        // the texture camera needs its white at the very tilts of the textures
        (ScanKind::White, None) if !a.texture => reference_plan::white_plan(&map, &plan),
        (ScanKind::Dark, None) => reference_plan::dark_plan(&plan),
        (ScanKind::Flat, None) => radiometry::plans::flat(&plan, &instrument),
        (ScanKind::Black, None) => reference_plan::white_plan(&map, &plan),
        (ScanKind::Trap, None) => radiometry::plans::trap(&plan),
        (ScanKind::BlackGlass, None) => geometry::plans::flat(&plan, instrument.holder.tilt_limits_deg),
        (ScanKind::BlackGlassWedge, None) => geometry::plans::wedge(&plan, instrument.holder.tilt_limits_deg),
        _ => plan,
    };
    // the plan's angles of incidence as the tilts that give them
    let plan = reference_plan::on_instrument(&map, &plan);
    let references = match (&simulated, a.reference.is_empty(), &a.fit) {
        (Some(s), true, fit) if fit.is_some() || (a.texture && kind == ScanKind::Sample) => {
            vec![virtual_white(a, s, &instrument, &map, cancel)?]
        }
        _ => a.reference.clone(),
    };
    let day = reduction::day(gonio_recording::now());
    let calibrated = match a.fit {
        Some(_) => Some(reduction::calibrate(&references, &instrument, &day, a.accept_stale)?),
        None => None,
    };
    let reference = match &calibrated {
        Some(c) => Some(c.session.clone()),
        // a wrong one is told now, not when the scan is over
        None if kind == ScanKind::Sample && !references.is_empty() => Some(
            reduction::find_white(&references, &instrument, &day, a.accept_stale)?.session.path().to_owned(),
        ),
        None => None,
    };
    let certificate = certificate(a, kind, simulated.is_some())?;
    let mut provenance = provenance(a, simulated.as_ref());
    coat::record(&a.coat, &mut provenance);
    if let Some(reference) = &reference {
        provenance.insert("reference".to_owned(), relative(reference, &a.output));
    }
    let attachments = simulated
        .as_ref()
        .and_then(|s| s.truth_text.as_deref())
        .map(|t| Attachment::text("truth.json", "application/json", t))
        .into_iter()
        .collect();
    let job = Job {
        instrument: &instrument,
        plan: &plan,
        sample,
        certificate,
        provenance,
        attachments,
        output: &a.output,
        resume: a.resume,
        force: a.force,
        file_faults: simulated.as_ref().and_then(Simulated::file_faults),
    };
    if a.resume
        && let Some(recorded) = continuing::nothing_left(&job)?
    {
        return match (&calibrated, &a.fit) {
            (Some(calibrated), Some(model)) => conclude(
                &job,
                recorded,
                reduction::reducer(calibrated, &job.sample, &options)?,
                calibrated.lost.clone(),
                calibrated,
                &options,
                model,
                &files,
            ),
            _ => Ok(Scanned::without_table(recorded)),
        };
    }
    let mut rig =
        Rig::open(&a.device, &a.camera, &instrument, &plan, kind, simulated.as_ref(), a.patience())?;
    let state = ScanState {
        session: a.output.display().to_string(),
        kind: kind.name().to_owned(),
        poses_total: plan.poses().len() as u32,
        ..ScanState::default()
    };
    let control = Control::listen(state, cancel.clone())
        .map_err(|e| tracing::warn!("`gonio status` will not see this scan: {e}"))
        .ok();
    match (&calibrated, &a.fit, &asking) {
        (Some(calibrated), Some(model), Some(asking)) => {
            let mut reducer = reduction::reducer(calibrated, &job.sample, &options)?;
            let mut lost = calibrated.lost.clone();
            let recorded = adaptive::record(
                &job,
                &mut rig,
                &map,
                cancel,
                control.as_ref(),
                &mut reducer,
                &mut lost,
                asking,
            )?;
            if reducer.statistics().is_empty() {
                return Ok(Scanned::without_table(recorded));
            }
            conclude(&job, recorded, reducer, lost, calibrated, &options, model, &files)
        }
        (Some(calibrated), Some(model), None) => {
            with_fit(&job, &mut rig, &map, cancel, control.as_ref(), calibrated, &options, model, &files)
        }
        _ => {
            let recorded = scanning::record(&job, &mut rig, &map, cancel, control.as_ref(), &mut |_| {})?;
            Ok(Scanned::without_table(recorded))
        }
    }
}

/// Records, and reduces and fits beside it on a thread of its own.
#[allow(clippy::too_many_arguments)] // one call, all of it needed
fn with_fit(
    job: &Job<'_>,
    rig: &mut Rig,
    map: &PixelMap,
    cancel: &Cancel,
    control: Option<&Control>,
    calibrated: &Calibrated,
    options: &Options,
    model: &str,
    files: &Files,
) -> Result<Scanned, Failure> {
    let mut reducer = reduction::reducer(calibrated, &job.sample, options)?;
    let mut lost = calibrated.lost.clone();
    let (sender, poses) = sync_channel::<PoseRecord>(WAITING_POSES);
    let (reducer_ref, lost_ref) = (&mut reducer, &mut lost);
    let recorded = std::thread::scope(|scope| {
        let worker = scope.spawn(move || {
            while let Ok(pose) = poses.recv() {
                reduction::add(reducer_ref, &pose, lost_ref);
                drop(pose);
                match results::write_so_far(files, reducer_ref, model, &job.sample) {
                    Ok(fit) => {
                        if let Some(c) = control {
                            c.update(|s| s.fit = results::fit_line(&fit));
                        }
                        tracing::info!("{}", results::fit_line(&fit));
                    }
                    Err(e) => tracing::warn!("{e}"),
                }
            }
        });
        let recorded = scanning::record(job, rig, map, cancel, control, &mut |pose| {
            // a worker that is gone has said why
            let _ = sender.send(pose);
        });
        drop(sender);
        let _ = worker.join();
        recorded
    })?;
    if reducer.statistics().is_empty() {
        return Ok(Scanned::without_table(recorded));
    }
    conclude(job, recorded, reducer, lost, calibrated, options, model, files)
}

/// The last table, fit, report and pictures.
#[allow(clippy::too_many_arguments)] // one call, all of it needed
fn conclude(
    job: &Job<'_>,
    recorded: Recorded,
    mut reducer: Reducer,
    mut lost: Vec<String>,
    calibrated: &Calibrated,
    options: &Options,
    model: &str,
    files: &Files,
) -> Result<Scanned, Failure> {
    // poses of a continued scan came in another order than a replay takes them
    let table: Measured = if job.resume {
        let session = Session::open(job.output).map_err(|e| Failure::Failed(e.to_string()))?;
        let reduced = reduction::reduce(&session, calibrated, options, |_, _| {})?;
        reducer = reduced.reducer;
        lost = reduced.lost;
        reduced.table
    } else {
        let table = reducer.finish();
        lost.extend(reduction::without_dark(&table));
        table
    };
    let fit = results::fit(&table, model)?;
    let checks = closure::checks(&table, &reducer, calibrated, &[]);
    let story = Story {
        sample: &job.sample,
        instrument: &job.instrument.name,
        poses: reducer.statistics(),
        link: Some(recorded.link),
        devices: vec![
            Fact::new(
                "stage",
                format!(
                    "{} {}, firmware {}",
                    recorded.stage.name, recorded.stage.serial, recorded.stage.firmware
                ),
            ),
            Fact::new(
                "camera",
                format!("{} {}, {} frames", recorded.camera.name, recorded.camera.serial, recorded.frames),
            ),
        ],
        coat: coat::section(&reducer),
        closure: &checks,
        lost: &lost,
    };
    results::write_all(files, &table, &fit, &story)?;
    isotropy::write_table(&reducer, files)?;
    let told = Told::of(&reducer, &table, files);
    Ok(Scanned {
        recorded,
        fit: Some(fit),
        files: Some(files.clone()),
        coat: Some(told),
        closure: checks,
        lost,
    })
}

/// The white reference of the virtual instrument: the one beside the output if it is of the same virtual instrument, else a new one.
fn virtual_white(
    a: &ScanArguments,
    simulated: &Simulated,
    instrument: &Description,
    map: &PixelMap,
    cancel: &Cancel,
) -> Result<PathBuf, Failure> {
    let path = beside(&a.output, "white.mcap");
    let mut provenance = provenance(a, Some(simulated));
    provenance.insert("time_scale".to_owned(), simulated.time_scale.to_string());
    if path.exists() {
        let same = Session::open(&path).ok().is_some_and(|s| {
            s.provenance().is_ok_and(|p| p == provenance) && s.instrument().is_ok_and(|i| i == *instrument)
        });
        if same && gonio_recording::progress(&path).is_ok_and(|p| p.complete()) {
            return Ok(path);
        }
        // one that broke off is taken again
        if !same && !a.force && !a.resume {
            return Err(Failure::usage(format!(
                "{} is of another virtual instrument; say --force to take it again, or name a reference",
                path.display()
            )));
        }
    }
    let plan: Plan = match instrument.textures() {
        Some(_) => reference_plan::on_instrument(map, &instrument.plan),
        None => reference_plan::on_instrument(map, &reference_plan::white_plan(map, &instrument.plan)),
    };
    let job = Job {
        instrument,
        plan: &plan,
        sample: SampleRecord {
            kind: ScanKind::White,
            id: "virtual white".to_owned(),
            ..SampleRecord::default()
        },
        certificate: Some(Certificate::virtual_white()),
        provenance,
        attachments: Vec::new(),
        output: &path,
        resume: false,
        force: true,
        file_faults: None,
    };
    // what shall go wrong, shall go wrong with the scan
    let sound = Simulated { faults: Faults::default(), ..simulated.clone() };
    let mut rig = Rig::open("sim", "sim", instrument, &plan, ScanKind::White, Some(&sound), a.patience())?;
    let recorded = scanning::record(&job, &mut rig, map, cancel, None, &mut |_| {})?;
    let told = |e: String| {
        let e = e.replace("go on with --resume", "say the same command again");
        format!("while the white reference was taken, which comes first: {e}")
    };
    match scanning::verdict(&recorded, &path) {
        Ok(Outcome::Done) => Ok(path),
        Ok(Outcome::WithLoss(why)) => {
            Err(Failure::Failed(format!("the white reference is incomplete: {why}")))
        }
        Err(Failure::Failed(e)) => Err(Failure::Failed(told(e))),
        Err(Failure::Device(e)) => Err(Failure::Device(told(e))),
        Err(e) => Err(e),
    }
}

fn camera_json(f: &FrameCounts) -> serde_json::Value {
    json!({
        "sound": f.sound, "missing": f.missing, "torn": f.torn, "repeated": f.repeated, "late": f.late,
        "timed_out": f.timed_out,
    })
}

fn certificate(a: &ScanArguments, kind: ScanKind, simulated: bool) -> Result<Option<Certificate>, Failure> {
    match (&a.certificate, kind, simulated) {
        (Some(path), _, _) => serde_json::from_str(&read_text(path)?)
            .map(Some)
            .map_err(|e| Failure::usage(format!("certificate {}: {e}", path.display()))),
        (None, ScanKind::White, true) => Ok(Some(Certificate::virtual_white())),
        (None, ScanKind::Black, true) => Ok(Some(Certificate::virtual_black())),
        (None, ScanKind::White | ScanKind::Black, false) => Err(Failure::usage(format!(
            "a {} reference needs its certificate: --certificate FILE, JSON with the keys of `gonio scan --help`",
            kind.name()
        ))),
        _ => Ok(None),
    }
}

fn provenance(a: &ScanArguments, simulated: Option<&Simulated>) -> BTreeMap<String, String> {
    let mut p = BTreeMap::from([("program".to_owned(), format!("gonio {}", env!("CARGO_PKG_VERSION")))]);
    if a.accept_stale {
        p.insert("accept_stale".to_owned(), "true".to_owned());
    }
    if let Some(s) = simulated {
        p.insert("seed".to_owned(), s.seed.to_string());
        p.insert("time_scale".to_owned(), s.time_scale.to_string());
        p.insert("misalignment".to_owned(), serde_json::to_string(&s.errors).unwrap_or_default());
    }
    p
}

/// A reference as the session names it: by its file name where both stand in one folder, else by its whole path.
fn relative(reference: &Path, session: &Path) -> String {
    let folder = |p: &Path| {
        let parent = p.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        parent.canonicalize().unwrap_or_else(|_| parent.to_owned())
    };
    let name = if folder(reference) == folder(session) {
        reference.file_name().map(PathBuf::from).unwrap_or_default()
    } else {
        std::path::absolute(reference).unwrap_or_else(|_| reference.to_owned())
    };
    shown(&name)
}
