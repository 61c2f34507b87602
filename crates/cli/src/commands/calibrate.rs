//! `gonio calibrate`: what the instrument really is, from sessions of reference samples.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gonio_acquisition::geometry::{
    self, NoSpot, PARAMETERS, Problem, Settings, Solution, Spot, SpotFinder, Verdict, edges, horizon,
};
use gonio_acquisition::{Options, PixelMap, geometry::spots, merge_white};
use gonio_instrument::{Description, ScanKind};
use gonio_recording::Session;
use gonio_render::plots::{SpotMark, SpotPlot};
use serde_json::{Value, json};

use crate::arguments::calibrate::{CalibrateArguments, Calibration, GeometryArguments};
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, beside, check_apart, check_free, shown, write_whole};
use crate::{progress, rig};

/// Runs the calibration asked for.
///
/// # Errors
/// As the calibration's own.
pub fn run(a: &CalibrateArguments, printer: Printer) -> Result<Outcome, Failure> {
    match &a.what {
        Calibration::Geometry(g) => geometry(g, printer),
        Calibration::Radiometry(r) => super::calibrate_radiometry::run(r, printer),
    }
}

/// Share of the observations from which on throwing them out is no cleaning up.
const MOST_REJECTED: f64 = 0.2;
/// χ² over degrees of freedom beyond which a fit does not explain what was seen.
const MOST_CHI2: f64 = 4.0;
/// More spots than this are not given up for what the fading of a white sample says.
const MOST_SPOTS_LOST: usize = 2;
/// Where pixels look is known well enough for views up to 75°, mm.
const SURE_AIM_MM: f64 = 0.05;
/// Channels are taken as equally sensitive within this, relative.
const EQUAL_CHANNELS: f64 = 0.02;

/// What a geometric calibration gave.
pub struct Calibrated {
    /// The description with the calibration in it.
    pub description: Description,
    /// The fit.
    pub solution: Solution,
    /// How good it is.
    pub verdict: Verdict,
    /// Poses without a usable spot, in words.
    pub without_spot: Vec<String>,
    /// Poses whose mirror image of the lamp lies outside the picture.
    pub outside: usize,
    /// Why the fit is not to be trusted though it ended, in words.
    pub doubts: Vec<String>,
    /// Poses that could not be read.
    pub lost: Vec<String>,
}

/// `gonio calibrate geometry`.
///
/// # Errors
/// [`Failure::Usage`] for sessions that cannot serve; [`Failure::Failed`] where the fit cannot begin.
pub fn geometry(a: &GeometryArguments, printer: Printer) -> Result<Outcome, Failure> {
    let picture = a.picture.clone().unwrap_or_else(|| beside(&a.common.output, "spots.png"));
    let inputs: Vec<&Path> = a.sessions.iter().map(PathBuf::as_path).collect();
    check_apart(&a.common.output, &inputs)?;
    for path in [&a.common.output, &picture] {
        check_new(path)?;
    }
    let c = calibrate(a)?;
    let text =
        c.description.to_toml().map_err(|e| Failure::failed("the description cannot be written", e))?;
    write_whole(&a.common.output, text.as_bytes())?;
    write_whole(&picture, &draw(&c).to_png().map_err(|e| Failure::failed("the picture cannot be made", e))?)?;
    printer.result(&words(&c, &a.common.output, &picture), &to_json(&c, &a.common.output, &picture));
    let mut loss = c.lost.clone();
    if !c.verdict.good {
        let why = match (c.solution.converged, c.doubts.is_empty()) {
            (false, _) => "the fit did not converge".to_owned(),
            (true, true) => "the poses do not determine them".to_owned(),
            (true, false) => c.doubts.join(", "),
        };
        loss.push(format!(
            "the calibration is marked as not good: directions are uncertain by {:.3}° (θo, root mean square), {why}",
            c.verdict.after.rms_deg[1],
        ));
    }
    if loss.is_empty() { Ok(Outcome::Done) } else { Ok(Outcome::WithLoss(loss.join("; "))) }
}

/// Refuses a path that exists: no calibration is ever overwritten.
///
/// # Errors
/// As [`check_free`].
pub(super) fn check_new(path: &Path) -> Result<(), Failure> {
    check_free(path, false).map_err(|e| match e {
        Failure::Usage(text) => Failure::Usage(
            text.replace(" or say --force", ": calibrations are kept side by side, sessions refer to them"),
        ),
        other => other,
    })
}

