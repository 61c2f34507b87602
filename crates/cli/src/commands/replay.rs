//! `gonio replay`: the table of a recorded session, computed again.

use std::path::Path;

use gonio_recording::Session;
use gonio_render::report::Fact;
use serde_json::json;

use crate::arguments::ReplayArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, check_apart, check_free, shown};
use crate::results::{self, Files, Story};
use crate::{closure, coat, colours, fitting, isotropy, progress, reduction, rig, textures};

/// Reduces a session with the same code as a live scan: the same settings give the same bytes.
///
/// # Errors
/// [`Failure::Usage`] for a session, reference or output that cannot be used; [`Failure::Failed`] where no pose can.
pub fn run(a: &ReplayArguments, printer: Printer) -> Result<Outcome, Failure> {
    if textures::is_texture_scan(&a.session) {
        return textures::replay(a, printer);
    }
    let files = Files { table: a.output.clone(), ..Files::beside(&a.output) };
    check_free(&a.output, a.force)?;
    check_free(&files.azimuths, a.force)?;
    if a.fit.is_some() {
        files.check_free(a.force)?;
    }
    let session = Session::open(&a.session).map_err(Failure::usage)?;
    let instrument = match &a.instrument {
        Some(name) => rig::instrument(name)?,
        None => session.instrument().map_err(Failure::usage)?,
    };
    let sample = session.sample().map_err(Failure::usage)?;
    let options = coat::options(&a.coat, session.provenance().ok().as_ref())?;
    let inputs: Vec<&Path> =
        session.files().chain(a.reference.iter().map(std::path::PathBuf::as_path)).collect();
    check_apart(&a.output, &inputs)?;
    let references = reduction::references_of(&a.session, &session, &a.reference);
    // a reference is judged by the day of the scan, so that an old session stays replayable
    let day = reduction::day_of(&session);
    let calibrated = reduction::calibrate(&references, &instrument, &day, a.accept_stale)?;
    let bar = progress::bar("replay", session.pose_indices().count() as u64);
    let reduced = reduction::reduce(&session, &calibrated, &options, |k, _| bar.set_position(k as u64))?;
    bar.finish_and_clear();
    coat::insist(&a.coat, &reduced.reducer)?;
    results::write_table(&files.table, &reduced.table)?;
    isotropy::write_table(&reduced.reducer, &files)?;
    let again = closure::remounted(&a.remount, &calibrated, &options)?;
    let checks = closure::checks(&reduced.table, &reduced.reducer, &calibrated, &again);
    let mut text = format!(
        "{} of {} poses, reference {}; written to {}\n{}\n{}\n{}\n",
        reduced.reducer.statistics().len(),
        session.pose_indices().count(),
        calibrated.session.display(),
        a.output.display(),
        coat::line(&reduced.reducer),
        isotropy::line(&reduced.reducer),
        colours::line(&reduced.table.attributes),
    );
    text += &closure::lines(&checks);
    let mut fitted = None;
    if let Some(model) = &a.fit {
        let fit = results::fit(&reduced.table, model)?;
        let story = Story {
            sample: &sample,
            instrument: &instrument.name,
            poses: reduced.reducer.statistics(),
            link: None,
            devices: vec![Fact::new("replayed from", a.session.display().to_string())],
            coat: coat::section(&reduced.reducer),
            closure: &checks,
            lost: &reduced.lost,
        };
        results::write_all(&files, &reduced.table, &fit, &story)?;
        text += &format!(
            "{} ({})\n{}",
            fitting::model_name(&fit),
            fit.status.name(),
            fitting::parameter_lines(&fit)
        );
        fitted = Some(fit.to_json());
    }
    printer.result(
        &text,
        &json!({
            "session": shown(&a.session), "output": shown(&a.output), "poses": reduced.reducer.statistics(), "lost": reduced.lost,
            "reference": shown(&calibrated.session), "coat": coat::to_json(&reduced.reducer),
            "isotropy": isotropy::to_json(&reduced.reducer, &files), "fit": fitted,
            "closure": closure::to_json(&checks), "colours": colours::to_json(&reduced.table.attributes),
        }),
    );
    if reduced.lost.is_empty() { Ok(Outcome::Done) } else { Ok(Outcome::WithLoss(reduced.lost.join("; "))) }
}