/// Everything but writing and printing.
///
/// # Errors
/// As [`geometry`].
pub fn calibrate(a: &GeometryArguments) -> Result<Calibrated, Failure> {
    let mut sessions = Vec::new();
    let mut recorded: Option<(PathBuf, Description)> = None;
    for path in &a.sessions {
        let session = Session::open(path).map_err(Failure::usage)?;
        let told = |e: &dyn std::fmt::Display| Failure::usage(format!("{}: {e}", path.display()));
        let kind = session.sample().map_err(|e| told(&e))?.kind;
        if !matches!(kind, ScanKind::BlackGlass | ScanKind::BlackGlassWedge | ScanKind::White) {
            return Err(told(&format!(
                "a session of kind {}, expected black-glass, black-glass-wedge or white",
                kind.name()
            )));
        }
        let instrument = session.instrument().map_err(|e| told(&e))?;
        if let Some((first, d)) = &recorded
            && *d != instrument
        {
            return Err(told(&format!(
                "was recorded with another description than {}; give sessions of one instrument",
                first.display()
            )));
        }
        recorded.get_or_insert_with(|| (path.clone(), instrument));
        sessions.push((path.clone(), kind, session));
    }
    let description = match (&a.common.instrument, recorded) {
        (Some(name), _) => rig::instrument(name)?,
        (None, Some((_, d))) => d,
        (None, None) => return Err(Failure::usage("no session was given")),
    };
    let settings = Settings {
        tilt_repeatability_deg: a.repeatability_deg,
        spin_repeatability_deg: a.repeatability_deg,
        ..Settings::default()
    };
    let mut lost = Vec::new();
    let map = Arc::new(PixelMap::new(&description));
    let (first, mut without_spot, outside) =
        find_spots(&sessions, &map, a.common.index, [1.0; 3], &mut lost)?;
    let unusable = without_spot.clone();
    let failed = |e: geometry::CalibrationError| {
        let dark = (outside > 0).then(|| {
            format!("; in {outside} poses the lamp's mirror image lies outside the picture or is too dark to be seen")
        });
        let others = unusable
            .first()
            .map(|first| format!("; {} poses show something else, the first: {first}", unusable.len()));
        let seen = dark.unwrap_or_default() + &others.unwrap_or_default();
        Failure::Failed(format!("{e}{seen}"))
    };
    let mut problem = Problem { description: description.clone(), spots: first, edges: Vec::new() };
    let mut solution = geometry::solve(&problem, &settings).map_err(failed)?;
    // with the optics found edges are near enough to be sought; spots are fitted again where the channels' sensitivities differ
    let found =
        Description { calibration: Some(solution.estimate.instrument.clone()), ..description.clone() };
    let by_spots = (solution.estimate.instrument.clone(), spots_thrown(&solution));
    let map = Arc::new(PixelMap::new(&found));
    let gains = spots::channel_gains(&problem.spots);
    if gains.iter().any(|g| (g - 1.0).abs() > EQUAL_CHANNELS) {
        (problem.spots, without_spot, _) =
            find_spots(&sessions, &map, a.common.index, gains, &mut Vec::new())?;
    }
    problem.edges = find_edges(&sessions, &map, &mut lost)?;
    problem.description.calibration = found.calibration;
    solution = geometry::solve(&problem, &settings).map_err(failed)?;
    if problem.edges.iter().any(|e| matches!(e.thing, edges::Thing::Horizon { .. })) {
        // the fading is read along azimuths on the sample: better where it is known what pixels look at
        let found =
            Description { calibration: Some(solution.estimate.instrument.clone()), ..description.clone() };
        problem.edges = find_edges(&sessions, &Arc::new(PixelMap::new(&found)), &mut Vec::new())?;
        problem.description.calibration = found.calibration;
        solution = geometry::solve(&problem, &settings).map_err(failed)?;
        if spots_thrown(&solution) > by_spots.1 + MOST_SPOTS_LOST {
            // what the fading says must not cost spots: a footprint may have been taken to lie on the wrong side of the lamp's spot
            problem.edges.retain(|e| !matches!(e.thing, edges::Thing::Horizon { .. }));
            problem.description.calibration = Some(by_spots.0);
            solution = geometry::solve(&problem, &settings).map_err(failed)?;
            without_spot.push(
                "horizon of the white sample: how its light fades contradicts the spots of black glass; check that the white sample lies as the black glass does"
                    .to_owned(),
            );
        }
    }
    let mut verdict = geometry::verdict::judge(&description, &solution, &settings);
    let doubts = doubts(&solution);
    verdict.good &= doubts.is_empty();
    let names = a.sessions.iter().map(|p| file_name(p)).collect();
    let description = geometry::record::calibrated(&description, &solution, &verdict, &settings, names);
    Ok(Calibrated { description, solution, verdict, without_spot, outside, doubts, lost })
}

/// Spots that were thrown out.
fn spots_thrown(s: &Solution) -> usize {
    s.rejected().filter(|r| !r.edge).count()
}

/// What speaks against a fit that ended: that it explains but a part of what was seen, or that with larger errors than it counts with.
fn doubts(s: &Solution) -> Vec<String> {
    let (all, thrown) = (s.residuals.len(), s.rejected().count());
    let mut out = Vec::new();
    if (thrown as f64) > MOST_REJECTED * all as f64 {
        out.push(format!("{thrown} of {all} observations had to be thrown out"));
    }
    if s.reduced_chi2 > MOST_CHI2 {
        out.push(format!(
            "what is left of the others is {:.1} times what they are uncertain by",
            s.reduced_chi2.sqrt()
        ));
    }
    out
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

type Opened = (PathBuf, ScanKind, Session);

/// Spots, poses without a usable one in words, and how many show none at all.
fn find_spots(
    sessions: &[Opened],
    map: &Arc<PixelMap>,
    index: f64,
    gains: [f64; 3],
    lost: &mut Vec<String>,
) -> Result<(Vec<Spot>, Vec<String>, usize), Failure> {
    let (mut found, mut without, mut outside) = (Vec::new(), Vec::new(), 0);
    for (path, kind, session) in sessions.iter().filter(|s| s.1 != ScanKind::White) {
        let bar = progress::bar(&file_name(path), session.pose_indices().count() as u64);
        let mut finder = SpotFinder::new(map.clone(), &Options::default(), index, gains);
        for pose in session.poses() {
            bar.inc(1);
            let record = match pose {
                Ok(r) => r,
                Err(e) => {
                    lost.push(format!("{}: {e}", path.display()));
                    continue;
                }
            };
            let name = format!("{}, pose {} ({})", file_name(path), record.index, record.readback);
            match finder.find(&record, *kind, &name) {
                Ok(Ok(spot)) => found.push(spot),
                // a mirror image outside the picture was to be expected
                Ok(Err(NoSpot::Dark)) => outside += 1,
                Ok(Err(e)) => without.push(format!("{name}: {e}")),
                Err(e) => return Err(Failure::usage(format!("{}: {e}", path.display()))),
            }
        }
        bar.finish_and_clear();
    }
    Ok((found, without, outside))
}

fn find_edges(
    sessions: &[Opened],
    map: &Arc<PixelMap>,
    lost: &mut Vec<String>,
) -> Result<Vec<edges::Edge>, Failure> {
    let mut out = Vec::new();
    for (path, _, session) in sessions.iter().filter(|s| s.1 == ScanKind::White) {
        let everything = vec![true; map.width() * map.height()];
        let mut merger = merge_white::Merger::new(map.clone(), &Options::default());
        for pose in session.poses() {
            let record = match pose {
                Ok(r) => r,
                Err(e) => {
                    lost.push(format!("{}: {e}", path.display()));
                    continue;
                }
            };
            match merger.add(&record, &everything) {
                Ok(Some((merged, gains))) => {
                    out.extend(edges::find(map, &merged, record.readback, gains));
                    out.extend(horizon::find(map, &merged, record.readback, gains));
                }
                Ok(None) => {}
                Err(e) => return Err(Failure::usage(format!("{}: {e}", path.display()))),
            }
        }
    }
    Ok(out)
}

fn draw(c: &Calibrated) -> gonio_render::Picture {
    let marks = c
        .solution
        .residuals
        .iter()
        .map(|r| SpotMark {
            at_px: r.at_px,
            off_px: r.off_px,
            group: if r.name.starts_with("horizon") {
                3
            } else if r.edge {
                2
            } else {
                usize::from(r.name.contains("wedge"))
            },
            rejected: r.rejected,
        })
        .collect();
    SpotPlot {
        title: format!("Spots of black glass, residuals {:.3} px r.m.s.", c.solution.rms_px),
        size_px: c.description.camera.size,
        groups: vec!["flat".to_owned(), "wedge".to_owned(), "edges".to_owned(), "horizon".to_owned()],
        marks,
    }
    .draw()
}

fn words(c: &Calibrated, output: &Path, picture: &Path) -> String {
    let s = &c.solution;
    let used = |edge: bool| s.residuals.iter().filter(|r| r.edge == edge && !r.rejected).count();
    let mut text = format!(
        "{} spots and {} edge points, residuals {:.3} px r.m.s., chi² per degree of freedom {:.2}{}\n",
        used(false),
        used(true),
        s.rms_px,
        s.reduced_chi2,
        if s.converged { "" } else { "; the fit did NOT converge" },
    );
    let (b, a) = (c.verdict.before.rms_deg, c.verdict.after.rms_deg);
    text += &format!(
        "directions (θi, θo, light to view) are known to {:.4}°, {:.4}°, {:.4}° (tolerances alone: {:.3}°, {:.3}°, {:.3}°)\n",
        a[0], a[1], a[2], b[0], b[1], b[2]
    );
    text += &format!(
        "where pixels look on the sample is known to {:.3} mm across the line of sight{}\n",
        c.verdict.aim_mm,
        if c.verdict.aim_mm > SURE_AIM_MM {
            ": views beyond about 65° will be left out where the edge of the lamp's spot may lie; a scan of the white sample (--kind white) tells it"
        } else {
            ""
        }
    );
    for (k, p) in PARAMETERS.iter().enumerate() {
        text += &format!("  {:<24} {:>9.4} ± {:.4} {}\n", p.name, s.row[k], s.sigma(k), p.unit);
    }
    for r in s.rejected() {
        text += &format!(
            "thrown out: {}, off by ({:.2}, {:.2}) px, {:.0} standard deviations\n",
            r.name, r.off_px[0], r.off_px[1], r.sigmas
        );
    }
    for w in &c.without_spot {
        text += &format!("not used: {w}\n");
    }
    if c.outside > 0 {
        text += &format!("no spot in the picture: {} poses\n", c.outside);
    }
    for d in &c.doubts {
        text += &format!("not good: {d}\n");
    }
    for u in &c.verdict.undetermined {
        text += &format!("undetermined: {} (up to {:.3}° in directions)", u.words, u.effect_deg);
        text += &match u.poses.is_empty() {
            true => "\n".to_owned(),
            false => format!("; what would help: {}\n", u.poses.join(", ")),
        };
    }
    text +=
        &format!("version {} written to {}; picture {}\n", version(c), output.display(), picture.display());
    text
}

fn version(c: &Calibrated) -> u32 {
    c.description.calibration_record.as_ref().map_or(0, |r| r.version)
}

fn to_json(c: &Calibrated, output: &Path, picture: &Path) -> Value {
    let s = &c.solution;
    let residual = |r: &geometry::Residual| json!({ "name": r.name, "at_px": r.at_px, "off_px": r.off_px, "sigmas": r.sigmas });
    json!({
        "output": shown(output), "picture": shown(picture), "version": version(c), "good": c.verdict.good,
        "converged": s.converged, "iterations": s.iterations, "spot_rms_px": s.rms_px, "reduced_chi2": s.reduced_chi2,
        "spots": s.residuals.iter().filter(|r| !r.edge && !r.rejected).count(),
        "edges": s.residuals.iter().filter(|r| r.edge && !r.rejected).count(),
        "rejected": s.rejected().map(residual).collect::<Vec<_>>(), "not_used": c.without_spot, "outside": c.outside, "doubts": c.doubts,
        "lost": c.lost,
        "parameters": PARAMETERS.iter().enumerate().map(|(k, p)| json!({
            "name": p.name, "value": s.row[k], "sigma": s.sigma(k), "unit": p.unit,
        })).collect::<Vec<_>>(),
        "directions_deg": { "before": c.verdict.before.rms_deg, "after": c.verdict.after.rms_deg, "after_max": c.verdict.after.max_deg },
        "aim_mm": c.verdict.aim_mm,
        "undetermined": c.verdict.undetermined.iter().map(|u| json!({
            "words": u.words, "information": u.information, "effect_deg": u.effect_deg, "poses": u.poses,
        })).collect::<Vec<_>>(),
        "gauges": c.verdict.gauges,
    })
}
